"""Exactly rigid bricks: one flexibility that grows with the build answers every grip set.

`ComplianceEngine` grows it on a spanning tree of springs, makes the operator of the gripped bricks
from it, solves the grips' equations in batches, and has the few sets that may err more than is
accepted corrected (`seqopt.engines.rigid._refinement`). `solve_mixed` is another route, for last
resorts, tests and mechanisms.
"""

from typing import TYPE_CHECKING

from seqopt._later import later
from seqopt.engines.rigid.compliance import ComplianceEngine

if TYPE_CHECKING:
    from seqopt.engines.rigid._mixed import solve_mixed

__all__ = ["ComplianceEngine", "solve_mixed"]
__getattr__, __dir__ = later(__name__, {"solve_mixed": "_mixed"})
