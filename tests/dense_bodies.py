"""Rigid bodies on springs by one dense matrix: of the engines, only how products are summed.

Unknown are the twists of all bodies and the forces of the grips, at once. The matrix is factorized
in double precision; its answer is refined against residuals that are summed with twice the digits,
until it no longer changes. Edges carry what recovery makes of these forces, as in the engines.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Fields
from seqopt.engines.rigid._mixed import Solution, add_products, respond
from seqopt.errors import SolverError
from seqopt.network._mechanics import build_statics, node_motion
from seqopt.network.network import GROUND, Network

SETTLED = 1e-14  # relative change of an answer that is settled
ROUNDS = 12


def dense_fields(network: Network, bricks: int, columns: Ints) -> Fields:
    """Return the fields of one grip set, at most one grip on each brick.

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    columns : (r,) int
        Grips as indices into ``network.inner.ravel()``.

    Returns
    -------
    Fields

    Raises
    ------
    SolverError
        If refinement does not settle.
    """
    springs = network.springs
    acting = np.flatnonzero(springs.since <= bricks)
    gap = _gaps(network, acting, bricks)
    stiffness = np.hstack([springs.translational_stiffness, springs.rotational_stiffness])[acting]
    nodes = np.arange(2 * bricks)
    carried = _carried(network, nodes, bricks)
    load = carried.T @ network.inner_weight[nodes].ravel()
    held = carried.toarray()[(3 * columns[:, None] + np.arange(3)).ravel()]
    twist, force, stretch = _refined(gap, stiffness.ravel(), held, load)
    own = -(stiffness * stretch.reshape(-1, 6))
    wrench = np.zeros((1, len(springs.since), 6))
    for part in (slice(0, 3), slice(3, 6)):
        wrench[0, acting, part] = np.einsum("sa,saj->sj", own[:, part], springs.axes[acting])
    solution = Solution(twist[None], wrench, force.reshape(1, len(columns), 3))
    motion = node_motion(network, bricks)
    return respond(network, build_statics(network), motion, columns[None], solution)


def _levers(arm: Floats) -> Floats:
    """Return the displacements (n, 3, 6) of points at arms from centroids for unit twists."""
    out = np.zeros((len(arm), 3, 6))
    out[:, :, :3] = np.eye(3)
    for axis in range(3):
        out[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arm)
    return out


def _spread(row: Ints, body: Ints, block: Floats, rows: int, bricks: int) -> sparse.csr_array:
    """Return blocks (n, k, 6) as a matrix (k * rows, 6 * bricks)."""
    count, height = block.shape[:2]
    down = np.broadcast_to(
        (height * row[:, None] + np.arange(height))[:, :, None], (count, height, 6)
    )
    right = np.broadcast_to((6 * body[:, None] + np.arange(6))[:, None], (count, height, 6))
    shape = (height * rows, 6 * bricks)
    return sparse.csr_array((block.ravel(), (down.ravel(), right.ravel())), shape=shape)


def _carried(network: Network, nodes: Ints, bricks: int) -> sparse.csr_array:
    """Return the displacements of inner nodes for unit twists of the bodies."""
    body = nodes // 2
    arm = network.node_position[network.inner.ravel()[nodes]] - network.centroid[body]
    return _spread(nodes, body, _levers(arm), len(nodes), bricks)


def _gaps(network: Network, acting: Ints, bricks: int) -> sparse.csr_array:
    """Return how springs deform in their own axes for unit twists of the bodies."""
    springs = network.springs
    row, side = np.nonzero(springs.bodies[acting] != GROUND)
    spring = acting[row]
    body = springs.bodies[spring, side]
    block = np.zeros((len(spring), 6, 6))
    block[:, :3] = _levers(springs.position[spring] - network.centroid[body])
    block[:, 3:, 3:] = np.eye(3)
    block *= np.where(side == 1, 1.0, -1.0)[:, None, None]
    turned = np.einsum("sij,spjk->spik", springs.axes[spring], block.reshape(-1, 2, 3, 6))
    return _spread(row, body, turned.reshape(-1, 6, 6), len(acting), bricks)


def _refined(
    gap: sparse.csr_array, stiffness: Floats, held: Floats, load: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return twists (6b,), grip forces (3r,) and deformations of springs (6s,)."""
    size = gap.shape[1]
    matrix = np.zeros((size + len(held),) * 2)
    matrix[:size, :size] = (gap.T @ (gap * stiffness[:, None])).toarray()
    matrix[:size, size:], matrix[size:, :size] = -held.T, held
    scale = np.ones(len(matrix))
    scale[:size] = 1 / np.sqrt(np.diag(matrix)[:size])
    scale[size:] = 1 / np.abs(held * scale[:size]).max(axis=1, initial=0)
    factors = linalg.lu_factor(matrix * scale[:, None] * scale)
    pulls = sparse.csr_array(sparse.hstack([-gap.T, sparse.csr_array(held.T)]))
    tied = sparse.csr_array(held)
    answer, change = np.zeros(len(matrix)), np.zeros(len(matrix))
    for _ in range(ROUNDS):
        answer = answer + change
        stretch = add_products(np.zeros(gap.shape[0]), gap, answer[:size])
        left = add_products(load, pulls, np.concatenate([stiffness * stretch, answer[size:]]))
        moved = add_products(np.zeros(len(held)), tied, -answer[:size])
        change = scale * linalg.lu_solve(factors, scale * np.concatenate([left, moved]))
        parts = ((change[:size], answer[:size]), (change[size:], answer[size:]))
        if all(np.abs(a).max(initial=0) <= SETTLED * np.abs(b).max(initial=0) for a, b in parts):
            stretch = add_products(gap @ change[:size], gap, answer[:size])  # as of both
            return answer[:size], answer[size:], stretch
    raise SolverError(f"dense bodies: {size // 6} bricks do not settle in {ROUNDS} rounds")
