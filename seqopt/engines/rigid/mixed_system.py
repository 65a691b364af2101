r"""The sparse system of joint wrenches, motions and grip forces, side by side.

Stiffness form squares what separates a stiff joint from a soft chain. Kept apart, the deformations
of the joints, the equilibrium of the bricks and the stillness of the grips make one sparse system

.. math:: s + C B u = 0, \qquad -B^T s - H^T \lambda = f, \qquad H u = 0

(wrenches :math:`s`, stiffnesses :math:`C`, twists :math:`u`, grip forces :math:`\lambda`) whose
condition does not grow with the length of a chain as its stiffness does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import SuperLU, splu

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.rigid.ungripped import Ungripped


@dataclass(frozen=True, eq=False, repr=False)
class MixedSystem(FrozenValue):
    """The system of one grip set.

    Attributes
    ----------
    forbidden : (c, 6b) sparse
        Scaled twists that the grips forbid.
    matrix : (6s + 6b + c,) square sparse
    force : (3r, c) float
        Forces of the grips for unit multipliers.
    """

    forbidden: sparse.csr_array
    matrix: sparse.csc_array
    force: Floats


def mixed_system(parts: Ungripped, grips: Ints, shift: Floats | None = None) -> MixedSystem:
    """Return the system of one grip set.

    Parameters
    ----------
    parts : Ungripped
    grips : (r,) int
        Indices into ``network.inner.ravel()``.
    shift : (6b,) float, optional
        Added to the diagonal of the scaled stiffness, so that a mechanism can be factored.
    """
    rows, force = _constraints(parts, grips)
    forbidden = sparse.csr_array(rows @ sparse.diags_array(parts.twist_unit))
    matrix, joints = parts.matrix, len(parts.wrench_unit)
    if shift is not None:
        below = sparse.diags_array(np.concatenate([np.zeros(joints), shift]))
        matrix = sparse.csc_array(matrix + below)
    if len(force):
        of_all = (forbidden.data, forbidden.indices + joints, forbidden.indptr)
        rows = sparse.csr_array(of_all, shape=(forbidden.shape[0], matrix.shape[0]))
        matrix = sparse.block_array([[matrix, -rows.T], [rows, None]], format="csc")
    return MixedSystem(forbidden, sparse.csc_array(matrix), force)


def factorize(system: MixedSystem) -> SuperLU:
    """Return the factors of a system.

    Raises
    ------
    RuntimeError
        If the matrix is exactly singular.
    """
    return splu(system.matrix)


def _constraints(parts: Ungripped, grips: Ints) -> tuple[sparse.csr_array, Floats]:
    """Return independent motions that grips forbid (c, 6b), and their forces (3r, c).

    A second grip on a brick forbids nothing along the line to the first.
    """
    network = parts.network
    inner = network.inner.ravel()[grips]
    motion = parts.motion[(3 * inner[:, None] + np.arange(3)).ravel()]
    directions = []
    for i, brick in enumerate(grips // 2):
        free = np.eye(3)
        if (grips[:i] // 2 == brick).any():
            step = np.diff(network.node_position[network.inner[brick]], axis=0)
            free = linalg.null_space(step)
        directions.append(free)
    force = linalg.block_diag(*directions) if len(grips) else np.zeros((0, 0))
    return sparse.csr_array(sparse.csr_array(force.T) @ motion), force


def unscaled(parts: Ungripped, states: Floats) -> tuple[Floats, Floats]:
    """Return the wrenches and twists that scaled unknowns stand for.

    Parameters
    ----------
    parts : Ungripped
    states : (S, 6s + 6b) float

    Returns
    -------
    wrench : (S, J, 6) float
        Of every spring of the network on its second body, N and N m; zero where it does not act.
    twist : (S, 6b) float
        Of the bricks, m and rad.
    """
    springs, sets = parts.network.springs, len(states)
    joints = len(parts.wrench_unit)
    own = (states[:, :joints] * parts.wrench_unit).reshape(sets, len(parts.acting), 2, 3)
    wrench = np.zeros((sets, len(springs.since), 6))
    turned = np.einsum("nshi,sij->nshj", own, springs.axes[parts.acting])
    wrench[:, parts.acting] = turned.reshape(sets, len(parts.acting), 6)
    return wrench, states[:, joints:] * parts.twist_unit


def rescaled(parts: Ungripped, wrench: Floats, twist: Floats) -> Floats:
    """Return the scaled unknowns that stand for wrenches and twists.

    Parameters
    ----------
    parts : Ungripped
    wrench : (S, J, 6) float
        Of every spring of the network on its second body, N and N m.
    twist : (S, 6b) float
        Of the bricks, m and rad.

    Returns
    -------
    (S, 6s + 6b) float
    """
    joints = len(parts.wrench_unit)
    acting = wrench[:, parts.acting].reshape(len(wrench), len(parts.acting), 2, 3)
    own = np.einsum("nshj,sij->nshi", acting, parts.network.springs.axes[parts.acting])
    return np.hstack(
        [own.reshape(len(wrench), joints) / parts.wrench_unit, twist / parts.twist_unit]
    )
