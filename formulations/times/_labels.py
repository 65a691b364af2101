"""Labels over a build in time, in batches, and multipliers of the robots' time, which bound them.

A label of a state is when the last step ended, since when the robots of its columns are free, and
what sums took by then. One that another of the same state dominates is dropped, and so is one of
which multipliers or potentials say that it ends beyond the caps.

Whatever a build does, it takes no less than the time of all that its steps take one after the
other, and no less than the time of any robot: preparing, acting, and holding while others act. With
multipliers from 0 that add up to one over these, the weighted time of moves is a sum along a path,
and the shortest path bounds every build (`seqopt.graph._multipliers`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph._multipliers import Plane, Polyhedron, highest_bound
from seqopt.graph._timed import HELD, NOW, TimedGraph
from seqopt.graph.formulation import Watch
from seqopt.graph.paths import distances, fewest_moves, moves_along

ROUNDS = 25  # of cutting planes
CLOSED = 1e-7  # share of the bound to which prices are the best
TIGHT = 1e-9  # of a distance: by how much moves of a shortest path may be off
KEPT = 3  # prices that bound labels, those with the highest bounds


@dataclass(frozen=True, eq=False)
class Prices:
    """Prices, and what they say.

    ``each`` (L, 1 + k): of the time of all, and of a robot of every kind; ``left`` (L, n): priced
    time from states to ends at least; ``kinds`` (c,): of columns; ``bound``: of any build, s.
    """

    each: Floats
    left: Floats
    kinds: Ints
    bound: float

    def ends(self, state: Ints, end: Floats, since: Floats) -> Floats:
        """Return when builds end at least, (N,).

        ``state`` (N,) now, ``end`` (N,) of the last step, ``since`` (N, c): since when robots of
        columns are free, the end of the last step where they hold.
        """
        out = np.full(len(state), -np.inf)
        for prices, left in zip(self.each, self.left, strict=True):
            own = prices[0] * end + since @ prices[1:][self.kinds]
            np.maximum(out, own + left[state], out=out)
        return out


def best_prices(timed: TimedGraph, kept: Bools, watch: Watch) -> Prices:
    """Return the multipliers whose bound on builds by some moves, (m,) bool, is highest."""
    graph, work, sizes = timed.graph.only(kept), timed.work[kept], timed.sizes.astype(float)
    tried = list[tuple[float, Floats, Floats]]()

    def cheapest(prices: Floats) -> Plane:
        costs = work @ prices
        left = distances(graph, costs, back=True)
        with np.errstate(invalid="ignore"):
            tight = costs + left[graph.target] <= left[graph.source] + TIGHT * (1 + left[0])
        path = fewest_moves(graph.only(tight & np.isfinite(left[graph.target])))
        tried.append((float(left[0]), prices, left))
        return Plane(0.0, work[moves_along(graph, path)].sum(axis=0), float(left[0]))

    start, region = np.full(len(sizes), 1 / len(sizes)) / sizes, Polyhedron(np.inf, counts=sizes)
    highest_bound(cheapest, start, region, lambda _: watch.over, rounds=ROUNDS, closed=CLOSED)
    best = sorted(tried, key=lambda each: -each[0])[:KEPT]
    each, lefts = np.array([own for _, own, _ in best]), np.array([own for *_, own in best])
    return Prices(each, lefts, timed.kinds, best[0][0])


def useful(timed: TimedGraph, prices: Prices, kept: Bools, most: float) -> Bools:
    """Return the moves, (m,) bool, that can be on builds that end by some time."""
    graph = timed.graph.only(kept)
    out = kept.copy()
    for each, left in zip(prices.each, prices.left, strict=True):
        costs = timed.work[kept] @ each
        before = distances(graph, costs)
        with np.errstate(invalid="ignore"):
            ends = before[graph.source] + costs + left[graph.target]
        out[kept] &= ends <= most + TIGHT * abs(most)
    return out


STEPS = -1  # the column that counts moves
CHUNK = 2_000_000  # acts of labels that are looked at together
MARGIN = 1e-10  # over a limit: what is pruned is beyond it however sums are rounded


class LateError(Exception):
    """Time is over."""


class Labels(NamedTuple):
    """Labels of states.

    ``state`` (N,); ``end`` (N,): of the last step, s; ``since`` (N, c): since when robots of
    columns are free, s, zero where they hold; ``sums`` (N, q): what sums took; ``before`` (N,):
    number of the label that it continues, -1 at the start; ``placed`` (N, b): where mortar cures,
    when bricks were in their places, s, zero of those that are not.
    """

    state: Ints
    end: Floats
    since: Floats
    sums: Floats
    before: Ints
    placed: Floats

    def only(self, rows: Ints | Bools) -> Labels:
        """Select rows."""
        return Labels._make(each[rows] for each in self)

    @property
    def size(self) -> int:
        """How many there are."""
        return len(self.state)


def _joined(parts: Sequence[Labels]) -> Labels:
    return Labels(*map(np.concatenate, zip(*parts, strict=True)))


@dataclass(frozen=True, eq=False)
class Caps:
    """What paths must keep to.

    ``time``: the end of the build, s; ``sums``: of columns of the graph, most that each may take;
    `STEPS` is the number of moves.
    """

    time: float = np.inf
    sums: tuple[tuple[int, float], ...] = ()

    @property
    def columns(self) -> list[int]:
        """The columns of the graph that are summed."""
        return [column for column, _ in self.sums]


@dataclass
class Swept:
    """What labels found: the best label at an end, all that were kept, and the least left out."""

    best: float = np.inf
    path: tuple[int, ...] = ()
    kept: list[Labels] = field(default_factory=list)
    left_out: float = np.inf  # the least that was pruned, of what is minimized
    narrow: bool = False  # whether some were left out that could have been better


class Sweep:
    """Labels over the acts of some moves of a build in time.

    ``prices``: bound how long builds take from any state; ``kept`` (m,): the moves that may be
    taken.
    """

    def __init__(self, timed: TimedGraph, prices: Prices, kept: Bools, caps: Caps) -> None:
        self._timed, self._prices, self._caps = timed, prices, caps
        graph = timed.graph
        rows = np.flatnonzero(kept[timed.move])
        self._move, self._column = timed.move[rows], timed.column[rows]
        self._origin = timed.origin[rows]
        source = graph.source[self._move]
        self._starts = np.searchsorted(source, np.arange(graph.states + 1))
        self._target = graph.target[self._move].astype(np.int64)
        amounts = np.column_stack([graph.amounts, np.ones(len(graph.source))])
        self._amounts = amounts[self._move][:, caps.columns]
        self._longest = timed.longest
        some = graph.only(kept)
        left = [distances(some, amounts[kept, c], back=True) for c in caps.columns]
        self._left = np.column_stack([np.zeros((graph.states, 0)), *left])
        self._sorts = np.bincount(timed.kinds).max() > 1

    def run(
        self, watch: Watch, *, width: int | None = None, goal: int | None = None, most: int = 0
    ) -> Swept:
        """Return the best label within the caps, in the time or in a sum, and what was kept.

        ``width``: how many labels of a level are continued; by default all; ``goal``: the place of
        the sum that is minimized; by default the time is; ``most``: labels that may be kept, 0 for
        any number.
        """
        caps = np.array([self._caps.time, *(cap for _, cap in self._caps.sums)])
        aim, found, count = 0 if goal is None else 1 + goal, Swept(), 0
        levels, best = self._timed.levels, -1
        pending: dict[int, list[Labels]] = {int(levels[0]): [self._first()]}
        for level in range(int(levels.max()) + 1):
            here: list[Labels] = []
            while level in pending:
                fresh = self._fresh(pending.pop(level), here, (caps, aim, width), found)
                here.append(fresh)
                found.kept.append(fresh)
                value, at = self._at_end(fresh, aim)
                if value < found.best:
                    found.best, best = value, count + at
                    caps[aim] = min(caps[aim], value * (1 - MARGIN))
                if watch.over or 0 < most < count + fresh.size:
                    raise LateError
                for after in self._continued(fresh, count):
                    to = levels[after.state]
                    for further in np.unique(to).tolist():
                        pending.setdefault(further, []).append(after.only(to == further))
                count += fresh.size
        found.path = self._path(found.kept, best)
        return found

    def _fresh(
        self,
        met: Sequence[Labels],
        here: Sequence[Labels],
        how: tuple[Floats, int, int | None],
        found: Swept,
    ) -> Labels:
        """Return labels that are continued, of those met; note what is left out."""
        caps, aim, width = how
        fresh, least = self._within(self._undominated(_joined(met), here), caps, aim)
        found.left_out = min(found.left_out, least)
        if width is not None and fresh.size > width:
            order = np.argsort(self._bounds(fresh)[:, aim], kind="stable")
            fresh, found.narrow = fresh.only(np.sort(order[:width])), True
        return fresh

    def _first(self) -> Labels:
        start, curing = np.zeros(1, dtype=np.int64), self._timed.curing
        since, sums = (np.zeros((1, n)) for n in (self._timed.free.shape[1], len(self._caps.sums)))
        placed = np.zeros((1, 0)) if curing is None else curing.placed[None].copy()
        return Labels(start, np.zeros(1), since, sums, np.full(1, -1), placed)

    def _bounds(self, labels: Labels) -> Floats:
        """Return when builds through labels end at least, and what sums they take, (N, 1 + q)."""
        free = self._timed.free[labels.state]
        since = np.where(free, labels.since, labels.end[:, None])
        ends = self._prices.ends(labels.state, labels.end, since)
        return np.column_stack([ends, labels.sums + self._left[labels.state]])

    def _within(self, labels: Labels, caps: Floats, aim: int) -> tuple[Labels, float]:
        """Return labels within the caps, and the least bound of those that are pruned."""
        bounds = self._bounds(labels)
        most = caps + MARGIN * np.abs(caps)
        ok = np.asarray((np.isfinite(bounds) & (bounds <= most)).all(axis=1))
        return labels.only(ok), float(bounds[~ok, aim].min(initial=np.inf))

    def _at_end(self, labels: Labels, aim: int) -> tuple[float, int]:
        """Return the least value of labels at ends, and which it is."""
        values = labels.end if aim == 0 else labels.sums[:, aim - 1]
        values = np.where(self._timed.graph.ends[labels.state], values, np.inf)
        if not len(values):
            return np.inf, 0
        at = int(np.argmin(values))
        return float(values[at]), at

    def _continued(self, labels: Labels, first: int) -> list[Labels]:
        """Return what follows from labels, numbered from ``first``, by one act each."""
        out, counts = list[Labels](), np.diff(self._starts)[labels.state]
        cuts = np.searchsorted(np.cumsum(counts), np.arange(0, counts.sum() + CHUNK, CHUNK)[1:])
        for rows in np.split(np.arange(labels.size), np.unique(cuts)):
            if len(rows) and counts[rows].any():
                out.append(self._acted(labels.only(rows), counts[rows], first + rows))
        return out

    def _acted(self, labels: Labels, counts: Ints, numbers: Ints) -> Labels:
        row = np.repeat(np.arange(labels.size), counts)
        firsts = np.repeat(self._starts[labels.state] - np.cumsum(counts) + counts, counts)
        act = firsts + np.arange(len(row))
        move, column = self._move[act], self._column[act]
        timed = self._timed
        ready = labels.since[row, column] + timed.prepares[move]
        start = np.where(column >= 0, np.maximum(labels.end[row], ready), labels.end[row])
        state, origin, placed = self._target[act], self._origin[act], labels.placed[row]
        if timed.curing is not None:
            start, placed = self._cured((labels.state[row], state), placed, start, timed.acts[move])
        end = start + timed.acts[move]
        since = np.take_along_axis(labels.since[row], origin.clip(min=0), axis=1)
        since = np.where(origin == NOW, end[:, None], since)
        since = np.maximum(since, end[:, None] - self._longest)
        since = np.where(timed.graph.ends[state][:, None], end[:, None], since)  # it is over
        since[origin == HELD] = 0.0
        self._in_order(state, since)
        sums = labels.sums[row] + self._amounts[act]
        after = Labels(state, end, since, sums, numbers[row], placed)
        return after if timed.curing is None else after.only(np.isfinite(end))

    def _cured(
        self, states: tuple[Ints, Ints], placed: Floats, start: Floats, acts: Floats
    ) -> tuple[Floats, Floats]:
        """Return when acts start as mortar lets them, and when bricks are placed after them.

        What has its full bond by then could as well be older. ``states``: before and after.
        """
        curing, (before, state) = self._timed.curing, states
        assert curing is not None
        rows = np.flatnonzero(curing.bricks[state] > curing.bricks[before])
        brick = curing.bricks[state[rows]] - 1
        placed = placed.copy()
        placed[rows, brick] = np.inf
        start = curing.starts(state, placed, start)
        end = start + acts
        placed[rows, brick] = end[rows]
        older = np.maximum(placed, end[:, None] - curing.full)
        stands = np.arange(placed.shape[1]) < curing.bricks[state][:, None]
        over = self._timed.graph.ends[state][:, None]
        return start, np.where(stands & ~over, older, 0.0)

    def _in_order(self, state: Ints, since: Floats) -> None:
        """Sort the readiness of columns that could change places, in place."""
        for _ in range(since.shape[1] - 1 if self._sorts else 0):
            for column in range(since.shape[1] - 1):
                swap = self._timed.alike[state, column] & (since[:, column] > since[:, column + 1])
                rows = np.flatnonzero(swap)
                since[rows[:, None], [column, column + 1]] = since[
                    rows[:, None], [column + 1, column]
                ]

    def _undominated(self, fresh: Labels, known: Sequence[Labels]) -> Labels:
        """Return the labels that no known one, and no other, dominates."""
        states = np.zeros(self._timed.graph.states, dtype=bool)
        states[fresh.state] = True
        old = [labels.only(states[labels.state]) for labels in known]
        count = sum(labels.size for labels in old)
        every = _joined([*old, fresh])
        keys = np.column_stack([every.end, every.since, every.sums, every.placed])
        new = np.arange(every.size) >= count  # of equal ones the known one comes first
        order = np.lexsort((new, *keys.T[::-1], every.state))
        state, keys = every.state[order], keys[order]
        beaten = np.zeros(len(order), dtype=bool)
        rows, back = np.flatnonzero(new[order]), 0
        while len(rows):
            back += 1
            rows = rows[rows >= back]
            rows = rows[state[rows] == state[rows - back]]
            worse = (keys[rows - back] <= keys[rows]).all(axis=1)
            beaten[rows[worse]] = True
            rows = rows[~worse]
        return every.only(np.sort(order[~beaten & new[order]]))

    def _path(self, every: Sequence[Labels], number: int) -> tuple[int, ...]:
        """Return the states of the path of a label, the start left out."""
        if number < 0:
            return ()
        state = np.concatenate([labels.state for labels in every])
        before = np.concatenate([labels.before for labels in every])
        out = list[int]()
        while before[number] >= 0:
            out.append(int(state[number]))
            number = int(before[number])
        return tuple(out[::-1])
