r"""One factorization for all grip sets of a partial structure, loose parts included.

Parts that nothing, or only something soft, ties to the rest can move by themselves: a brick that
robots alone hold, what turns about a hinge. The system of `seqopt.engines.rigid.mixed_system`
without grips is then singular, or nearly. Held at one brick of each such part, :math:`W u =
\alpha`, it is as good as that of a sound structure; how far the loose motions go, :math:`\alpha`,
is an unknown of each grip set beside the forces of its grips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.sparse.linalg import SuperLU, splu

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.rigid.ungripped import Ungripped
from seqopt.errors import SolverError
from seqopt.network.kinematics import point_motion
from seqopt.network.network import GROUND

NEAR = 0.1  # of the largest: a pivot that large is taken if it fills less, and corrected after
PANEL = 4  # columns that are eliminated together: few, since each meets few others
SOFT = 1e-7  # stiffness over the typical one below which a direction ties nothing


@dataclass(frozen=True)
class HeldSystem:
    """The factored system of a partial structure whose loose motions are held.

    Attributes
    ----------
    parts : Ungripped
    loose : int
        How many loose motions there are, m.
    factors : SuperLU
        Of the system of 6s wrenches, 6b twists and m forces that hold.
    """

    parts: Ungripped
    loose: int
    factors: SuperLU

    def solve(self, loads: Floats, moved: Floats | None = None) -> tuple[Floats, Floats]:
        """Return the answers to right-hand sides.

        Parameters
        ----------
        loads : (S, 6s + 6b) float
            Scaled, of the springs' equations and of equilibrium.
        moved : (S, m) float, optional
            How far the loose motions are moved, m; nowhere by default.

        Returns
        -------
        states : (S, 6s + 6b) float
            Scaled.
        force : (S, m) float
            With which the loose motions must be pulled, N.
        """
        whole = np.zeros((loads.shape[1] + self.loose, len(loads)), order="F")
        whole[: loads.shape[1]] = loads.T
        if moved is not None:
            whole[loads.shape[1] :] = moved.T
        answer = self.factors.solve(whole).T
        states, force = np.split(answer, [loads.shape[1]], axis=1)
        return states, force * self.parts.unit


def hold_loose(parts: Ungripped, *, tied: bool = False) -> HeldSystem:
    """Return the factored system of a partial structure with its loose motions held.

    Parameters
    ----------
    parts : Ungripped
    tied : bool, optional
        Whether springs are known to tie every brick to the ground, however softly.

    Raises
    ------
    SolverError
        If it is exactly singular all the same.
    """
    matrix, rows = parts.matrix, _held_motions(parts, tied=tied)
    if rows.shape[0]:
        joints = len(parts.wrench_unit)
        wide = sparse.csr_array(
            (rows.data, rows.indices + joints, rows.indptr), shape=(rows.shape[0], matrix.shape[0])
        )
        matrix = sparse.block_array([[matrix, -wide.T], [wide, None]], format="csc")
    try:
        # springs first, then bricks as they are built: neighbors stand near each other
        factors = splu(
            sparse.csc_array(matrix),
            permc_spec="NATURAL",
            diag_pivot_thresh=NEAR,
            panel_size=PANEL,
        )
    except RuntimeError as error:  # SuperLU met an exactly zero pivot
        raise SolverError(
            f"{parts.bricks} bricks: exactly singular in double precision; stiffen what is soft"
        ) from error
    return HeldSystem(parts, rows.shape[0], factors)


def _held_motions(parts: Ungripped, *, tied: bool) -> sparse.csr_array:
    """Return the rows (m, 6b) whose products with scaled twists say how far loose motions go."""
    stiff = parts.stiffness.reshape(-1, 6)
    firm = stiff.min(axis=1) >= SOFT
    none = sparse.csr_array((0, 6 * parts.bricks))
    if tied and firm.all():
        return none
    label, first = _clusters(parts, firm)
    if not len(first):
        return none
    rigid = _cluster_motions(parts, label, first)
    soft = np.repeat(~firm, 6)
    strain = np.sqrt(parts.stiffness[soft])[:, None] * (parts.deformation[soft] @ rigid)
    _, sizes, modes = np.linalg.svd(strain)  # SciPy 1.12 refuses an empty matrix
    weak = np.ones(len(modes), dtype=bool)
    weak[: len(sizes)] = sizes < np.sqrt(SOFT)
    held = (6 * first[:, None] + np.arange(6)).ravel()
    rows = sparse.lil_array((int(weak.sum()), 6 * parts.bricks))
    rows[:, held] = np.linalg.pinv((rigid @ modes[weak].T)[held])
    return sparse.csr_array(rows)


def _clusters(parts: Ungripped, firm: Bools) -> tuple[Ints, Ints]:
    """Return which group of firmly tied bricks each belongs to, and their first bricks.

    The group that is tied to the ground is -1 and has no first brick here.
    """
    bodies = parts.network.springs.bodies[parts.acting[firm]]
    ends = np.where(bodies == GROUND, parts.bricks, bodies)
    size = parts.bricks + 1
    tied = sparse.coo_array((np.ones(len(ends)), tuple(ends.T)), shape=(size, size))
    _, label = csgraph.connected_components(tied, directed=False)
    loose = np.flatnonzero(label[:-1] != label[-1])
    names, first, own = np.unique(label[loose], return_index=True, return_inverse=True)
    out = np.full(parts.bricks, -1)
    out[loose] = own
    return out, loose[first][np.arange(len(names))]


def _cluster_motions(parts: Ungripped, label: Ints, first: Ints) -> Floats:
    """Return the scaled twists (6b, 6c) of all bricks when groups of them move as one."""
    center = parts.network.centroid[: parts.bricks]
    out = np.zeros((parts.bricks, 6, len(first), 6))
    for group, lead in enumerate(first):
        mine = np.flatnonzero(label == group)
        out[mine, :3, group] = point_motion(center[mine] - center[lead])
        out[mine, 3:, group, 3:] = np.eye(3)
    return out.reshape(6 * parts.bricks, -1) / parts.twist_unit[:, None]
