"""Equilibrium of rigid blocks with contact, as a second-order cone program.

Forces act at the corners of the contact faces, parts normal and tangential to the face, and at the
grips; over the heaviest block's weight, lengths over the longest lever::

    minimize    z   (or -z)
    subject to  E f + G g + w + z w' = 0
                f_n + a (s + z s') >= 0
                |f_t| <= m f_n + a (c + z c')
                |g| <= p + z p'
                0 <= z <= 100000

with E and G from `seqopt.contact.assembly.Assembly`, a the share of a corner in the contact area,
and the other letters from `seqopt.stability.limit_analysis.Case`. The multipliers of the first line
are the motion in which the structure fails. It is handed to
the solver as it stands: of an assembly's cases only a few numbers differ.

Static theorem of limit analysis with corner forces: Livesley (1978), Int. J. Numer. Methods Eng.
12; as a cone program: Portioli et al. (2014), Comput. Struct. 135.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import clarabel
import numpy as np
from scipy import sparse

from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly
from seqopt.stability.limit_analysis import CAP, Answer, Case, Claim, Program, limits

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


class _Equilibrium:
    """The program of one assembly; its columns are z, and three forces at every corner and grip."""

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        self._corners, self._grips = len(assembly.corner), len(assembly.payload)
        columns = 3 * (self._corners + self._grips)
        self._balance = sparse.hstack([assembly.contact_map, assembly.grip_map], format="csr")
        normal = np.diag([1.0, 0.0, 0.0])
        self._presses = _of_each(self._corners, normal[:1])
        self._bears = _of_each(self._corners, normal)  # the first row of a cone, but for friction
        self._slides = _of_each(self._corners, np.eye(3) - normal)
        self._holds = _of_each(self._grips, np.eye(4)[:, 1:])
        self._cones = [
            clarabel.ZeroConeT(self._balance.shape[0]),
            clarabel.NonnegativeConeT(2 + self._corners),
            *[clarabel.SecondOrderConeT(3)] * self._corners,
            *[clarabel.SecondOrderConeT(4)] * self._grips,
        ]
        self._cost = np.zeros(1 + columns)

    def __call__(self, case: Case, attempt: int = 0) -> Answer:
        """Return the solver's answer to a case, claimed and not proven; attempts count from 0."""
        blocks, corners = len(self._assembly.centroid), self._corners
        matrix, right = self._program(case)
        cost = self._cost.copy()
        cost[0] = case.sense.value
        claim, x, multipliers = _solve_cones(cost, matrix, right, self._cones, attempt)
        if claim in (Claim.STALLED, Claim.INFEASIBLE):
            x, multipliers = np.zeros_like(x), np.zeros_like(multipliers)
            x[0] = np.nan
        forces = x[1:].reshape(-1, 3)
        motion = multipliers[: 6 * blocks].reshape(blocks, 6)
        return Answer(claim, float(x[0]), forces[:corners], forces[corners:], motion)

    def _program(self, case: Case) -> tuple[sparse.csc_array, Floats]:
        """Return the matrix and the right-hand side of a case: right - matrix x is in the cones."""
        assembly, corners = self._assembly, self._corners
        start, more = limits(assembly, case, 0.0), limits(assembly, case, 1.0)
        growth = [after - before for before, after in zip(start, more, strict=True)]
        widths = (1, 3, 4)  # of what tension, cohesion and payload bound
        loads, pulls = case.loads(assembly)
        grows = [-_first_of(more, rows) for more, rows in zip(growth, widths, strict=True)]
        bounds = [_first_of(most, rows) for most, rows in zip(start, widths, strict=True)]
        contact = sparse.vstack([self._presses, case.friction * self._bears + self._slides])
        none = sparse.csr_array((2, 3 * (corners + self._grips)))
        rest = sparse.vstack([self._balance, none, sparse.block_diag([-contact, -self._holds])])
        z = np.concatenate([pulls, [-1.0, 1.0], *grows])
        right = np.concatenate([-loads, [0.0, CAP], *bounds])
        return sparse.csc_array(sparse.hstack([sparse.csc_array(z[:, None]), rest])), right


def _of_each(count: int, block: Floats) -> sparse.csr_array:
    """Return a matrix with a block for each of so many, from rows to columns of its own."""
    return sparse.csr_array(sparse.kron(sparse.eye_array(count), sparse.csr_array(block)))


def _first_of(values: Floats, rows: int) -> Floats:
    """Return values (n,) each followed by zeros, (n * rows,)."""
    return np.pad(values[:, None], ((0, 0), (0, rows - 1))).ravel()


def _solve_cones(
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


def compile_equilibrium(assembly: Assembly) -> Program:
    """Return the program of an assembly, to be called with a case."""
    return _Equilibrium(assembly)
