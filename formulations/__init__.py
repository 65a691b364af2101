"""Mathematical programs for support placement: one file each, none imports another.

A formulation takes the problem as one value (`seqopt.placement.interface.PlacementProblem`) and
selection, a candidate per move; its module docstring displays the program that it solves. Each is
registered as an entry point of the group ``seqopt.formulations``.
"""
