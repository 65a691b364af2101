"""From twists, wrenches and grip forces to the fields that an engine answers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.interface import Fields
from seqopt.network.mechanics import Statics
from seqopt.network.network import Network


@dataclass(frozen=True, eq=False, repr=False)
class Solution(FrozenValue):
    """What determines all fields of S grip sets.

    ``twist`` (S, 6b): of the bricks, m and rad. ``wrench`` (S, J, 6): of every spring of the
    network on its second body, N and N m; zero where it does not act. ``force`` (S, r, 3): of the
    grips, N; two on one brick may share theirs in any way.
    """

    twist: Floats
    wrench: Floats
    force: Floats


def respond(
    network: Network,
    statics: Statics,
    motion: Floats | sparse.csr_array,
    columns: Ints,
    solution: Solution,
) -> Fields:
    """Return the fields of grip sets.

    ``statics``: of the network. ``motion`` (3n, 6b): displacements of the nodes for unit twists;
    see `seqopt.network.mechanics.node_motion`. ``columns`` (S, r): grips as indices into
    ``network.inner.ravel()``.
    """
    twist, wrench, force = solution.twist, solution.wrench, solution.force.copy()
    sets, bricks = len(twist), twist.shape[1] // 6
    load = np.tile(network.inner_weight[: 2 * bricks], (sets, 1, 1))
    load[np.arange(sets)[:, None], columns] += force
    carried = edge_forces(network, statics, wrench, load)
    split_pairs(network, columns, force, carried)
    return Fields(
        edge_force=carried,
        displacement=(motion @ twist.T).T.reshape(sets, motion.shape[0] // 3, 3),
        grip_force=force,
        support=reactions(network, statics, wrench),
        joint_wrench=wrench,
        brick_twist=twist.reshape(sets, bricks, 6),
    )


def edge_forces(network: Network, statics: Statics, wrench: Floats, load: Floats) -> Floats:
    """Return what the edges carry.

    ``statics``: of the network; ``wrench`` (S, J, 6): of every spring of the network on its second
    body, N and N m; ``load`` (S, 2b, 3): forces at the inner nodes, those of grips among them, N.
    Result (S, E): tension positive, N.
    """
    sets, bricks = len(load), load.shape[1] // 2
    edges = network.count_edges(bricks)
    through = wrench[:, :, :3].reshape(sets, 3 * wrench.shape[1])
    carried = (statics.edge_of_spring[:edges] @ through.T).T
    carried += (statics.edge_of_load[:edges, : 6 * bricks] @ load.reshape(sets, 6 * bricks).T).T
    return np.asarray(carried)


def reactions(network: Network, statics: Statics, wrench: Floats) -> Floats:
    """Return force and moment of every ground end about its fixed point.

    ``statics``: of the network; ``wrench`` (S, J, 6): of every spring of the network on its second
    body, N and N m. Result (S, G, 6): N and N m.
    """
    at_spring = wrench[:, network.springs.support]
    return np.asarray(np.einsum("gij,sgj->sgi", statics.support_of_spring, at_spring))


def split_pairs(network: Network, columns: Ints, force: Floats, carried: Floats) -> None:
    """Let each of two grips on one brick take what reaches its own node, in place.

    ``columns`` (S, r): grips as indices into ``network.inner.ravel()``; ``force`` (S, r, 3): of the
    grips, N; ``carried`` (S, E): by the edges, N.
    """
    inner = np.flatnonzero(network.edge_spring < 0)
    edge_of = np.empty(len(network.inner), dtype=np.int64)
    edge_of[network.edge_brick[inner]] = inner
    for i, j in permutations(range(columns.shape[1]), 2):
        sets = np.flatnonzero((columns[:, i] % 2 == 0) & (columns[:, j] == columns[:, i] + 1))
        edge = edge_of[columns[sets, i] // 2]
        shift = carried[sets, edge][:, None] * network.edge_axis[edge]
        force[sets, i] += shift
        force[sets, j] -= shift
        carried[sets, edge] = 0.0
