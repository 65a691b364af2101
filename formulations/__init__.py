"""Mathematical programs for choosing grips, one per file.

A formulation takes the problem as one value (`seqopt.graph.layers.interface.PlacementProblem`) and
returns a selection, one candidate per move. Its module docstring displays the program that it
solves. Each is registered as an entry point of the group ``seqopt.formulations``.
"""
