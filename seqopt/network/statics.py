"""Equilibrium of the network: forces of edges and supports, from spring and node forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, skew
from seqopt.network.network import Network, PartKind


@dataclass(frozen=True, eq=False, repr=False)
class Statics(FrozenValue):
    """Linear maps from forces to what the edges and the supports carry, for the whole scene.

    Attributes
    ----------
    edge_of_spring : (E, 3S) sparse
        Axial edge forces for unit forces that springs exert on their second bodies.
    edge_of_load : (E, 6B) sparse
        Axial edge forces for unit forces on the inner nodes, in the order of `Network.inner`.
    support_of_spring : (G, 6, 6) float
        Force and moment at the fixed point of every ground end, in the scene's order, for the
        wrench its spring exerts on its second body.
    """

    edge_of_spring: sparse.csr_array
    edge_of_load: sparse.csr_array
    support_of_spring: Floats


def build_statics(network: Network) -> Statics:
    """Return the equilibrium maps of a network.

    A half-edge or a stub carries its spring's force along its own axis. An inner edge carries
    along its axis what reaches its second node: the load there and the half-edges that end there.

    Parameters
    ----------
    network : Network

    Returns
    -------
    Statics
    """
    axis, kind, spring = network.edge_axis, network.edge_kind, network.edge_spring
    springs = network.springs
    outer = np.flatnonzero(kind != PartKind.INNER.value)
    on_first = (springs.bodies[spring[outer], 0] == network.edge_brick[outer]) & (
        kind[outer] == PartKind.JOINT.value
    )
    sign = np.where(on_first, -1.0, 1.0)[:, None]
    inner = np.flatnonzero(kind == PartKind.INNER.value)
    inner_edge = np.empty(len(network.inner), dtype=np.int64)
    inner_edge[network.edge_brick[inner]] = inner
    half = kind[outer] == PartKind.JOINT.value
    brick = network.edge_brick[outer]
    arrives = half & (network.edge_nodes[outer, 0] == network.inner[brick, 1])
    through = inner_edge[brick[arrives]]
    rows = np.concatenate([outer, through])
    columns = np.concatenate([spring[outer], spring[outer[arrives]]])
    values = np.vstack([sign * axis[outer], sign[arrives] * axis[through]])
    second = 2 * network.edge_brick[inner] + 1
    support = springs.support
    moment = np.tile(np.eye(6), (len(support), 1, 1))
    moment[:, 3:, :3] = skew(springs.position[support] - springs.anchor[support])
    return Statics(
        edge_of_spring=_by_threes(rows, columns, values, (len(axis), len(springs.since))),
        edge_of_load=_by_threes(inner, second, axis[inner], (len(axis), network.inner.size)),
        support_of_spring=moment,
    )


def _by_threes(
    rows: np.ndarray, columns: np.ndarray, values: Floats, shape: tuple[int, int]
) -> sparse.csr_array:
    """Return a sparse matrix whose row vectors of three stand at columns 3c, 3c+1, 3c+2."""
    spread = (3 * columns[:, None] + np.arange(3)).ravel()
    entries = (values.ravel(), (np.repeat(rows, 3), spread))
    return sparse.csr_array(entries, shape=(shape[0], 3 * shape[1]))
