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
from seqopt.network.kinematics import deformation, node_motion, point_motion
from seqopt.network.network import Network
from seqopt.network.statics import Statics, build_statics


@dataclass(frozen=True, eq=False, repr=False)
class Ungripped(FrozenValue):
    """What the systems of all grip sets of a partial structure have in common, scaled to order one.

    Attributes
    ----------
    network : Network
    bricks : int
    motion : (3n, 6b) sparse
        Displacements of the nodes for unit twists.
    inner : (6b, 6b) sparse
        Those of the inner nodes for scaled twists, in the order of ``network.inner``, m.
    statics : Statics
        Of the network.
    deformation : (6s, 6b) sparse
        Scaled deformation of the acting springs, in their own axes, for scaled twists.
    stiffness : (6s,) float
        Over ``unit``.
    matrix : (6s + 6b,) square sparse
        The system without grips.
    load : (6b,) float
        The weight, scaled.
    acting : (s,) int
    twist_unit, wrench_unit : (6b,), (6s,) float
        What turns scaled twists into m and rad, scaled wrenches into N and N m.
    unit : float
        N/m.
    """

    network: Network
    bricks: int
    motion: sparse.csr_array
    inner: sparse.csr_array
    statics: Statics
    deformation: sparse.csr_array
    stiffness: Floats
    matrix: sparse.csr_array
    load: Floats
    acting: Ints
    twist_unit: Floats
    wrench_unit: Floats
    unit: float


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


def ungripped_system(network: Network, bricks: int, statics: Statics | None = None) -> Ungripped:
    """Return what all systems of a partial structure have in common.

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    statics : Statics, optional
        Of the network; made anew by default.

    Returns
    -------
    Ungripped
    """
    springs = network.springs
    acting = springs.acting(bricks)
    steps = np.diff(network.node_position[network.inner[:bricks]], axis=1)
    length = float(np.linalg.norm(steps, axis=2).max())
    lever = np.array([1.0, 1.0, 1.0, length, length, length])
    raw = (springs.stiffness[acting] / lever**2).ravel()
    unit = float(np.median(raw[raw > 0])) if raw.any() else 1.0
    stiffness = raw / unit
    twist_unit = np.tile(1 / lever, bricks)
    gap = _scaled_gap(network, bricks, lever)
    inner = _inner_motion(network, bricks, twist_unit)
    weight = network.inner_weight[: 2 * bricks].ravel()
    return Ungripped(
        network=network,
        bricks=bricks,
        motion=node_motion(network, bricks),
        inner=inner,
        statics=build_statics(network) if statics is None else statics,
        deformation=gap,
        stiffness=stiffness,
        matrix=_side_by_side(gap, stiffness),
        load=inner.T @ weight / unit,
        acting=acting,
        twist_unit=twist_unit,
        wrench_unit=unit * np.tile(lever, len(acting)),
        unit=unit,
    )


def _scaled_gap(network: Network, bricks: int, lever: Floats) -> sparse.csr_array:
    """Return the deformation (6s, 6b) of the acting springs, all components made lengths."""
    springs = network.springs
    mine, center = springs.acting(bricks), network.centroid[:bricks]
    gap = deformation(springs.bodies[mine], springs.position[mine], center, springs.axes[mine])
    gap.data *= np.repeat(np.tile(lever, len(mine)), np.diff(gap.indptr))
    gap.data /= np.tile(lever, bricks)[gap.indices]
    return gap


def _inner_motion(network: Network, bricks: int, twist_unit: Floats) -> sparse.csr_array:
    """Return the displacements (6b, 6b) of the inner nodes for scaled twists, m."""
    brick = np.repeat(np.arange(bricks), 2)
    node = network.inner[:bricks].ravel()
    block = point_motion(network.node_position[node] - network.centroid[brick])
    block = block * twist_unit.reshape(bricks, 1, 6)[brick]
    column = np.broadcast_to(6 * brick[:, None, None] + np.arange(6), block.shape)
    rows = np.arange(0, block.size + 1, 6)
    return sparse.csr_array((block.ravel(), column.ravel(), rows), shape=(6 * bricks, 6 * bricks))


def _side_by_side(gap: sparse.csr_array, stiffness: Floats) -> sparse.csr_array:
    """Return the system without grips, row by row, from the scaled deformation (6s, 6b)."""
    row = 1 / np.maximum(1.0, stiffness)  # keeps a stiff joint's equation of order one
    joints, moves = gap.shape
    pulled = np.repeat(row * stiffness, np.diff(gap.indptr)) * gap.data
    carried = gap.tocsc()
    return sparse.csr_array(
        (
            np.concatenate([np.insert(pulled, gap.indptr[:-1], row), -carried.data]),
            np.concatenate(
                [np.insert(gap.indices + joints, gap.indptr[:-1], range(joints)), carried.indices]
            ),
            np.concatenate(
                [gap.indptr + np.arange(joints + 1), carried.indptr[1:] + gap.nnz + joints]
            ),
        ),
        shape=(joints + moves, joints + moves),
    )


def mixed_system(parts: Ungripped, grips: Ints, shift: Floats | None = None) -> MixedSystem:
    """Return the system of one grip set.

    Parameters
    ----------
    parts : Ungripped
    grips : (r,) int
        Indices into ``network.inner.ravel()``.
    shift : (6b,) float, optional
        Added to the diagonal of the scaled stiffness, so that a mechanism can be factored.

    Returns
    -------
    MixedSystem
    """
    rows, force = _constraints(parts, grips)
    forbidden = sparse.csr_array(rows @ sparse.diags_array(parts.twist_unit))
    matrix, joints = parts.matrix, len(parts.wrench_unit)
    if shift is not None:
        below = sparse.diags_array(np.concatenate([np.zeros(joints), shift]))
        matrix = sparse.csr_array(matrix + below)
    if len(force):
        of_all = (forbidden.data, forbidden.indices + joints, forbidden.indptr)
        rows = sparse.csr_array(of_all, shape=(forbidden.shape[0], matrix.shape[0]))
        matrix = sparse.block_array([[matrix, -rows.T], [rows, None]], format="csr")
    return MixedSystem(forbidden, sparse.csc_array(matrix), force)


def factorize(system: MixedSystem) -> SuperLU:
    """Return the factors of a system.

    Parameters
    ----------
    system : MixedSystem

    Returns
    -------
    SuperLU

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
