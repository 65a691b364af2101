"""The extremes of grip sets of a large structure, straight from what grows with the build.

Where a structure has more nodes than there are grip sets, most of what an operator holds is asked
of none of them. What the grips of a set move at each other, and what they and the weight do to
bricks and springs, is then read from `seqopt.engines.rigid._growth` itself, by compiled loops.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Want
from seqopt.engines.rigid._grown_maps import Grown, Kept, Part, maps_by_entry
from seqopt.engines.rigid._operator import Doubts, OperatorBuilder
from seqopt.engines.rigid._response_maps import inner_edges
from seqopt.work._threads import cores, in_threads, one_thread

_SETS = 64  # grip sets that a thread takes at least


class GrownExtremes:
    """Answers grip sets of the brick count that a growth has reached.

    ``builder``: in space, of a scene whose hands bear no moments and whose ground does not move.
    """

    def __init__(self, builder: OperatorBuilder) -> None:
        growth = builder.growth
        self.bricks = 0  # that were noted
        self._grown = Grown(growth.twist, growth.wrench[0], builder.nodes)
        self._network = builder.network
        self._maps = maps_by_entry(builder.maps, growth.columns[0])
        self._growth = growth
        growth.remembers = True

    def reach(self, bricks: int) -> None:
        """Let a number of bricks stand."""
        if bricks == self.bricks == self._growth.bricks:
            return
        with one_thread():
            self._growth.reach(bricks)
        network, (twist, _, nodes) = self._network, self._grown
        borne = self._growth.borne
        counts = bricks, borne, network.count_edges(bricks), network.count_nodes(bricks)
        _, axis, at_second = inner_edges(network, bricks)
        self._part = Part(*counts, at_second, axis)
        own, every = twist[1 : 1 + 6 * bricks, : 6 * bricks], np.arange(bricks)
        blocks = own.reshape(bricks, 6, bricks, 6)[every, :, every]
        self.doubts = Doubts(
            np.einsum("nip,npq,niq->ni", nodes[:bricks], blocks, nodes[:bricks]).ravel(),
            np.einsum("nip,np->ni", nodes[:bricks], twist[0, : 6 * bricks].reshape(-1, 6)).ravel(),
            np.repeat(self._growth.loss[:bricks], nodes.shape[1]),
        )
        self.bricks = bricks

    def forces(self, columns: Ints) -> tuple[Floats, Floats]:
        """Return forces (S, k) of rigid grips at nodes (S, r), and their scaled pivots (k, S)."""
        force = np.empty((len(columns), 3 * columns.shape[1]))
        pivot = np.empty(force.shape[::-1])
        _loops().solve_grown(self._grown, self._part.axis, columns, force, pivot)
        return force, pivot

    def extremes(self, columns: Ints, force: Floats, want: Want) -> Floats:
        """Return extremes (4, S) as of `Extremes`; two grips on one brick share, in place."""
        part = self._part if want & Want.DISPLACEMENTS else self._part._replace(nodes=0)
        grown, maps, loops, kept = self._grown, self._maps, _loops(), self._kept(columns)

        def reduce(own: slice) -> Floats:
            return loops.reduce_grown(grown, kept, maps, part, columns[own], force[own])

        step = max(_SETS, -(-len(columns) // cores()))
        parts = [slice(start, start + step) for start in range(0, max(len(columns), 1), step)]
        found = np.concatenate(in_threads(reduce, parts), axis=1)
        np.sqrt(found[2:], out=found[2:])
        return found

    def _kept(self, columns: Ints) -> Kept:
        """Return what forces mean at the nodes that all sets (S, r) hold."""
        (twist, borne, nodes), part = self._grown, self._part
        held = [n for n in columns[0].tolist() if (columns == n).any(axis=1).all()]
        found, count = [], -(-len(held) // 2) * 6
        for answers, width in ((twist, 6 * part.bricks), (borne, part.borne)):
            rows = np.zeros((count, width))
            for i, node in enumerate(held):
                turned = nodes[node // 2, 3 * (node % 2) : 3 * (node % 2) + 3]
                rows[3 * i : 3 * i + 3] = turned @ answers[1 + 6 * (node // 2) :][:6, :width]
            found.append(rows)
        return Kept(np.array(held, dtype=np.int64), *found)


class _Loops(NamedTuple):
    """The compiled functions."""

    solve_grown: Callable[..., None]
    reduce_grown: Callable[..., Floats]


@cache
def _loops() -> _Loops:
    """Return the compiled functions; loading them takes half a second."""
    from seqopt.engines.rigid import _compiled_growth  # noqa: PLC0415  # numba is an extra

    return _Loops(_compiled_growth.solve_grown, _compiled_growth.reduce_grown)
