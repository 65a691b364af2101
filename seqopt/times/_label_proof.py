"""Proof of how long builds take at least: labels that nothing better leads out of.

A formulation of time hands over labels: of some states, when the last step ended and since when
robots are free. They prove that no build is better if every successor of one of them by one act is
dominated by another one, or cannot end better, as multipliers of the robots' time and what sums
take to the end say. Here all of that is computed again, on acts that the judge rebuilt or that an
instance gives; where the labels come from is of no account.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.paths import TIED, _to_go
from seqopt.times._acts import Acts

BETTER = 1e-9  # over a value: a build must be better by more than this
CHUNK = 400_000  # acts of labels that are looked at together


@dataclass(frozen=True, eq=False)
class Limits:
    """Beyond what builds are no better.

    ``time``: s; ``sums`` (q,): of columns; ``strict`` (1 + q,): whether what is at a limit is no
    better either.
    """

    time: float
    sums: Floats
    strict: Bools


class Closed:
    """Labels to be checked as a proof: all successors are dominated, or pruned by bounds.

    ``acts``: all that may be taken; ``amounts`` (m, q): what moves take of sums; ``multipliers``
    (L, 1 + c): of the time of all and of robots, made valid; ``limits``: beyond which nothing is
    better.
    """

    def __init__(self, acts: Acts, amounts: Floats, multipliers: Floats, limits: Limits) -> None:
        self._acts, self._amounts, self._limits = acts, amounts, limits
        graph, self._columns = acts.graph, acts.entries.shape[1]
        self._last = 1 + self._columns + amounts.shape[1]  # of a label, before ages of mortar
        self._multipliers = np.array([_valid(each, acts) for each in multipliers])
        self._multipliers = self._multipliers.reshape(-1, 1 + self._columns)
        self._left = [_to_go(graph, acts.work @ each) for each in self._multipliers]
        self._sums = np.column_stack(
            [np.zeros((graph.states, 0)), *(_to_go(graph, own) for own in amounts.T)]
        )

    @property
    def bound(self) -> float:
        """Lower bound of all builds by multipliers alone, s."""
        return max((float(left[0]) for left in self._left), default=0.0)

    def is_proof(self, labels: tuple[Ints, Floats], excused: Callable[[Ints], Bools]) -> bool:
        """Return whether labels prove that nothing is within the limits.

        ``labels``: numbers of states (N,), and values (N, 1 + c + q); ``excused``: which states of
        some numbers need not be looked at, as they are proven to fall.
        """
        acts, (state, values) = self._acts, labels
        values, columns = values.copy(), slice(1, 1 + self._columns)
        values[:, columns] = acts.sorted(acts.entries[state], values[:, columns])
        useful = self._open(state, values) & ~acts.graph.ends[state]
        order = np.lexsort((values[useful, 0], state[useful]))
        known = state[useful][order], values[useful][order]
        first, start = np.zeros((1, values.shape[1])), np.zeros(1, dtype=np.int64)
        if acts.cured is not None:
            first[:, first.shape[1] - len(acts.cured.placed) :] = acts.cured.placed
        missing = [start[self._lacks(known, start, first)]]
        starts = np.searchsorted(acts.source, np.arange(acts.graph.states + 1))
        counts = np.diff(starts)[known[0]]
        cuts = np.searchsorted(np.cumsum(counts), np.arange(CHUNK, counts.sum() + CHUNK, CHUNK))
        for rows in np.split(np.arange(len(counts)), np.unique(cuts)):
            own, label = counts[rows], np.repeat(rows, counts[rows])
            begins = np.repeat(starts[known[0][rows]] - np.cumsum(own) + own, own)
            missing.append(self._leads_to(known, label, begins + np.arange(len(label))))
        return self._are_dead(np.unique(np.concatenate(missing)), excused)

    def _are_dead(self, states: Ints, excused: Callable[[Ints], Bools]) -> bool:
        """Return whether all paths from some states to an end pass one that is proven to fall."""
        graph, seen = self._acts.graph, np.zeros(self._acts.graph.states, dtype=bool)
        while len(states):
            seen[states] = True
            states = states[~excused(states)]
            if graph.ends[states].any():
                return False
            after = np.unique(graph.target[np.isin(graph.source, states)]).astype(np.int64)
            states = after[~seen[after]]
        return True

    def _leads_to(self, known: tuple[Ints, Floats], label: Ints, act: Ints) -> Ints:
        """Return states of successors of labels by acts, (k,) each, that are not dominated."""
        values, last = known[1][label], self._last
        before = values[:, 0], values[:, 1 : 1 + self._columns], values[:, last:]
        end, since, placed = self._acts.follow(act, *before)
        move = self._acts.move[act]
        sums = values[:, 1 + self._columns : last] + self._amounts[move]
        to = self._acts.graph.target[move].astype(np.int64)
        after, ever = np.column_stack([end, since, sums, placed]), np.isfinite(end)
        return to[ever][self._lacks(known, to[ever], after[ever])]

    def _open(self, state: Ints, values: Floats) -> Bools:
        """Return which labels may still lead to what is within the limits."""
        end, since = values[:, 0], values[:, 1 : 1 + self._columns]
        busy = np.where(self._acts.entries[state] <= 0, since, end[:, None])
        ends, over = end.copy(), self._acts.graph.ends[state]
        for multipliers, left in zip(self._multipliers, self._left, strict=True):
            bound = multipliers[0] * end + busy @ multipliers[1:] + left[state]
            ends = np.where(over, ends, np.maximum(ends, bound))
        sums = values[:, 1 + self._columns : self._last]
        bounds = np.column_stack([ends, sums + self._sums[state]])
        most = np.array([self._limits.time, *self._limits.sums])
        slack = np.where(np.isfinite(most), 1e-12 * np.abs(most), 0.0)
        beyond = np.where(self._limits.strict, bounds >= most - slack, bounds > most)
        return np.asarray(~beyond.any(axis=1))

    def _lacks(self, known: tuple[Ints, Floats], state: Ints, values: Floats) -> Bools:
        """Return which labels may be better and are not dominated by a known one.

        Who is free for longer than any preparation takes could as well be so for as long: who acts
        again acts no sooner, and who does not is done.
        """
        acts, counted = self._acts, self._acts.counted(state, values, self._last)
        out = self._open(state, counted)
        rows = np.flatnonzero(out & ~acts.graph.ends[state])
        place, end = (np.searchsorted(known[0], state[rows], side=s) for s in ("left", "right"))
        while len(rows):
            some = place < end
            rows, place, end = rows[some], place[some], end[some]
            size = np.abs(counted[rows]) * 1e-12
            below = (known[1][place] <= counted[rows] + size).all(axis=1)
            out[rows[below]] = False
            rows, place, end = rows[~below], place[~below] + 1, end[~below]
        return out


def _valid(multipliers: Floats, acts: Acts) -> Floats:
    """Return multipliers that prove a bound, near some: from 0, at most one together.

    Robots that are alike have the same.
    """
    out = np.where(np.isfinite(multipliers), multipliers, 0.0).clip(min=0.0)
    for group in acts.groups:
        columns = [1 + column for column in group]
        out[columns] = out[columns].mean()
    return np.asarray(out / max(1.0, float(out.sum())))


def limit_below(value: float) -> float:
    """Return the least that is no better than a value."""
    return value - BETTER * abs(value)


def kept_below(amounts: Floats, value: float) -> Bools:
    """Return which amounts are less than a value, not by rounding alone."""
    return np.asarray(amounts + TIED * np.abs(amounts) < value)
