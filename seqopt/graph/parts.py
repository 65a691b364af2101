"""The states of one part that were met so far, and the graph that visited states make."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.graph import Graph, Rows

PENDING, OPEN, CLOSED = 0, 1, 2  # of a state: above the threshold, visited, not allowed
Key: TypeAlias = Any  # which part, whatever a space calls it; it can be hashed


Valued = Callable[[Ints], tuple[Floats, Bools, float]]
"""Returns values of states, which are allowed, and above which the first goal's are floors."""


class Part:
    """The states of one part that were met so far, in the order in which they were."""

    def __init__(self, width: int, kind: np.dtype[Any], goals: int) -> None:
        self.states = np.zeros((0, width), dtype=kind)
        self.values = np.zeros((0, goals))
        self.mark = np.zeros(0, dtype=np.int8)
        self.exact = np.zeros(0, dtype=bool)
        self.floor = np.zeros(0, dtype=bool)  # of values: whether they may be too small
        self._codes = np.zeros(0, dtype=np.int64)
        self._rows = np.zeros(0, dtype=np.int32)

    def add(self, codes: Ints, states: Ints) -> Rows:
        """Return the rows of states, of which those that are new are added, not yet valued."""
        distinct, first, back = np.unique(codes, return_index=True, return_inverse=True)
        at = np.searchsorted(self._codes, distinct)
        new = np.ones(len(distinct), dtype=bool)
        inside = at < len(self._codes)
        new[inside] = self._codes[at[inside]] != distinct[inside]
        rows = np.empty(len(distinct), dtype=np.int32)
        rows[~new] = self._rows[at[~new]]
        rows[new] = np.arange(len(self.states), len(self.states) + new.sum())
        if new.any():
            self.states = np.concatenate([self.states, states[first[new]]])
            self.mark = np.concatenate([self.mark, np.zeros(new.sum(), dtype=np.int8)])
            self.exact = np.concatenate([self.exact, np.zeros(new.sum(), dtype=bool)])
            self._codes = np.insert(self._codes, at[new], distinct[new])
            self._rows = np.insert(self._rows, at[new], rows[new])
        return rows[back]

    def value(self, valued: Valued) -> None:
        """Value the states that were added since the last time."""
        known = len(self.values)
        if known == len(self.states):
            return
        values, allowed, most = valued(self.states[known:])
        self.values = np.concatenate([self.values, values])
        self.floor = np.concatenate([self.floor, values[:, 0] > most])
        self.mark[known:][~allowed] = CLOSED

    def raise_floors(self, rows: Ints, valued: Valued) -> bool:
        """Value those of some rows again whose values are floors; return if there are any."""
        rows = rows[self.floor[rows]]
        if len(rows):
            self.values[rows], allowed, most = valued(self.states[rows])
            self.floor[rows] = self.values[rows, 0] > most
            self.mark[rows[~allowed]] = CLOSED
        return len(rows) > 0

    def order(self) -> Ints:
        """Return the rows of visited states, by their codes."""
        return np.asarray(self._rows[self.mark[self._rows] == OPEN])


class Visited(NamedTuple):
    """A graph, and which states its numbers stand for.

    Attributes
    ----------
    graph : Graph
    states : tuple of (int, Key, (n, c) int)
        Level, part and states, in the order of numbers.
    """

    graph: Graph
    states: tuple[tuple[int, Key, Ints], ...]

    def of(self, path: Sequence[int]) -> list[tuple[int, Key, Ints]]:
        """Return level, part and state (c,) of numbers that rise with levels."""
        firsts = [0, *accumulate(len(rows) for _, _, rows in self.states)]
        found = np.searchsorted(firsts, path, side="right") - 1
        return [
            (*self.states[i][:2], self.states[i][2][n - firsts[i]])
            for i, n in zip(found.tolist(), path, strict=True)
        ]
