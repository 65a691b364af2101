"""From twists, wrenches and grip forces to the fields that an engine answers."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Fields
from seqopt.network.network import Network
from seqopt.network.statics import Statics


def stack(
    network: Network, bricks: int, columns: Ints, answers: list[tuple[Floats, ...]]
) -> Fields:
    """Return the fields of grip sets (S, r) from the answer of each."""
    edges, nodes = network.count_edges(bricks), network.count_nodes(bricks)
    shapes = (
        (edges,),
        (nodes, 3),
        (columns.shape[1], 3),
        (6,),
        (len(network.springs.since), 6),
        (bricks, 6),
    )
    return Fields(
        *(
            np.array([answer[i] for answer in answers]).reshape(len(answers), *shape)
            for i, shape in enumerate(shapes)
        )
    )


def respond(
    network: Network,
    grips: Ints,
    *,
    maps: Statics,
    motion: Floats | sparse.csr_array,
    twist: Floats,
    wrench: Floats,
    force: Floats,
) -> tuple[Floats, ...]:
    """Return the fields of one grip set, in the order of `Fields`, from what determines them.

    Parameters
    ----------
    grips : (r,) int
    maps : Statics
        Of the network.
    motion : (3N, 6b) float
        Displacements of the nodes for unit twists.
    twist, wrench, force : (6b,), (S, 6), (r, 3) float
        Of bricks, springs and grips; two grips on one brick may share their force in any way.
    """
    bricks = len(twist) // 6
    edges = network.count_edges(bricks)
    load = np.repeat(0.5 * network.weight[:bricks], 2, axis=0)
    load[grips] += force
    carried = maps.edge_of_spring[:edges] @ wrench[:, :3].ravel()
    carried += maps.edge_of_load[:edges, : load.size] @ load.ravel()
    _split_pairs(network, grips, force, carried)
    support = maps.support_of_spring @ wrench[network.springs.support]
    moved = (motion @ twist).reshape(-1, 3)
    return carried, moved, force, support, wrench, twist.reshape(-1, 6)


def _split_pairs(network: Network, grips: Ints, force: Floats, carried: Floats) -> None:
    """Let each of two grips on one brick take what reaches its own node."""
    for brick in np.flatnonzero(np.bincount(grips // 2) == 2):
        edge = int(np.flatnonzero((network.edge_brick == brick) & (network.edge_spring < 0))[0])
        second = np.flatnonzero(grips == 2 * brick + 1)[0]
        first = np.flatnonzero(grips == 2 * brick)[0]
        force[second] -= carried[edge] * network.edge_axis[edge]
        force[first] += carried[edge] * network.edge_axis[edge]
        carried[edge] = 0.0
