"""Labels that prove when the last act of an instance ends at the earliest.

The proof is that of `seqopt.plan.judge._time_proof`; who may act, for how long, and from where
readiness is passed on, is read from the instance's own acts.
"""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph._timed import HELD, NOW, TimedGraph
from seqopt.graph.graph import Graph
from seqopt.plan.judge._time_proof import Closed, Limits, Team, TimedMoves, limit_below

Labels = tuple[Ints, Floats]  # nodes (N,), and values (N, 1 + c + q)


class _Acts(TimedMoves):
    """The moves of some arcs, (m,) bool, as acts of an instance."""

    def __init__(self, timed: TimedGraph, graph: Graph, kept: Bools) -> None:
        self.graph, self._timed, self._arc = graph, timed, np.flatnonzero(kept)
        columns = timed.free.shape[1]
        self._act = np.full((len(kept), 1 + columns), -1)
        self._act[timed.move, 1 + timed.column] = np.arange(len(timed.move))
        groups = tuple(
            tuple(np.flatnonzero(timed.kinds == kind).tolist()) for kind in np.unique(timed.kinds)
        )
        none = np.zeros((columns, 5))
        self.team = Team(none, none[:, 0], groups, none[:1], parks=False)
        self.rows = _entries(timed)
        self.longest, self.cured = timed.longest, None

    def _acts_of(self, moves: Ints, column: int | None) -> Ints:
        return np.asarray(self._act[self._arc[moves], 0 if column is None else 1 + column])

    def candidates(self, moves: Ints, column: int) -> Bools:
        """Return in which moves (k,) the robot of a column may be the one who takes the grip."""
        return self._acts_of(moves, column) >= 0

    def releases(self, moves: Ints) -> Bools:
        """Return which moves (k,) take no grip."""
        return self._acts_of(moves, None) >= 0

    def work(self, prices: Floats) -> Floats:
        """Return the priced time of moves, (m,): of all and of the robots of columns, (1 + c,)."""
        firsts = [1 + group[0] for group in self.team.groups]
        return np.asarray(self._timed.work[self._arc] @ prices[[0, *firsts]])

    def follow(
        self, moves: Ints, column: int | None, end: Floats, since: Floats, placed: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return labels after moves (k,): when they end (k,), and since when robots are free."""
        arc, act = self._arc[moves], self._acts_of(moves, column)
        ready = end if column is None else since[:, column] + self._timed.prepares[arc]
        ends = np.maximum(end, ready) + self._timed.acts[arc]
        origin = self._timed.origin[act]
        passed = np.take_along_axis(since, origin.clip(min=0), axis=1)
        passed = np.where(origin == NOW, ends[:, None], np.where(origin == HELD, 0.0, passed))
        return ends, self.sorted(self.rows[self.graph.target[moves]], passed), placed


def _entries(timed: TimedGraph) -> Ints:
    """Return numbers (n, c), above 0 where a robot holds, and equal where robots are alike."""
    columns = timed.free.shape[1]
    out = np.zeros(timed.free.shape, dtype=np.int64)
    for c in range(1, columns):
        out[:, c] = np.where(timed.alike[:, c - 1], out[:, c - 1], -c)
    return np.where(timed.free, out, columns - np.arange(columns))


def labels_prove(
    timed: TimedGraph,
    arcs: tuple[Graph, Bools],
    limited: tuple[Ints, Floats],
    claim: tuple[float, Labels, Floats],
) -> bool:
    """Return whether labels prove that no path ends before a value.

    ``arcs``: the graph that is left, and which arcs (m,) it has; ``limited``: columns, and the most
    of their sums; ``claim``: the value, labels, and prices (L, 1 + k).
    """
    (graph, kept), (columns, most), (value, labels, shares) = arcs, limited, claim
    moves = _Acts(timed, graph, kept)
    prices = np.column_stack([shares[:, 0], shares[:, 1:][:, timed.kinds]])
    strict = np.array([True] + [False] * len(columns))
    limits = Limits(limit_below(value), most, strict)
    closed = Closed(moves, graph.amounts[:, columns], prices, limits)
    return closed.is_proof(labels, lambda states: np.zeros(len(states), dtype=bool))[0]
