"""The extremes of the fields of many grip sets, without the fields.

Who compares grip sets asks for the largest tension of any edge, the largest displacement of any
node, the largest moment at any ground end. Where a structure has more nodes than there are grip
sets, most of what an operator holds is asked of none of them. What the grips of a set move at each
other, and what they and the weight do to bricks and springs, is then read from
`seqopt.engines.rigid._growth` itself, by the loops of `seqopt.engines.rigid._compiled` where numba
is installed. What that means to edges, nodes and ground ends stands by entries: no sparse matrix is
cut for every brick count. Else extremes are taken from fields, which are the reference.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Fields, Want
from seqopt.engines.rigid._grip_equations import (
    GripForces,
    brace,
    pairs_of,
    solve_positive,
    well_conditioned,
)
from seqopt.engines.rigid._operator import (
    Doubts,
    OperatorBuilder,
    ResponseMaps,
    SceneMaps,
    load_rows,
)
from seqopt.work._workers import cores, in_threads, one_thread

_SETS = 64  # grip sets that a thread takes at least


class Extremes(NamedTuple):
    """Extremes of the fields of S grip sets.

    ``least``, ``most`` (S,): force of any edge, N; ``shift`` (S,): displacement of any node, m;
    ``moment`` (S,): at any ground end, N m; ``force`` (S, r): of every grip, N. What was not asked
    for means nothing.
    """

    least: Floats
    most: Floats
    shift: Floats
    moment: Floats
    force: Floats


def extremes_in(fields: Fields, want: Want) -> Extremes:
    """Return the extremes of fields that are there."""
    sets = len(fields.grip_force)
    found = np.zeros((4, sets))
    if want & Want.EDGES:
        found[:2] = fields.edge_force.min(axis=1), fields.edge_force.max(axis=1)
    if want & Want.DISPLACEMENTS:
        found[2] = _squared(fields.displacement).max(axis=1)
    if want & Want.SUPPORT:
        found[3] = _squared(fields.support[..., 3:]).max(axis=1)
    np.sqrt(found[2:], out=found[2:])
    size = np.sqrt(_squared(fields.grip_force))
    return Extremes(found[0], found[1], found[2], found[3], size)


def _squared(vectors: Floats) -> Floats:
    """Return the squares of lengths (S, n) of vectors (S, n, 3), of which NumPy takes thrice."""
    return np.asarray(np.einsum("snk,snk->sn", vectors, vectors))


@cache
def can_compile() -> bool:
    """Return whether loops can be compiled: numba is there."""
    return find_spec("numba") is not None


class Grown(NamedTuple):
    """What unit wrenches on bricks mean, and how inner nodes (B, 6, 6) follow their bricks."""

    twist: Floats
    wrench: Floats
    nodes: Floats


class Edges(NamedTuple):
    """What edges carry of the forces of springs.

    ``first`` (E - B,), ``along`` (3, E - B): of all but inner edges, where the force of its spring
    is, and how much of it. ``start``, ``at``, ``much``: the entries of rows of inner edges (B,).
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
    """A partial structure: counts, and what `ResponseMaps.inner` says."""

    bricks: int
    wrenches: int  # numbers: six for every spring that acts
    edges: int
    nodes: int  # none where nobody asks how far they move
    at_second: Floats
    axis: Floats


def maps_by_entry(scene: SceneMaps) -> tuple[Edges, Motion, Ends]:
    """Return the response maps of wrenches and twists of a whole scene, in space."""
    network, spring = scene.network, scene.network.edge_spring
    through, outer = scene.edge[spring < 0], scene.edge[spring >= 0].tocoo()
    along = np.zeros((3, outer.shape[0]))
    along[outer.col % 6, outer.row] = outer.data
    rows = through.indptr.astype(np.int64), through.indices.astype(np.int64), through.data
    edges = Edges(6 * spring[spring >= 0], along, *rows)
    entries = scene.motion.tocoo()
    start, at = (part.astype(np.int64) for part in (scene.motion.indptr, scene.motion.indices))
    pairs = np.unique(np.stack([entries.col // 6, entries.row // 3]), axis=1)
    brick, node = pairs.astype(np.int64)
    first = np.searchsorted(brick, np.arange(len(network.inner) + 1))
    arm = np.linalg.norm(network.node_position[node] - network.centroid[brick], axis=1)
    reach = np.maximum.reduceat(arm, first[:-1])  # each has its inner nodes at least
    motion = Motion(start, at, scene.motion.data, scene.since, first, node, reach)
    moment = np.ascontiguousarray(scene.support[:, :, 3:])
    return edges, motion, Ends(6 * network.springs.support, moment)


class GrownExtremes:
    """Answers grip sets of the brick count that a growth has reached.

    ``builder``: in space, of a scene whose grips transmit no moments and whose ground stays.
    """

    def __init__(self, builder: OperatorBuilder) -> None:
        self._network, self._growth = builder.network, builder.growth
        self._grown = Grown(self._growth.twist, self._growth.wrench, builder.nodes)
        self._scene, self._maps = builder.maps, maps_by_entry(builder.maps)
        self._part = Part(0, 0, 0, 0, np.empty(0), np.empty((0, 3)))
        self._growth.remembers = True

    def reach(self, bricks: int) -> None:
        """Let a number of bricks stand."""
        if bricks == self._part.bricks == self._growth.bricks:
            return
        with one_thread():
            self._growth.reach(bricks)
        network, (twist, _, nodes) = self._network, self._grown
        acting = int(np.searchsorted(network.springs.since, bricks, side="right"))
        counts = bricks, 6 * acting, network.count_edges(bricks), network.count_nodes(bricks)
        _, axis, at_second = ResponseMaps(self._scene, bricks).inner
        self._part = Part(*counts, at_second, axis)
        own, every = twist[1 : 1 + 6 * bricks, : 6 * bricks], np.arange(bricks)
        blocks = own.reshape(bricks, 6, bricks, 6)[every, :, every]
        self.doubts = Doubts(
            np.einsum("nip,npq,niq->ni", nodes[:bricks], blocks, nodes[:bricks]).ravel(),
            np.einsum("nip,np->ni", nodes[:bricks], twist[0, : 6 * bricks].reshape(-1, 6)).ravel(),
            np.repeat(self._growth.loss[:bricks], nodes.shape[1]),
        )

    def solve(self, columns: Ints, want: Want, most: float) -> tuple[Floats, Floats, Bools]:
        """Return extremes (4, S) of rigid grips, forces (S, r), and which sets have others.

        These are answered not well enough. Two grips on one brick share. ``most``: as of
        `well_conditioned`.
        """
        from seqopt.engines.rigid import _compiled  # noqa: PLC0415  # numba is an extra

        grown, maps, axis = self._grown, self._maps, self._part.axis
        solution, pivot = _solve_grips(grown, columns, np.stack([axis, -axis], 1).reshape(-1, 3))
        force = np.ascontiguousarray(solution.T)
        apart = ~well_conditioned(
            self.doubts, load_rows(columns, 0), GripForces(force, pivot), most
        )
        force[apart] = 0.0
        part = self._part if want & Want.DISPLACEMENTS else self._part._replace(nodes=0)

        def reduce(own: slice) -> Floats:
            squares: Floats = _compiled.reduce_sets(grown, maps, part, columns[own], force[own])
            return squares

        step = max(_SETS, -(-len(columns) // cores()))
        parts = [slice(start, start + step) for start in range(0, max(len(columns), 1), step)]
        found = np.concatenate(in_threads(reduce, parts), axis=1)
        np.sqrt(found[2:], out=found[2:])
        size = np.sqrt((force.reshape(*columns.shape, 3) ** 2).sum(axis=2))
        return found, size, apart | ~np.isfinite(found).all(axis=0)


def _solve_grips(grown: Grown, columns: Ints, across: Floats) -> tuple[Floats, Floats]:
    """Return forces (k, S) that hold nodes (S, r) still, and scaled pivots (k, S).

    ``across``: as of `pairs_of`.
    """
    sets, count = len(columns), 3 * columns.shape[1]
    at = 6 * (columns // 2)[..., None] + np.arange(6)
    rows = 3 * (columns % 2)[..., None] + np.arange(3)
    nodes = grown.nodes[(columns // 2)[..., None], rows]  # (S, r, 3, 6)
    moved = grown.twist[1 + at[:, :, None, :, None], at[:, None, :, None]]  # (S, r, r, 6, 6)
    flexibility = nodes[:, :, None] @ moved @ nodes[:, None].swapaxes(3, 4)
    system = np.empty((count + 1, count, sets))
    system[:count] = flexibility.transpose(1, 3, 2, 4, 0).reshape(count, count, sets)
    dead = nodes @ grown.twist[0, at][..., None]
    system[count] = -dead.reshape(sets, count).T
    brace(system[:count], pairs_of(across, columns), 3)
    return solve_positive(system)
