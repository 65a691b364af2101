"""Cone programs as arrays, handed to Clarabel as they stand; it poses none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import clarabel
import numpy as np
from scipy import sparse

from seqopt.arrays import Floats
from seqopt.stability.limit_analysis import Claim

CONE_OPTIONS: tuple[dict[str, object], ...] = (
    {"equilibrate_enable": False, "static_regularization_constant": 1e-7},
    {},
)  # by attempt. A program scaled by its author stalls less without the solver's own scaling: on the
# 98 steps of the two-robot methods with epoxy 0 of 1,174 cases, else 23 of 1,142
SECONDS = 300.0  # a cone program that takes longer has stalled
ENDS = {
    "Solved": Claim.SOLVED,
    "AlmostSolved": Claim.ALMOST,
    "PrimalInfeasible": Claim.INFEASIBLE,
}  # any other end, a limit reached among them, is a stall


def solve_cones(
    cost: Floats, matrix: sparse.csc_array, right: Floats, cones: Sequence[Any], attempt: int
) -> tuple[Claim, Floats, Floats]:
    """Minimize a cost (n,) where right (m,) - matrix (m, n) x is in cones, by Clarabel.

    The attempt is an index into `CONE_OPTIONS`. Returns how it ended, x (n,) and the multipliers
    (m,); a solver that fails has stalled.
    """
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads, settings.time_limit = False, 1, SECONDS
    for name, value in CONE_OPTIONS[attempt].items():
        setattr(settings, name, value)
    none = sparse.csc_matrix((len(cost), len(cost)))
    try:
        solver = clarabel.DefaultSolver(
            none, cost, sparse.csc_matrix(matrix), right, cones, settings
        )
        found = solver.solve()
    except BaseException as error:  # a panic of its kernel is none of Exception
        if isinstance(error, KeyboardInterrupt | SystemExit | MemoryError):
            raise
        return Claim.STALLED, np.full(len(cost), np.nan), np.zeros(len(right))
    return ENDS.get(str(found.status), Claim.STALLED), np.array(found.x), np.array(found.z)
