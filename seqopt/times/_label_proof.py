"""Proof of how long builds take at least: labels that nothing better leads out of.

A formulation of time hands over labels: of some states, when the last step ended and since when
robots are free. They prove that no build is better if whatever follows from one of them by one act
is nowhere below another one, or cannot end better, as prices of the robots' time and what sums take
to the end say. Here all of that is computed again, in the rows and by the rules of the judge; where
the labels come from is of no account.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.duality import _to_go
from seqopt.graph.graph import Graph
from seqopt.graph.paths import TIED
from seqopt.times._fall_cuts import CuringStates

BETTER = 1e-9  # over a value: a build must be better by more than this
BLOCK = 400_000  # acts that are looked at together


class Team(NamedTuple):
    """The robots of the columns of rows: how long they take, and which could change places.

    ``times`` (c, 5): fetch, place, approach, grip, release, s; ``slow`` (c,): s per m, 0 where ways
    take no time; ``groups``: columns of robots that are alike; ``at`` (nodes,): places, m.
    """

    times: Floats
    slow: Floats
    groups: tuple[tuple[int, ...], ...]
    at: Floats
    parks: bool


@dataclass(frozen=True, eq=False)
class Limits:
    """Beyond what builds are no better.

    ``time``: s; ``sums`` (q,): of columns; ``strict`` (1 + q,): whether what is at a limit is no
    better either.
    """

    time: float
    sums: Floats
    strict: Bools


class TimedMoves:
    """Moves between rows of states, and what they take of the time of robots.

    ``rows`` (n, c): states by their numbers in the graph; ``places`` (m,): which moves place.
    """

    def __init__(
        self, graph: Graph, rows: Ints, places: Bools, team: Team, cured: CuringStates | None = None
    ) -> None:
        self.graph, self.rows, self._places, self.team = graph, rows, places, team
        self.cured = cured
        before, after = rows[graph.source], rows[graph.target]
        self.gains = np.zeros(
            after.shape, dtype=np.int64
        )  # node taken, in the group's first column
        self._loses = np.zeros(after.shape, dtype=bool)
        for group in team.groups:
            old, new = before[:, group], after[:, group]
            fresh = np.where((new[:, :, None] == old[:, None]).any(axis=2), 0, new.clip(min=0))
            self.gains[:, group[0]] = fresh.max(axis=1)
            kept = (old[:, :, None] == new[:, None]).any(axis=2)
            self._loses[:, group] = (old > 0) & ~kept
        self._loses[self.gains.any(axis=1)] = False
        self.longest = self._longest()

    def _longest(self) -> Floats:
        """Return how long every robot takes at most to be ready, (c,), s."""
        across = float(np.linalg.norm(np.ptp(self.team.at[1:], axis=0)))
        return np.asarray(self.team.times[:, [0, 2]].max(axis=1) + across * self.team.slow)

    def candidates(self, moves: Ints, column: int) -> Bools:
        """Return in which moves (k,) the robot of a column may be the one who takes the grip."""
        group = next(g for g in self.team.groups if column in g)
        graph = self.graph
        before = self.rows[graph.source[moves]][:, group]
        after = self.rows[graph.target[moves]][:, group]
        own = self.rows[graph.source[moves], column]
        had, has = ((each == own[:, None]).sum(axis=1) for each in (before, after))
        return np.asarray((self.gains[moves, group[0]] > 0) & (own <= 0) & (had > has))

    def releases(self, moves: Ints) -> Bools:
        """Return which moves (k,) take no grip."""
        return np.asarray(~self.gains[moves].any(axis=1))

    def seconds(self, moves: Ints, column: int | None) -> tuple[Floats, Floats]:
        """Return how long moves (k,) by the robot of a column take to prepare and to act, s."""
        if column is None:
            slowest = (self._loses[moves] * self.team.times[:, 4]).max(axis=1)
            return np.zeros(len(moves)), slowest
        group = next(g for g in self.team.groups if column in g)
        node = self.gains[moves, group[0]]
        last = -self.rows[self.graph.source[moves], column]
        way = np.linalg.norm(self.team.at[node] - self.team.at[last.clip(min=0)], axis=1)
        fetch, place, approach, grip, _ = self.team.times[column]
        ready = np.where(self._places[moves], fetch, approach)
        ready = ready + np.where(last > 0, way, 0.0) * self.team.slow[column]
        return ready, np.where(self._places[moves], place, grip)

    def work(self, prices: Floats) -> Floats:
        """Return the priced time of moves, (m,): of all and of the robots of columns, (1 + c,)."""
        every = np.arange(len(self.graph.source))
        held = self.rows[self.graph.source] > 0
        out = np.zeros(len(every))
        busy = held @ prices[1:]
        letting = self.releases(every)
        _, acts = self.seconds(every[letting], None)
        out[letting] = acts * (prices[0] + busy[letting])
        for group in self.team.groups:  # robots of a group have one price, and take as long
            column_of = [self.candidates(every, column) for column in group]
            for column, able in zip(group, column_of, strict=True):
                ready, acts = self.seconds(every[able], column)
                own = prices[1 + column]
                out[able] = acts * (prices[0] + busy[able] + own) + ready * own
        return out

    def follow(
        self, moves: Ints, column: int | None, end: Floats, since: Floats, placed: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return labels after moves (k,): when they end (k,), and since when robots are free.

        ``column``: who takes the grip, None where robots let go; ``end`` (k,), ``since`` (k, c),
        ``placed`` (k, b): of the labels before. Results: ``end`` (k,), infinite where mortar never
        lets it; ``since`` (k, c), sorted where robots are alike; ``placed`` (k, b).
        """
        ready, acts = self.seconds(moves, column)
        begins = end if column is None else np.maximum(end, since[:, column] + ready)
        if self.cured is not None:
            placed = placed.copy()
            own = np.flatnonzero(self._places[moves])
            brick = self.cured.bricks[self.graph.target[moves[own]]] - 1
            placed[own, brick] = np.inf
            to = self.graph.target[moves].astype(np.int64)
            begins = self.cured.starts(to, placed, begins)
            placed[own, brick] = begins[own] + acts[own]
        ends = begins + acts
        entries, free = self.rows[self.graph.source[moves]].copy(), since.copy()
        loses = self._loses[moves]
        free[loses] = np.broadcast_to(ends[:, None], free.shape)[loses]
        entries[loses] = (-entries if self.team.parks else np.zeros_like(entries))[loses]
        if column is not None:
            group = next(g for g in self.team.groups if column in g)
            entries[:, column], free[:, column] = self.gains[moves, group[0]], 0.0
        return ends, self.sorted(entries, free), placed

    def sorted(self, entries: Ints, since: Floats) -> Floats:
        """Return readiness (k, c) in the order of sorted entries (k, c), of equal ones as well."""
        out = np.where(entries > 0, 0.0, since)
        for group in self.team.groups:
            own, times = entries[:, group], out[:, group]
            order = np.lexsort((times, -own), axis=1)
            out[:, group] = np.take_along_axis(times, order, axis=1)
        return out


class Closed:
    """Labels that are looked at as a proof.

    ``moves``: all that may be taken; ``amounts`` (m, q): what these take of sums; ``prices`` (L, 1
    + c), which are made such as prove anything; ``limits``: beyond which nothing is better.
    """

    def __init__(self, moves: TimedMoves, amounts: Floats, prices: Floats, limits: Limits) -> None:
        self._moves, self._amounts, self._limits = moves, amounts, limits
        graph = moves.graph
        self._prices = np.array([_allowed(each, moves.team) for each in prices]).reshape(
            -1, 1 + moves.rows.shape[1]
        )
        self._left = [_to_go(graph, moves.work(each)) for each in self._prices]
        self._sums = np.column_stack(
            [np.zeros((graph.states, 0)), *(_to_go(graph, own) for own in amounts.T)]
        )

    @property
    def bound(self) -> float:
        """What no build ends below, by prices alone, s."""
        return max((float(left[0]) for left in self._left), default=0.0)

    def is_proof(self, labels: tuple[Ints, Floats], excused: Callable[[Ints], Bools]) -> bool:
        """Return whether labels prove that nothing is within the limits.

        ``labels``: numbers of states (N,), and values (N, 1 + c + q); ``excused``: which states of
        some numbers need not be looked at, as they are proven to fall.
        """
        graph, rows = self._moves.graph, self._moves.rows
        state, values = labels
        columns = rows.shape[1]
        values = values.copy()
        values[:, 1 : 1 + columns] = self._moves.sorted(rows[state], values[:, 1 : 1 + columns])
        useful = self._open(state, values) & ~graph.ends[state]
        order = np.lexsort((values[useful, 0], state[useful]))
        known = state[useful][order], values[useful][order]
        first = np.zeros((1, values.shape[1]))
        if self._moves.cured is not None:
            first[:, first.shape[1] - len(self._moves.cured.placed) :] = self._moves.cured.placed
        start = np.zeros(1, dtype=np.int64)
        missing = [start[self._lacks(known, start, first)]]
        for block in _blocks(known[0], graph):
            missing.append(self._leads_to(known, *block))
        left = np.unique(np.concatenate(missing))
        return self._are_dead(left, excused)

    def _are_dead(self, states: Ints, excused: Callable[[Ints], Bools]) -> bool:
        """Return whether all ways from some states to an end pass one that is proven to fall."""
        graph, seen = self._moves.graph, np.zeros(self._moves.graph.states, dtype=bool)
        while len(states):
            seen[states] = True
            states = states[~excused(states)]
            if graph.ends[states].any():
                return False
            after = np.unique(graph.target[np.isin(graph.source, states)]).astype(np.int64)
            states = after[~seen[after]]
        return True

    def _leads_to(self, known: tuple[Ints, Floats], label: Ints, move: Ints) -> Ints:
        """Return states of what follows from labels by moves, (k,) each, that none is below."""
        columns = self._moves.rows.shape[1]
        out = [np.zeros(0, dtype=np.int64)]
        for column in (None, *range(columns)):
            able = self._moves
            takes = able.releases(move) if column is None else able.candidates(move, column)
            own, which = move[takes], label[takes]
            values = known[1][which]
            last = 1 + columns + self._amounts.shape[1]
            before = values[:, 0], values[:, 1 : 1 + columns], values[:, last:]
            end, since, placed = able.follow(own, column, *before)
            sums = values[:, 1 + columns : last] + self._amounts[own]
            to = self._moves.graph.target[own].astype(np.int64)
            after = np.column_stack([end, since, sums, placed])
            ever = np.isfinite(end)
            out.append(to[ever][self._lacks(known, to[ever], after[ever])])
        return np.concatenate(out)

    def _open(self, state: Ints, values: Floats) -> Bools:
        """Return which labels may still lead to what is within the limits."""
        columns = self._moves.rows.shape[1]
        end, since = values[:, 0], values[:, 1 : 1 + columns]
        free = self._moves.rows[state] <= 0
        busy = np.where(free, since, end[:, None])
        ends = end.copy()
        over = self._moves.graph.ends[state]
        for prices, left in zip(self._prices, self._left, strict=True):
            bound = prices[0] * end + busy @ prices[1:] + left[state]
            ends = np.where(over, ends, np.maximum(ends, bound))
        sums = values[:, 1 + columns : 1 + columns + self._amounts.shape[1]]
        bounds = np.column_stack([ends, sums + self._sums[state]])
        most = np.array([self._limits.time, *self._limits.sums])
        slack = np.where(np.isfinite(most), 1e-12 * np.abs(most), 0.0)
        beyond = np.where(self._limits.strict, bounds >= most - slack, bounds > most)
        return np.asarray(~beyond.any(axis=1))

    def _lacks(self, known: tuple[Ints, Floats], state: Ints, values: Floats) -> Bools:
        """Return which labels may be better and are not covered by a known one.

        Who is free for longer than any preparation takes could as well be so for as long: who acts
        again acts no sooner, and who does not is done.
        """
        columns = self._moves.rows.shape[1]
        later = values[:, [0]] - self._moves.longest
        free = self._moves.rows[state] <= 0
        counted = values.copy()
        own = values[:, 1 : 1 + columns]
        counted[:, 1 : 1 + columns] = np.where(free, np.maximum(own, later), 0.0)
        cured = self._moves.cured
        if cured is not None:  # what has its full bond could as well be older
            last = 1 + columns + self._amounts.shape[1]
            older = np.maximum(values[:, last:], values[:, [0]] - cured.full)
            stands = np.arange(older.shape[1]) < cured.bricks[state][:, None]
            counted[:, last:] = np.where(stands, older, 0.0)
        out = self._open(state, counted)
        rows = np.flatnonzero(out & ~self._moves.graph.ends[state])
        place, end = (np.searchsorted(known[0], state[rows], side=s) for s in ("left", "right"))
        while len(rows):
            some = place < end
            rows, place, end = rows[some], place[some], end[some]
            size = np.abs(counted[rows]) * 1e-12
            below = (known[1][place] <= counted[rows] + size).all(axis=1)
            out[rows[below]] = False
            rows, place, end = rows[~below], place[~below] + 1, end[~below]
        return out


def _blocks(state: Ints, graph: Graph) -> list[tuple[Ints, Ints]]:
    """Return labels, by number, with the moves from their states: pairs in blocks."""
    starts = np.searchsorted(graph.source, np.arange(graph.states + 1))
    counts = np.diff(starts)[state]
    cuts = np.searchsorted(np.cumsum(counts), np.arange(BLOCK, counts.sum() + BLOCK, BLOCK))
    out = []
    for rows in np.split(np.arange(len(state)), np.unique(cuts)):
        own = counts[rows]
        label = np.repeat(rows, own)
        first = np.repeat(starts[state[rows]] - np.cumsum(own) + own, own)
        out.append((label, first + np.arange(len(label))))
    return out


def _allowed(prices: Floats, team: Team) -> Floats:
    """Return prices that prove a bound, near some: from 0, at most one together, one per group."""
    out = np.where(np.isfinite(prices), prices, 0.0).clip(min=0.0)
    for group in team.groups:
        columns = [1 + column for column in group]
        out[columns] = out[columns].mean()
    return np.asarray(out / max(1.0, float(out.sum())))


def limit_below(value: float) -> float:
    """Return the least that is no better than a value."""
    return value - BETTER * abs(value)


def kept_below(amounts: Floats, value: float) -> Bools:
    """Return which amounts are less than a value, not by rounding alone."""
    return np.asarray(amounts + TIED * np.abs(amounts) < value)
