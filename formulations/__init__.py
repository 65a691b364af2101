"""Mathematical programs for choosing grips, one per file.

A formulation takes a graph (`seqopt.graph.graph.Graph`) and returns a path through it; see
`formulations.on_graph`. Its module docstring displays the program that it solves. Each is
registered as an entry point of the group ``seqopt.formulations``.
"""
