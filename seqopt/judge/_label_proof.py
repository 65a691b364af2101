"""Proof that no path is better, by labels that nothing better leads out of.

A formulation hands over labels: of some states, what paths to them have come to in all resources.
They prove that no path is better if every successor of one of them is dominated by another one, or
cannot end better. Here all of that is computed again, by the judge's own books of resources, on
states that it rebuilt or that an instance gives; where the labels come from is of no account.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.graph import Graph
from seqopt.graph.paths import TIED, _to_go
from seqopt.problem.resources import Resource, StepArrays

BETTER = 1e-9  # over a value: a path must be better by more than this
CHUNK = 400_000  # successors of labels that are looked at together
Labelled = tuple[Ints, Floats]  # numbers of states (N,), and values (N, k)
Excused = Callable[[Ints], Bools]  # which states need not be looked at: they are proven to fall


class Book:
    """One resource as the judge follows it, on arcs (a,) that are sorted by their sources.

    ``first`` (k,): values at the start.
    """

    first: Floats

    def follow(self, arc: Ints, values: Floats) -> Floats:
        """Return values (N, k) after arcs (N,); infinite where they may not be taken."""
        raise NotImplementedError

    def beyond(self, state: Ints, values: Floats) -> Bools:
        """Return which labels lead to nothing that is within the limits, (N,)."""
        return np.zeros(len(state), dtype=bool)

    def counted(self, state: Ints, values: Floats) -> Floats:
        """Return what counts of values (N, k) where they are compared."""
        return values

    def dominated(self, first: Floats, other: Floats) -> Bools:
        """Return where the first values (N, k) dominate the others."""
        return np.asarray((first <= other + np.abs(other) * 1e-12).all(axis=1))

    def ends(self, values: Floats) -> Bools:
        """Return with which values a path may end, (N,)."""
        return np.ones(len(values), dtype=bool)


class SumBook(Book):
    """Sums of amounts of arcs (a, q) within limits (q,); ``strict`` (q,): below these.

    ``graph``: without variants of arcs, ``move`` (a,): which of its moves arcs are.
    """

    def __init__(
        self, graph: Graph, move: Ints, amounts: Floats, limits: tuple[Floats, Bools]
    ) -> None:
        (self._most, self._strict), self._amounts = limits, amounts[move]
        self._left = np.column_stack([_to_go(graph, own) for own in amounts.T])
        self.first = np.zeros(amounts.shape[1])

    def follow(self, arc: Ints, values: Floats) -> Floats:
        return np.asarray(values + self._amounts[arc])

    def beyond(self, state: Ints, values: Floats) -> Bools:
        return is_beyond_limits(values + self._left[state], self._most, self._strict)


class TwinBook(Book):
    """A resource of a problem by its twin; ``steps`` (a,): what it sees of arcs."""

    def __init__(self, twin: Resource, steps: StepArrays) -> None:
        self._twin, self._steps, self.first = twin, steps, np.array(twin.start, dtype=float)

    def follow(self, arc: Ints, values: Floats) -> Floats:
        return self._twin.extended(self._steps.only(arc), values)

    def dominated(self, first: Floats, other: Floats) -> Bools:
        return self._twin.dominated(first, other)

    def ends(self, values: Floats) -> Bools:
        return self._twin.ends(values)


def is_beyond_limits(bounds: Floats, most: Floats, strict: Bools) -> Bools:
    """Return which rows of bounds (N, b) exceed a limit (b,), or attain it where it is strict."""
    slack = np.where(np.isfinite(most), 1e-12 * np.abs(most), 0.0)
    return np.asarray(np.where(strict, bounds >= most - slack, bounds > most).any(axis=1))


class Closed:
    """Labels to be checked as a proof: all successors are dominated, or pruned by bounds.

    ``graph``: states and moves; ``move`` (a,): of arcs, ascending; ``books``: of all resources.
    """

    def __init__(self, graph: Graph, move: Ints, books: Sequence[Book]) -> None:
        self._graph, self._source, self._target = graph, graph.source[move], graph.target[move]
        cuts = np.cumsum([0, *(len(book.first) for book in books)]).tolist()
        self._books = [(b, slice(*cut)) for b, cut in zip(books, pairwise(cuts), strict=True)]
        self.width = cuts[-1]

    def is_proof(self, labels: Labelled, excused: Excused) -> bool:
        """Return whether labels prove that nothing is within the limits."""
        state, values = labels
        over = self._graph.ends[state] & self._joined("ends", values).all(axis=0)
        useful = self._open(state, values) & ~over
        order = np.lexsort((values[useful, 0], state[useful]))
        known = state[useful][order], values[useful][order]
        first = np.concatenate([book.first for book, _ in self._books])[None]
        start = np.zeros(1, dtype=np.int64)
        missing = [start[self._lacks(known, start, first)]]
        starts = np.searchsorted(self._source, np.arange(self._graph.states + 1))
        counts = np.diff(starts)[known[0]]
        cuts = np.searchsorted(np.cumsum(counts), np.arange(CHUNK, counts.sum() + CHUNK, CHUNK))
        for rows in np.split(np.arange(len(counts)), np.unique(cuts)):
            own, label = counts[rows], np.repeat(rows, counts[rows])
            arc = np.repeat(starts[known[0][rows]] - np.cumsum(own) + own, own)
            arc = arc + np.arange(len(label))
            before = known[1][label]
            after = np.hstack([book.follow(arc, before[:, own]) for book, own in self._books])
            to, ever = self._target[arc].astype(np.int64), np.isfinite(after).all(axis=1)
            missing.append(to[ever][self._lacks(known, to[ever], after[ever])])
        return self._are_dead(np.unique(np.concatenate(missing)), excused)

    def _joined(self, name: str, values: Floats) -> Bools:
        return np.array([getattr(book, name)(values[:, own]) for book, own in self._books])

    def _are_dead(self, states: Ints, excused: Excused) -> bool:
        """Return whether all paths from some states to an end pass one that is proven to fall."""
        graph, seen = self._graph, np.zeros(self._graph.states, dtype=bool)
        while len(states):
            seen[states] = True
            states = states[~excused(states)]
            if graph.ends[states].any():
                return False
            after = np.unique(graph.target[np.isin(graph.source, states)]).astype(np.int64)
            states = after[~seen[after]]
        return True

    def _open(self, state: Ints, values: Floats) -> Bools:
        """Return which labels may still lead to what is within the limits."""
        out = np.ones(len(state), dtype=bool)
        for book, own in self._books:
            out &= ~book.beyond(state, values[:, own])
        return out

    def _lacks(self, known: Labelled, state: Ints, values: Floats) -> Bools:
        """Return which labels may be better and are not dominated by a known one."""
        counted = np.hstack([book.counted(state, values[:, own]) for book, own in self._books])
        out = self._open(state, counted)
        over = self._graph.ends[state] & self._joined("ends", values).all(axis=0)
        rows = np.flatnonzero(out & ~over)
        place, end = (np.searchsorted(known[0], state[rows], side=s) for s in ("left", "right"))
        while len(rows):
            some = place < end
            rows, place, end = rows[some], place[some], end[some]
            below = np.ones(len(rows), dtype=bool)
            for book, own in self._books:
                below &= book.dominated(known[1][place, own], counted[rows, own])
            out[rows[below]] = False
            rows, place, end = rows[~below], place[~below] + 1, end[~below]
        return out


def limit_below(value: float) -> float:
    """Return the least that is no better than a value."""
    return value - BETTER * abs(value)


def kept_below(amounts: Floats, value: float) -> Bools:
    """Return which amounts are less than a value, not by rounding alone."""
    return np.asarray(amounts + TIED * np.abs(amounts) < value)
