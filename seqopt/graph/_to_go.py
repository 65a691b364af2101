"""What every state of a graph takes at least to an end, and the best move from it."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import ProblemError
from seqopt.graph.graph import Graph
from seqopt.graph.paths import tied


class ToGo(NamedTuple):
    """What is left from every state.

    ``values`` (n, g): the least that every goal takes, one goal after the other; infinite where no
    end is reached; ``move`` (n,): the number of the best move; -1 where none leads on.
    """

    values: Floats
    move: Ints


def to_go(graph: Graph) -> ToGo:
    """Return what is left from every state, best in the first goal, among these in the second, ...

    Totals are followed by at most one worst amount, and this by totals; else a `ProblemError` says
    so. Of equal moves that is taken from which the fewest follow.
    """
    peaks = [k for k, peak in enumerate(graph.peaks) if peak]
    if len(peaks) > 1:
        raise ProblemError("a policy has one aim that is a worst step; make the others totals")
    values = np.full((graph.states, len(graph.peaks)), np.inf)
    first = peaks[0] if peaks else len(graph.peaks)
    kept = np.ones(len(graph.source), dtype=bool)
    if first or not peaks:
        least = _Sums(graph, [*range(first)])
        least.add(np.flatnonzero(kept))
        values[:, :first] = least.totals[:, :-1]
        kept = least.tight()
        if not peaks:
            return ToGo(values, least.best(np.arange(graph.states)))
    worst = _worst_to_go(graph, first, kept)
    values[:, first] = worst
    move = np.full(graph.states, -1, dtype=np.int64)
    amounts, rest = graph.amounts[:, first], _Sums(graph, [*range(first + 1, len(graph.peaks))])
    moves = np.flatnonzero(kept & np.isfinite(worst[graph.source]))
    moves = moves[np.argsort(amounts[moves], kind="stable")]
    states, done = np.argsort(worst, kind="stable"), 0
    ordered = worst[states]  # dead ends are infinite: no differences are taken
    cuts = [0, *(np.flatnonzero(ordered[1:] != ordered[:-1]) + 1).tolist(), graph.states]
    for start, end in pairwise(cuts):
        group = states[start:end]
        if not np.isfinite(level := max(0.0, worst[group[0]])):
            break
        upto = int(np.searchsorted(amounts[moves], tied(level), side="right"))
        rest.add(moves[done:upto])
        done = upto
        values[group, first + 1 :] = rest.totals[group, :-1]
        move[group] = rest.best(group)
    return ToGo(np.where(values == -np.inf, 0.0, values), move)


def _worst_to_go(graph: Graph, goal: int, kept: Bools) -> Floats:
    """Return the least worst amount on the way from every state, by some of the moves, (n,)."""
    source, target = graph.source[kept], graph.target[kept]
    amounts = graph.amounts[kept, goal]
    out = np.where(graph.ends, -np.inf, np.inf)
    while True:
        new = out.copy()
        np.minimum.at(new, source, np.maximum(amounts, out[target]))
        if (new == out).all():
            return out
        out = new


class _Sums:
    """The least totals from states to an end by the moves that were added so far.

    ``totals`` (n, k + 1): of goals, and last how many moves.
    """

    def __init__(self, graph: Graph, goals: list[int]) -> None:
        self._graph = graph
        ones = np.ones((len(graph.source), 1))
        self._costs = np.column_stack([graph.amounts[:, goals], ones])
        self.totals = np.full((graph.states, len(goals) + 1), np.inf)
        self.totals[graph.ends] = 0.0
        self._used = np.zeros(len(graph.source), dtype=bool)
        self._by_target = np.argsort(graph.target, kind="stable")
        counts = np.bincount(graph.target, minlength=graph.states)
        self._starts = np.concatenate([[0], np.cumsum(counts)])

    def add(self, moves: Ints) -> None:
        """Let moves (m,) be used too."""
        self._used[moves] = True
        while len(moves):
            moves = self._into(self._relaxed(moves))

    def _relaxed(self, moves: Ints) -> Ints:
        """Return the states from which some moves lead on with less than was known."""
        source = self._graph.source[moves]
        found = self._costs[moves] + self.totals[self._graph.target[moves]]
        order = np.lexsort((*found.T[::-1], source))
        first = np.ones(len(order), dtype=bool)
        first[1:] = source[order][1:] != source[order][:-1]
        states, least = source[order][first], found[order][first]
        less = _less(least, self.totals[states])
        self.totals[states[less]] = least[less]
        return np.asarray(states[less])

    def _into(self, states: Ints) -> Ints:
        """Return the moves that are used and lead to some states."""
        counts = self._starts[states + 1] - self._starts[states]
        first = np.repeat(self._starts[states] - np.cumsum(counts) + counts, counts)
        moves = self._by_target[first + np.arange(counts.sum())]
        return np.asarray(moves[self._used[moves]])

    def tight(self) -> Bools:
        """Return which moves are on best ways, the count of moves aside, (m,)."""
        found = self._costs + self.totals[self._graph.target]
        own = self.totals[self._graph.source]
        near = found[:, :-1] <= own[:, :-1] + 1e-9 * np.abs(own[:, :-1])
        return np.asarray(near.all(axis=1) & np.isfinite(own[:, -1]))

    def best(self, states: Ints) -> Ints:
        """Return the best move from every one of some states; -1 where there is none, (n,)."""
        source, out = self._graph.source, np.full(len(states), -1, dtype=np.int64)
        ends = np.searchsorted(source, states, side="right")
        counts = ends - np.searchsorted(source, states)
        moves = np.repeat(ends - np.cumsum(counts), counts) + np.arange(counts.sum())
        row = np.repeat(np.arange(len(states)), counts)
        found = self._costs[moves] + self.totals[self._graph.target[moves]]
        able = self._used[moves] & np.isfinite(found[:, -1])
        moves, row, found = moves[able], row[able], found[able]
        order = np.lexsort((*found.T[::-1], row))[::-1]
        out[row[order]] = moves[order]  # the least is written last
        out[self._graph.ends[states]] = -1
        return out


def _less(values: Floats, others: Floats) -> Bools:
    """Return which rows come before others, the first column counting most."""
    out = np.zeros(len(values), dtype=bool)
    open_ = np.ones(len(values), dtype=bool)
    for value, other in zip(values.T, others.T, strict=True):
        slack = 1e-12 * np.where(np.isfinite(other), np.abs(other), 0.0)
        out |= open_ & (value < other - slack)
        open_ &= (value <= other + slack) & (value >= other - slack)
    return out
