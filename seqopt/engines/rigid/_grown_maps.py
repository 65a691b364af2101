"""What grows with the build, and what it means to edges, nodes and ground ends, by entries.

As compiled loops read it: no sparse matrix is cut for every brick count.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.rigid._response_maps import SceneMaps


class Grown(NamedTuple):
    """What unit wrenches on bricks mean, and how inner nodes (B, 6, 6) follow their bricks."""

    twist: Floats
    wrench: Floats
    nodes: Floats


class Edges(NamedTuple):
    """What edges carry of the forces of springs.

    ``spring`` (E,), ``along`` (3, E): of all but inner edges, which spring, and how much of its
    force. ``inner`` (B,): the inner edge of each brick, of whose rows ``start``, ``at`` and
    ``much`` are the entries.
    """

    spring: Ints
    along: Floats
    inner: Ints
    start: Ints
    at: Ints
    much: Floats


class Motion(NamedTuple):
    """How nodes follow bricks: entries of a matrix, and from which brick count on each holds.

    ``first`` (B + 1,), ``node``: the nodes that follow each brick; ``reach`` (B,): how far from its
    centroid the last of these is, m.
    """

    start: Ints
    at: Ints
    much: Floats
    since: Ints
    first: Ints
    node: Ints
    reach: Floats


class Ends(NamedTuple):
    """The springs (G,) of ground ends, and the moments (G, 6, 3) for unit wrenches of these."""

    spring: Ints
    moment: Floats


class Part(NamedTuple):
    """A partial structure: counts, and what `inner_edges` says of its bricks."""

    bricks: int
    springs: int
    edges: int
    nodes: int  # none where nobody asks how far they move
    at_second: Floats
    axis: Floats


def maps_by_entry(scene: SceneMaps) -> tuple[Edges, Motion, Ends]:
    """Return what wrenches and twists of a whole scene mean, in space."""
    network, edge = scene.network, scene.edge.tocoo()
    inner = np.flatnonzero(network.edge_spring < 0)
    along, outer = np.zeros((3, edge.shape[0])), network.edge_spring[edge.row] >= 0
    along[edge.col[outer] % 6, edge.row[outer]] = edge.data[outer]
    through = scene.edge[inner]
    rows = through.indptr.astype(np.int64), through.indices.astype(np.int64), through.data
    edges = Edges(np.maximum(network.edge_spring, 0), along, inner, *rows)
    ends = Ends(network.springs.support, np.ascontiguousarray(scene.support[:, :, 3:]))
    return edges, _motion_of(scene), ends


def _motion_of(scene: SceneMaps) -> Motion:
    network, entries = scene.network, scene.motion.tocoo()
    start, at = (part.astype(np.int64) for part in (scene.motion.indptr, scene.motion.indices))
    pairs = np.unique(np.stack([entries.col // 6, entries.row // 3]), axis=1)
    brick, node = pairs.astype(np.int64)
    first = np.searchsorted(brick, np.arange(len(network.inner) + 1))
    arm = np.linalg.norm(network.node_position[node] - network.centroid[brick], axis=1)
    reach = np.maximum.reduceat(arm, first[:-1])  # each has its inner nodes at least
    return Motion(start, at, scene.motion.data, scene.since, first, node, reach)
