"""Discrete elements: rigid bricks on beds of springs that open, slip and break.

`DiscreteEngine` lays a bed over every joint's face (`BedStiffness` and `Mortar` say what it
carries), holds nodes or pinches bricks between pads (`Pinch`), and follows the structure to rest.
"""

from seqopt.engines.discrete._system import BedStiffness
from seqopt.engines.discrete.engine import Across, DiscreteEngine, Pinch

__all__ = ["Across", "BedStiffness", "DiscreteEngine", "Pinch"]
