"""Exactly rigid bricks: one compliance operator per brick count answers every grip set.

`ComplianceEngine` grows a spanning tree of springs, makes the operator of a brick count from it,
solves the grips' equations in batches and hands the few sets that would lose digits to
`solve_mixed`; `solve_dense` is a third route, for tests and for mechanisms.
"""

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.engines.rigid.dense import solve_dense
from seqopt.engines.rigid.mixed import solve_mixed

__all__ = ["ComplianceEngine", "solve_dense", "solve_mixed"]
