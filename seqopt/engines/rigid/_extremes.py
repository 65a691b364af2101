"""The extremes of the fields of many grip sets, without the fields.

Where a structure has more nodes than there are grip sets, most of what an operator holds is asked
of none of them. What the grips of a set move at each other, and what they and the weight do to
bricks and springs, is then read from `seqopt.engines.rigid._growth` itself, by compiled loops. What
that means to edges, nodes and ground ends stands by entries: no sparse matrix is cut for every
brick count.

Only `seqopt.engines.rigid.compliance` imports this file, where numba is installed. Loops are
compiled when they are first called and kept in the folder that numba chooses: beside this file, or
the user's own (``NUMBA_CACHE_DIR`` names another). No function touches what another call works on,
and none holds Python's lock.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Want
from seqopt.engines.rigid._growth import _cores, _in_threads
from seqopt.engines.rigid._operator import (
    Doubts,
    GripForces,
    OperatorBuilder,
    ResponseMaps,
    SceneMaps,
    brace,
    load_rows,
    pairs_of,
    solve_positive,
    well_conditioned,
)
from seqopt.work import _one_thread

_SETS = 64  # grip sets that a thread takes at least
_ROUNDED = 1 + 1e-9  # a bound is as much larger than what rounding may leave
_Function = TypeVar("_Function", bound=Callable[..., object])


class Grown(NamedTuple):
    """What unit wrenches on bricks mean, as of `Growth`, and how inner nodes (B, 6, 6) follow."""

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
    forces: int  # numbers: three for every spring that acts
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
    rows[1][:] -= 3 * (rows[1] // 6)  # forces of springs stand without moments
    edges = Edges(3 * spring[spring >= 0], along, *rows)
    entries = scene.motion.tocoo()
    start, at = (part.astype(np.int64) for part in (scene.motion.indptr, scene.motion.indices))
    pairs = np.unique(np.stack([entries.col // 6, entries.row // 3]), axis=1)
    brick, node = pairs.astype(np.int64)
    first = np.searchsorted(brick, np.arange(len(network.inner) + 1))
    arm = np.linalg.norm(network.node_position[node] - network.centroid[brick], axis=1)
    reach = np.maximum.reduceat(arm, first[:-1])  # each has its inner nodes at least
    motion = Motion(start, at, scene.motion.data, scene.since, first, node, reach)
    moment = np.ascontiguousarray(scene.support[:, :, 3:])
    return edges, motion, Ends(3 * network.springs.support, moment)


class GrownExtremes:
    """Answers grip sets of the brick count that a growth has reached.

    ``builder``: in space, of a scene whose grips transmit no moments and whose ground stays.
    """

    def __init__(self, builder: OperatorBuilder) -> None:
        self._network, self._growth = builder.network, builder.growth
        self._grown = Grown(self._growth.twist[:, None], self._growth.wrench, builder.nodes)
        self._scene, self._maps = builder.maps, maps_by_entry(builder.maps)
        self._part = Part(0, 0, 0, 0, np.empty(0), np.empty((0, 3)))
        self._growth.remembers = True

    def reach(self, bricks: int) -> None:
        """Let a number of bricks stand."""
        if bricks == self._part.bricks == self._growth.bricks:
            return
        with _one_thread():
            self._growth.reach(bricks)
        network, (twist, _, nodes) = self._network, self._grown
        acting = int(np.searchsorted(network.springs.since, bricks, side="right"))
        counts = bricks, 3 * acting, network.count_edges(bricks), network.count_nodes(bricks)
        _, axis, at_second = ResponseMaps(self._scene, bricks).inner
        self._part = Part(*counts, at_second, axis)
        own, every = twist[1 : 1 + 6 * bricks, 0, : 6 * bricks], np.arange(bricks)
        blocks = own.reshape(bricks, 6, bricks, 6)[every, :, every]
        self.doubts = Doubts(
            np.einsum("nip,npq,niq->ni", nodes[:bricks], blocks, nodes[:bricks]).ravel(),
            np.einsum(
                "nip,np->ni", nodes[:bricks], twist[0, 0, : 6 * bricks].reshape(-1, 6)
            ).ravel(),
            np.repeat(self._growth.loss[:bricks], nodes.shape[1]),
        )

    def solve(self, columns: Ints, want: Want, most: float) -> tuple[Floats, Floats, Bools]:
        """Return extremes (4, S) and forces (S, r) of rigid grips, and which sets err more.

        ``most``: as of `well_conditioned`.
        """
        grown, maps, axis = self._grown, self._maps, self._part.axis
        solution, pivot = _solve_grips(grown, columns, np.stack([axis, -axis], 1).reshape(-1, 3))
        force = np.ascontiguousarray(solution.T)
        apart = ~well_conditioned(
            self.doubts, load_rows(columns, 0), GripForces(force, pivot), most
        )
        force[apart] = 0.0
        part = self._part if want & Want.DISPLACEMENTS else self._part._replace(nodes=0)

        def reduce(own: slice) -> Floats:
            squares: Floats = reduce_sets(grown, maps, part, columns[own], force[own])
            return squares

        step = max(_SETS, -(-len(columns) // _cores()))
        parts = [slice(start, start + step) for start in range(0, max(len(columns), 1), step)]
        found = np.concatenate(_in_threads(reduce, parts), axis=1)
        np.sqrt(found[2:], out=found[2:])
        size = np.sqrt((force.reshape(*columns.shape, 3) ** 2).sum(axis=2))
        return found, size, apart | ~np.isfinite(found).all(axis=0)


def _solve_grips(grown: Grown, columns: Ints, across: Floats) -> tuple[Floats, Floats]:
    """Return forces (k, S) that hold nodes (S, r) still, and scaled pivots (k, S)."""
    sets, count = len(columns), 3 * columns.shape[1]
    at = 6 * (columns // 2)[..., None] + np.arange(6)
    rows = 3 * (columns % 2)[..., None] + np.arange(3)
    nodes = grown.nodes[(columns // 2)[..., None], rows]  # (S, r, 3, 6)
    moved = grown.twist[1 + at[:, :, None, :, None], 0, at[:, None, :, None]]  # (S, r, r, 6, 6)
    flexibility = nodes[:, :, None] @ moved @ nodes[:, None].swapaxes(3, 4)
    system = np.empty((count + 1, count, sets))
    system[:count] = flexibility.transpose(1, 3, 2, 4, 0).reshape(count, count, sets)
    dead = nodes @ grown.twist[0, 0, at][..., None]
    system[count] = -dead.reshape(sets, count).T
    brace(system[:count], pairs_of(across, columns), 3)
    return solve_positive(system)


def _compiled(*freedom: str) -> Callable[[_Function], _Function]:
    """Return a decorator that compiles a function at its first call, cached if there is a folder.

    ``freedom``: what may differ from arithmetic by the book, in numba's words.
    """
    free = {"contract", *freedom}

    def compiled(function: _Function) -> _Function:
        make = partial(numba.njit, nogil=True, fastmath=free, error_model="numpy")
        try:
            found: Any = make(cache=True)(function)
        except RuntimeError:  # no folder can be written
            found = make()(function)
        return cast("_Function", found)

    return compiled


@_compiled()
def _add_six(out: Floats, rows: Floats, first: int, much: Floats) -> None:
    """Add six neighboring rows, so much of each."""
    a, b, c = rows[first, 0], rows[first + 1, 0], rows[first + 2, 0]
    d, e, f = rows[first + 3, 0], rows[first + 4, 0], rows[first + 5, 0]
    p, q, r, s, t, u = much[0], much[1], much[2], much[3], much[4], much[5]
    for n in range(len(out)):
        out[n] += (p * a[n] + q * b[n] + r * c[n]) + (s * d[n] + t * e[n] + u * f[n])


@_compiled()
def _sum_rows(
    moved: Floats, carried: Floats, pull: Floats, grown: Grown, at: Ints, force: Floats
) -> None:
    """Find twists and forces of springs under the weight and forces at nodes, (r, 6) on bricks."""
    moved[:] = grown.twist[0, 0, : len(moved)]
    carried[:] = grown.wrench[0, 0, : len(carried)]
    for i in range(len(at)):
        brick, first = at[i] // 2, 3 * (at[i] % 2)
        for p in range(6):
            pull[i, p] = 0.0
            for a in range(3):
                pull[i, p] += grown.nodes[brick, first + a, p] * force[3 * i + a]
        _add_six(moved, grown.twist, 1 + 6 * brick, pull[i])
        _add_six(carried, grown.wrench, 1 + 6 * brick, pull[i])


@_compiled("nnan", "nsz")
def _extremes_outside(carried: Floats, edges: Edges, part: Part) -> tuple[float, float]:
    """Return the least and the largest force of all edges but inner ones."""
    least, most = np.inf, -np.inf
    for e in range(part.edges - part.bricks):
        j, x, y, z = edges.first[e], edges.along[0, e], edges.along[1, e], edges.along[2, e]
        tension = x * carried[j] + y * carried[j + 1] + z * carried[j + 2]
        least, most = min(least, tension), max(most, tension)
    return least, most


@_compiled()
def _pull_bricks(
    tension: Floats, carried: Floats, edges: Edges, part: Part, at: Ints, force: Floats
) -> None:
    """Find the forces of inner edges (b,); two grips on one share what is between them."""
    for b in range(part.bricks):
        total = part.at_second[b]
        for k in range(edges.start[b], edges.start[b + 1]):
            total += edges.much[k] * carried[edges.at[k]]
        tension[b] = total
    for i in range(len(at)):
        for a in range(3):
            along = part.axis[at[i] // 2, a] * (at[i] % 2)
            tension[at[i] // 2] += along * force[3 * i + a]
    for second in range(1, len(at)):
        for first in range(second):
            brick = at[first] // 2
            if at[second] // 2 == brick:
                between = tension[brick] * (1.0 - 2.0 * (at[first] % 2))
                tension[brick] = 0.0
                for a in range(3):
                    force[3 * first + a] += between * part.axis[brick, a]
                    force[3 * second + a] -= between * part.axis[brick, a]


@_compiled("nnan", "nsz")
def _square(moved: Floats, motion: Motion, bricks: int, node: int) -> float:
    """Return the square of how far a node moves."""
    square = 0.0
    for row in range(3 * node, 3 * node + 3):
        total = 0.0
        for k in range(motion.start[row], motion.start[row + 1]):
            total += motion.much[k] * moved[motion.at[k]] * (1.0 + (motion.since[k] > bricks))
        square += total * total
    return square


@_compiled("nnan", "nsz")
def _farthest(moved: Floats, motion: Motion, part: Part, first: int) -> tuple[float, int]:
    """Return the square of how far any node moves, and its brick: one that may be it is first."""
    best, far = 0.0, first
    for after in range(-1, part.bricks):
        brick = first if after < 0 else after
        shift = turn = 0.0
        for p in range(6 * brick, 6 * brick + 3):
            shift += moved[p] * moved[p]
            turn += moved[p + 3] * moved[p + 3]
        turn *= motion.reach[brick] * motion.reach[brick]
        if 2 * (shift + turn) * _ROUNDED <= best:  # as the square of a sum is no more than that
            continue
        if (shift + turn + 2 * np.sqrt(shift * turn)) * _ROUNDED <= best:
            continue
        for k in range(motion.first[brick], motion.first[brick + 1]):
            if motion.node[k] < part.nodes:
                square = _square(moved, motion, part.bricks, motion.node[k])
                if square > best:
                    best, far = square, brick
    return best, far


@_compiled("nnan", "nsz")
def _most_moment(carried: Floats, pull: Floats, grown: Grown, ends: Ends, at: Ints) -> float:
    """Return the square of the largest moment at any ground end that acts."""
    most, wrench = 0.0, np.empty(6)
    for g in range(len(ends.first)):
        first, square = ends.first[g], 0.0
        if first >= len(carried):
            continue
        for p in range(3):
            wrench[p], wrench[3 + p] = carried[first + p], grown.wrench[0, 1, first + p]
            for i in range(len(at)):
                for q in range(6):
                    row = 1 + 6 * (at[i] // 2) + q
                    wrench[3 + p] += pull[i, q] * grown.wrench[row, 1, first + p]
        for c in range(3):
            total = 0.0
            for p in range(6):
                total += wrench[p] * ends.moment[g, p, c]
            square += total * total
        most = max(most, square)
    return most


@_compiled("nnan", "nsz")
def reduce_sets(
    grown: Grown, maps: tuple[Edges, Motion, Ends], part: Part, columns: Ints, force: Floats
) -> Floats:
    """Return squares of extremes of sets, (4, S), and let grips on one brick share, in place.

    Of edge forces they are no squares. ``force`` (S, k): of rigid grips at nodes (S, r).
    """
    edges, motion, ends = maps
    found, tension = np.zeros((4, len(columns))), np.empty(part.bricks)
    carried, moved, far = np.zeros(grown.wrench.shape[2]), np.zeros(grown.twist.shape[2]), 0
    pull = np.empty((columns.shape[1], 6))
    for s in range(len(columns)):
        there = moved[: 6 * part.bricks], carried[: part.forces]  # the rest stays zero
        _sum_rows(*there, pull, grown, columns[s], force[s])
        if part.nodes:
            found[2, s], far = _farthest(moved, motion, part, far)
        found[3, s] = _most_moment(there[1], pull, grown, ends, columns[s])
        least, most = _extremes_outside(carried, edges, part)
        _pull_bricks(tension, carried, edges, part, columns[s], force[s])
        for b in range(part.bricks):
            least, most = min(least, tension[b]), max(most, tension[b])
        found[0, s], found[1, s] = least, most
    return found
