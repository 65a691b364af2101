"""Prices of the time of robots, which bound how long builds take from any state.

Whatever a build does, it takes no less than the time of all that its steps take one after the
other, and no less than the time of any robot: preparing, acting, and holding while others act. With
prices from 0 that add up to one over these, the priced time of moves is a sum along a path, and the
shortest path bounds every build. The best prices are found by cutting planes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph._timed import TimedGraph
from seqopt.graph.graph import Graph
from seqopt.graph.paths import distances, fewest_moves
from seqopt.plan.calling.formulation import Watch

ROUNDS = 25  # of cutting planes
CLOSED = 1e-7  # share of the bound to which prices are the best
TIGHT = 1e-9  # of a distance: by how much moves of a shortest path may be off
KEPT = 3  # prices that bound labels, those with the highest bounds


@dataclass(frozen=True, eq=False)
class Prices:
    """Prices, and what they say.

    ``each`` (L, 1 + k): of the time of all, and of a robot of every kind; ``left`` (L, n): priced
    time from states to ends at least; ``kinds`` (c,): of columns; ``bound``: of any build, s;
    ``paths``: shortest ones, of states.
    """

    each: Floats
    left: Floats
    kinds: Ints
    bound: float
    paths: tuple[tuple[int, ...], ...]

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
    """Return the prices whose bound on all builds by some moves, (m,) bool, is highest."""
    graph, work = timed.graph.only(kept), timed.work[kept]
    sizes = timed.sizes.astype(float)
    planes, tried = list[Floats](), list[tuple[float, Floats, Floats]]()
    paths = dict[tuple[int, ...], None]()
    ask, best, roof = np.full(len(sizes), 1 / len(sizes)) / sizes, -np.inf, np.inf
    for step in range(ROUNDS):
        left, path, taken = _cheapest(graph, work, ask)
        tried.append((float(left[0]), ask, left))
        tried = sorted(tried, key=lambda each: -each[0])[:KEPT]
        best = tried[0][0]
        planes.append(taken)
        paths[path] = None
        highest, roof = _highest(np.array(planes), sizes)
        if roof <= best + CLOSED * abs(best) or watch.over:
            break
        ask = highest if step % 2 == 0 else 0.5 * (highest + tried[0][1])
    each, lefts = np.array([e for _, e, _ in tried]), np.array([e for *_, e in tried])
    return Prices(each, lefts, timed.kinds, best, tuple(paths))


def _cheapest(graph: Graph, work: Floats, prices: Floats) -> tuple[Floats, tuple[int, ...], Floats]:
    """Return the priced time from states to ends, a shortest path, and the work of that."""
    costs = work @ prices
    left = distances(graph, costs, back=True)
    slack = TIGHT * (1 + left[0])
    with np.errstate(invalid="ignore"):
        tight = costs + left[graph.target] <= left[graph.source] + slack
    tight &= np.isfinite(left[graph.target])
    path = fewest_moves(graph.only(tight))
    moves = _moves_of(graph, path)
    return left, path, work[moves].sum(axis=0)


def _moves_of(graph: Graph, path: tuple[int, ...]) -> Ints:
    codes = graph.source.astype(np.int64) * graph.states + graph.target
    wanted = np.array((0, *path[:-1])) * graph.states + np.array(path)
    return np.asarray(np.searchsorted(codes, wanted))


def _highest(planes: Floats, sizes: Floats) -> tuple[Floats, float]:
    """Return the prices at which the least of planes (p, 1 + k) is highest, and how high."""
    count, dims = planes.shape
    matrix = np.column_stack([-planes, np.ones(count)])
    found = linprog(
        [0.0] * dims + [-1.0],
        A_ub=matrix,
        b_ub=np.zeros(count),
        A_eq=[[*sizes, 0.0]],
        b_eq=[1.0],
        bounds=[(0.0, None)] * dims + [(None, None)],
        method="highs",
    )
    if found.x is None or found.fun is None:
        return 1 / (dims * sizes), np.inf
    prices = np.maximum(found.x[:-1], 0.0)
    return prices / (prices @ sizes), float(-found.fun)


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
