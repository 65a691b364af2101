"""Labels over a build in time, in batches, and multipliers of the robots' time, which bound them.

A label of a state is when the last step ended, since when the robots of its columns are free, what
sums took by then, and what further resources came to (`seqopt.graph._budgets`).

Every build takes at least the time of all that its steps take one after the
other, and no less than the time of any robot: preparing, acting, and holding while others act. With
multipliers from 0 that add up to one over these, the weighted time of moves is a sum along a path,
and the shortest path bounds every build (`seqopt.graph._budgets`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph._budgets import (
    Asked,
    Carried,
    Joint,
    Plane,
    Polyhedron,
    Sums,
    Sweep,
    Swept,
    highest_bound,
)
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph, distances, fewest_moves, moves_along
from seqopt.problem.requirements import Resource, StepArrays
from seqopt.times._graph import HELD, NOW, TimedGraph

ROUNDS = 25  # of cutting planes
CLOSED = 1e-7  # relative tolerance of the multipliers
TIGHT = 1e-9  # of a distance: by how much moves of a shortest path may be off
KEPT = 3  # multipliers that bound labels, those with the highest bounds


@dataclass(frozen=True, eq=False)
class Prices:
    """Multipliers of the robots' time, and bounds by them.

    ``each`` (L, 1 + k): multipliers of the time of all, and of a robot of every kind; ``left`` (L,
    n): weighted time from states to ends at least; ``kinds`` (c,): of columns; ``bound``: of any
    build, s.
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


@dataclass(frozen=True, eq=False)
class Caps:
    """Upper limits of paths.

    ``time``: the end of the build, s; ``sums``: of columns of the graph, most that each may take.
    """

    time: float = np.inf
    sums: tuple[tuple[int, float], ...] = ()


class InTime(Carried):
    """The readiness of robots, and ages of mortar where it cures, over the acts of some moves.

    Values are, in this order: the end of the last step, s; since when robots of columns are free,
    s, zero where they hold; and where mortar cures when bricks were in their places, s, zero of
    those that are not. ``prices``: multipliers that bound the makespan from any state; ``acts``
    (a,): that may be taken; ``most``: the end of the build, s.
    """

    def __init__(self, timed: TimedGraph, prices: Prices, acts: Ints, most: float) -> None:
        self._timed, self._prices, self.limits = timed, prices, np.array([most])
        self._move, self._column = timed.move[acts], timed.column[acts]
        self._origin = timed.origin[acts]
        graph = timed.graph
        self._before = graph.source[self._move].astype(np.int64)
        self._after = graph.target[self._move].astype(np.int64)
        self._sorts = np.bincount(timed.kinds).max() > 1
        self._placed = 1 + timed.free.shape[1]
        bricks = np.zeros(0) if timed.curing is None else timed.curing.placed
        self.first = np.concatenate([np.zeros(self._placed), bricks])

    def totals(self, values: Floats) -> Floats:
        """Return makespans, s, (N, 1)."""
        return values[:, :1]

    def bounds(self, state: Ints, values: Floats) -> Floats:
        """Return lower bounds of the makespan, s, (N, 1)."""
        end = values[:, 0]
        since = np.where(self._timed.free[state], values[:, 1 : self._placed], end[:, None])
        return self._prices.ends(state, end, since)[:, None]

    def extend(self, arc: Ints, values: Floats) -> Floats:
        """Return the values of labels after an act each, (N, k)."""
        timed, state = self._timed, self._after[arc]
        move, column, origin = self._move[arc], self._column[arc], self._origin[arc]
        end, since, placed = values[:, 0], values[:, 1 : self._placed], values[:, self._placed :]
        ready = since[np.arange(len(arc)), column] + timed.prepares[move]
        start = np.where(column >= 0, np.maximum(end, ready), end)
        if timed.curing is not None:
            states = self._before[arc], state
            start, placed = self._cured(states, placed, start, timed.acts[move])
        end = start + timed.acts[move]
        after = np.take_along_axis(since, origin.clip(min=0), axis=1)
        after = np.where(origin == NOW, end[:, None], after)
        after = np.maximum(after, end[:, None] - timed.longest)
        after = np.where(timed.graph.ends[state][:, None], end[:, None], after)  # it is over
        after[origin == HELD] = 0.0
        columns = range(after.shape[1] - 1)
        for column in [*columns] * len(columns) if self._sorts else ():  # robots that are alike
            swap = timed.alike[state, column] & (after[:, column] > after[:, column + 1])
            rows, pair = np.flatnonzero(swap)[:, None], [column, column + 1]
            after[rows, pair] = after[rows, pair[::-1]]
        return np.column_stack([end, after, placed])

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


@dataclass(frozen=True, eq=False)
class Carrying:
    """Moves of a build, and the labels that depend on the path.

    ``levels`` (n,): of states; ``timed``: readiness of robots, if that counts; else moves are
    counted in its place; ``asked``: further resources, ``steps``: what these see of moves.
    """

    graph: Graph
    levels: Ints
    timed: TimedGraph | None
    asked: tuple[Resource, ...] = ()
    steps: StepArrays | None = None

    def prices(self, kept: Bools, watch: Watch) -> Prices:
        """Return the multipliers that bound builds by some moves, (m,) bool, best."""
        if self.timed is not None:
            return best_prices(self.timed, kept, watch)
        left = distances(self.graph.only(kept), np.ones(int(kept.sum())), back=True)
        return Prices(np.zeros((0, 0)), left[None], np.zeros(0, dtype=np.int64), float(left[0]))

    def joint(self, prices: Prices, kept: Bools, caps: Caps) -> Joint:
        """Return labels of all resources and capped sums over some moves, (m,) bool."""
        graph, timed = self.graph, self.timed
        moves = np.flatnonzero(kept)
        own: list[Carried] = []
        if timed is not None:
            acts = np.flatnonzero(kept[timed.move])
            moves, own = timed.move[acts], [InTime(timed, prices, acts, caps.time)]
        else:
            own.append(Sums(np.ones((len(moves), 1)), np.array([caps.time]), prices.left.T))
        if caps.sums:
            columns, most = zip(*caps.sums, strict=True)
            amounts = graph.amounts[:, columns]
            some = graph.only(kept)
            left = [distances(some, each, back=True) for each in amounts[kept].T]
            own.append(Sums(amounts[moves], np.array(most), np.column_stack(left)))
        if self.steps is not None:
            own += [Asked(each, self.steps.only(moves)) for each in self.asked]
        arcs = graph.source[moves].astype(np.int64), graph.target[moves].astype(np.int64)
        return Joint(graph, own, self.levels, arcs, look_back=len(moves))

    def sweep(
        self,
        kept: Bools,
        caps: Caps,
        prices: Prices,
        watch: Watch,
        *,
        width: int | None = None,
        goal: int | None = None,
        most: int = 0,
    ) -> Swept:
        """Return the best label within the caps, in the time or in a sum, and the kept labels.

        ``width``: how many labels of a level are continued; by default all; ``goal``: the place of
        the sum that is minimized; by default the time is; ``most``: labels that may be kept, 0 for
        any number.
        """
        labels = self.joint(prices, kept, caps)
        aim = 0 if goal is None else 1 + goal
        return Sweep(labels, labels.limits, aim=aim, width=width).run(watch, most)
