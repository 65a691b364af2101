"""Discrete elements: rigid bricks on beds of springs that open, slip and break.

`DiscreteEngine` lays a bed over every joint's face (`BedStiffness` and `Mortar` say what it
carries), holds nodes, and follows the structure to rest.
"""
