"""What grows with the build, and what it means to edges, nodes and ground ends, by entries.

As compiled loops read it: no sparse matrix is cut for every brick count.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.rigid._response_maps import SceneMaps


class Grown(NamedTuple):
    """What unit wrenches on bricks mean, and how inner nodes (B, 6, 6) follow their bricks.

    ``borne``: what edges and ground ends bear, of `Growth.wrench`.
    """

    twist: Floats
    borne: Floats
    nodes: Floats


class Kept(NamedTuple):
    """What forces at nodes (q,) mean that all grip sets hold: three rows each, and rows of zeros.

    So many that they are a multiple of six: as many as of a brick.
    """

    node: Ints
    twist: Floats
    borne: Floats


class Edges(NamedTuple):
    """What edges carry of the forces of springs.

    ``first`` (E - B,), ``along`` (3, E - B): of all but inner edges, where the force of its spring
    is, and how much of it. ``start``, ``at``, ``much``: the entries of rows of inner ones (B,).
    """

    first: Ints
    along: Floats
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
    """Where wrenches are of ground ends (G,), and the moments (G, 6, 3) for unit ones."""

    first: Ints
    moment: Floats


class Part(NamedTuple):
    """A partial structure: counts, and what `inner_edges` says of its bricks."""

    bricks: int
    borne: int
    edges: int
    nodes: int  # none where nobody asks how far they move
    at_second: Floats
    axis: Floats


def maps_by_entry(scene: SceneMaps, columns: Ints) -> tuple[Edges, Motion, Ends]:
    """Return what wrenches and twists of a whole scene mean, in space.

    ``columns``: which numbers of wrenches are kept.
    """
    place = np.full(scene.edge.shape[1], scene.edge.shape[1])  # of others behind all
    place[columns] = np.arange(len(columns))
    spring = scene.network.edge_spring
    through, outer = scene.edge[spring < 0], scene.edge[spring >= 0].tocoo()
    along = np.zeros((3, outer.shape[0]))
    along[outer.col % 6, outer.row] = outer.data
    rows = through.indptr.astype(np.int64), place[through.indices], through.data
    edges = Edges(place[6 * spring[spring >= 0]], along, *rows)
    moment = np.ascontiguousarray(scene.support[:, :, 3:])
    ends = Ends(place[6 * scene.network.springs.support], moment)
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
