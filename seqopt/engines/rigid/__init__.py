"""Exactly rigid bricks: one flexibility that grows with the build answers every grip set.

`ComplianceEngine` grows it on a spanning tree of springs, makes the operator of the gripped bricks
from it, solves the grips' equations in batches, and has the few sets that may err more than is
accepted corrected (`seqopt.engines.rigid._refinement`). `solve_mixed` is another route, for last
resorts, tests and mechanisms.
"""
