"""How little any path within caps on sums can cost: the certificate's own proof.

It shares nothing with the formulations that it judges. Multipliers are climbed by subgradients from
those that are claimed, if any; each proves a bound, the least priced cost of any path. Then paths
are laid down from their ends back to the start. One is dropped that cannot cost less than the
answer, or exceeds a cap, or is beaten in everything by another from the same state on. If none is
left the answer is the best; if too many are, the least bound of those left aside holds for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.csgraph import dijkstra

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.graph import Graph

CLIMBS = 80  # multipliers that are tried
PATIENCE = 4  # tries without a better bound after which steps are halved
MOST = 5_000  # partial paths that are kept at a level
SLACK = 1e-9  # of a cap or a cost: what sums are off by; caps have as much more
EPS = float(np.finfo(float).eps)
TINY = float(np.finfo(float).tiny)
NEIGHBORS = (1, 2, 3, 5, 8, 13, 21, 34)  # with which a partial path is compared


@dataclass(frozen=True, eq=False)
class Case:
    """What is judged: what moves cost (m,) and take of caps (m, B), over the size of each.

    ``value``: of a path within the caps; no higher bound is looked for; ``scale``: its size.
    """

    graph: Graph
    costs: Floats
    takes: Floats
    caps: Floats
    value: float
    scale: float

    def reached(self, costs: Floats) -> Floats:
        """Return the least sum of costs (m,) from the start to every state, (n,)."""
        matrix: Any = self.graph.matrix(costs)
        return np.asarray(dijkstra(matrix, indices=[0])[0])


class _Parts(NamedTuple):
    """Ends of paths: first state, priced and plain cost, what they take, and a bound."""

    at: Ints
    behind: Floats
    cost: Floats
    taken: Floats
    bound: Floats

    def of(self, rows: Ints | Bools) -> _Parts:
        """Select rows."""
        return _Parts._make(each[rows] for each in self)


def case_of(
    graph: Graph, costs: Floats, limited: Sequence[tuple[int, float]], value: float
) -> tuple[Case, Floats]:
    """Return what is judged, and by what the amounts of columns are divided.

    ``limited``: columns of the graph and what may be taken of them.
    """
    taken = graph.amounts[:, [column for column, _ in limited]]
    most = np.array([cap for _, cap in limited])
    sizes = np.maximum(np.maximum(np.abs(most), np.abs(taken).max(axis=0, initial=0.0)), TINY)
    scale = max(abs(value), TINY)
    return Case(graph, costs, taken / sizes, most / sizes + SLACK, value, scale), sizes


def least_within(case: Case, prices: Floats, *, laid_down: bool) -> tuple[float, Floats]:
    """Return a bound on what any path within the caps costs, at most the value; its multipliers.

    ``prices`` (B,): where the climb begins, as the case has them; ``laid_down``: whether what
    multipliers leave open is closed by partial paths; the graph has a level for every move.
    """
    best, bound = _climbed(case, prices)
    if laid_down and case.value - bound > SLACK * case.scale:
        bound = max(bound, _laid_down(case, best)[0])
    return (case.value if case.value - bound <= SLACK * case.scale else bound), best


def is_kept(graph: Graph, limited: Sequence[tuple[int, float]]) -> bool:
    """Return whether a path is found that keeps all caps; the graph has a level for every move."""
    case, sizes = case_of(graph, np.zeros(len(graph.source)), limited, 1.0)
    return _laid_down(case, np.zeros_like(sizes))[1]


def _climbed(case: Case, prices: Floats) -> tuple[Floats, float]:
    """Return the best multipliers that were met on the way up, and the bound that they prove."""
    best, bound, pace, waited = prices, -np.inf, 1.0, 0
    now = prices
    for _ in range(CLIMBS):
        found, slope = _least(case, now)
        if found > bound:
            best, bound, waited = now, found, 0
        else:
            waited += 1
        if waited >= PATIENCE:
            now, pace, waited = best, 0.5 * pace, 0
            found, slope = _least(case, now)
        uphill = np.where((now <= 0) & (slope < 0), 0.0, slope)
        if case.value - bound <= SLACK * case.scale or not uphill.any():
            break
        now = np.maximum(now + pace * (case.value - found) / (uphill @ uphill) * uphill, 0.0)
    return best, bound - SLACK**1.5 * case.scale


def _least(case: Case, prices: Floats) -> tuple[float, Floats]:
    """Return the least priced cost of any path, and by how much that path exceeds caps."""
    graph, costs = case.graph, case.costs + case.takes @ prices
    matrix: Any = graph.matrix(costs)
    (reached,), (before,) = dijkstra(matrix, indices=[0], return_predecessors=True)
    ends = np.flatnonzero(graph.ends)
    at = int(ends[np.argmin(reached[ends])]) if len(ends) else 0
    if not len(ends) or not np.isfinite(reached[at]):
        return np.inf, np.zeros(len(prices))
    rounding = EPS * (graph.states + 1) * float(prices @ (1 + np.abs(case.caps)))
    least, over = float(reached[at] - prices @ case.caps - rounding), -case.caps.copy()
    while at:
        moves = np.flatnonzero((graph.source == before[at]) & (graph.target == at))
        over += case.takes[moves[np.argmin(costs[moves])]]
        at = int(before[at])
    return least, over


def _laid_down(case: Case, prices: Floats) -> tuple[float, bool]:
    """Return the least that a path within the caps costs, or bounds it, from the ends back.

    And whether one was found that costs less than the answer.
    """
    graph, priced = case.graph, case.costs + case.takes @ prices
    begun = case.reached(priced) - float(prices @ case.caps)
    spared = np.column_stack([case.reached(takes) for takes in case.takes.T])
    order = np.argsort(graph.target, kind="stable")
    starts = np.searchsorted(graph.target[order], np.arange(graph.states + 1))
    ends = np.flatnonzero(graph.ends)
    zero = np.zeros(len(ends))
    now, aside = _Parts(ends, zero, zero, np.zeros((len(ends), len(case.caps))), zero), np.inf
    while (now.at > 0).any():
        count = starts[now.at + 1] - starts[now.at]
        row = np.repeat(np.arange(len(now.at)), count)
        first = np.repeat(starts[now.at] - np.cumsum(count) + count, count)
        move = order[first + np.arange(len(row))]
        to, behind = graph.source[move].astype(np.int64), now.behind[row] + priced[move]
        bound, taken = behind + begun[to], now.taken[row] + case.takes[move]
        grown = _Parts(to, behind, now.cost[row] + case.costs[move], taken, bound)
        fits = (taken + spared[to] <= case.caps).all(axis=1)
        now = grown.of(fits & (bound < case.value - SLACK * case.scale))
        now = now.of(_unbeaten(now.at, now.cost, now.taken))
        if len(now.at) > MOST:
            ranked = np.argsort(now.bound, kind="stable")
            aside = min(aside, float(now.bound[ranked[MOST]]))
            now = now.of(ranked[:MOST])
    return min(aside, float(now.cost.min(initial=case.value))), len(now.at) > 0


def _unbeaten(at: Ints, cost: Floats, taken: Floats) -> Bools:
    """Return which partial paths none is found to beat in cost and in all caps."""
    order = np.lexsort((taken.sum(axis=1), cost, at))
    at, cost, taken = at[order], cost[order], taken[order]
    good = np.ones(len(at), dtype=bool)
    for n in NEIGHBORS:
        if n < len(at):
            beats = (taken[:-n] <= taken[n:]).all(axis=1) & (cost[:-n] <= cost[n:])
            good[n:] &= ~(beats & (at[:-n] == at[n:]))
    out = np.zeros(len(at), dtype=bool)
    out[order] = good
    return out
