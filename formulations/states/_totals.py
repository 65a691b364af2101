r"""The path of least worst or tail total over scenarios: weights, then labels that they bound.

A path :math:`p` has a total :math:`c_s(p)` in every scenario, and the aim makes
:math:`\max_{w \in W} \sum_s w_s \, c_s(p)` of them, over weights from 0 up
to the largest of one that add up to one. At fixed weights the cheapest path is what a formulation
finds for a single sum, and a bound on all. What the best weights leave open is closed by labels,
vectors of totals: with the least from every state on, under each of some weights, a label has a
bound, and the one with the lowest is continued first. Labels whose bound is not below the best path
are left out, and so is one that another one of its state dominates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from formulations.choice import Choose
from seqopt.arrays import Floats, Ints
from seqopt.graph._multipliers import Plane, Polyhedron, highest_bound
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph
from seqopt.graph.paths import distances, moves_along
from seqopt.problem.problem import RobustAim

_Cheapest = Callable[[Graph], tuple[tuple[int, ...], float]]
STEPS = 400  # weights that are tried at most
CLOSE = 1e-9  # differences that are none, over the size of the values
LABELS = 50_000  # that are continued at most


class StopError(Exception):
    """Time or memory that was given is used up; says which."""


def cheapest_by(choose: Choose, watch: Watch) -> _Cheapest:
    """Return an oracle of the shortest path and its lower bound."""

    def cheapest(graph: Graph) -> tuple[tuple[int, ...], float]:
        found = choose(graph, watch)
        if not found.path:
            raise StopError("time")
        return found.path, found.bounds[0] if found.bounds else -np.inf

    return cheapest


class LeastTotal(NamedTuple):
    """Incumbent, its value, lower bound and the weights (S,) that prove most of it."""

    path: tuple[int, ...]
    value: float
    bound: float
    weights: Floats


def least_total(graph: Graph, aim: RobustAim, cheapest: _Cheapest, watch: Watch) -> LeastTotal:
    """Return the path of least total.

    ``graph``: with a sum for every scenario, all of it on paths from the start to ends;
    ``cheapest``: an oracle of the shortest path through a graph with one goal, and its bound.
    """
    best = by_weights(graph, aim, cheapest, watch)
    if watch.over or best.bound >= _below(best.value):
        return best._replace(bound=min(best.bound, best.value))
    return _by_labels(graph, aim, best, watch)


def by_weights(graph: Graph, aim: RobustAim, cheapest: _Cheapest, watch: Watch) -> LeastTotal:
    """Return the best path that is met on the way to the weights with the highest bound."""
    count, best = len(graph.peaks), LeastTotal((), np.inf, -np.inf, np.zeros(0))

    def met(weights: Floats) -> Plane:
        nonlocal best
        sums = (graph.amounts @ weights)[:, None]
        path, bound = cheapest(Graph(graph.source, graph.target, sums, (False,), graph.ends))
        totals = graph.amounts[moves_along(graph, path)].sum(axis=0)
        if aim.value(totals) < best.value:
            best = best._replace(path=path, value=aim.value(totals))
        return Plane(0.0, totals, bound)

    def ended(bound: float) -> bool:
        watch.tell(best.value, bound)
        return watch.over

    region = Polyhedron(aim.most(count), counts=np.ones(count))
    start = np.full(count, 1.0 / count)
    weights, bound = highest_bound(met, start, region, ended, rounds=STEPS, closed=CLOSE)
    return best._replace(bound=bound, weights=weights)


def _below(value: float) -> float:
    return value - CLOSE * abs(value)


def _by_labels(graph: Graph, aim: RobustAim, known: LeastTotal, watch: Watch) -> LeastTotal:
    """Return the best path, by labels continued in the order of what they come to at least."""
    scenarios, best, path = len(graph.peaks), known.value, known.path
    single = np.eye(scenarios) if aim.most(scenarios) >= 1 else np.zeros((0, scenarios))
    proving = np.vstack([known.weights, single])
    left = np.array([distances(graph, graph.amounts @ w, back=True) for w in proving])
    starts = np.searchsorted(graph.source, np.arange(graph.states + 1))
    heap = [(known.bound, 0, 0, -1, np.zeros(scenarios))]
    kept: dict[int, Floats] = {}
    popped: list[tuple[int, int]] = []  # state, and which label it continues
    count = 0
    while heap and heap[0][0] < _below(best):
        if len(popped) == LABELS or (len(popped) % 1000 == 0 and watch.over):
            return LeastTotal(path, best, max(known.bound, heap[0][0]), known.weights)
        _, _, state, before, totals = heappop(heap)
        others = kept.get(state, np.zeros((0, scenarios)))
        if (others <= totals).all(axis=1).any():
            continue
        kept[state] = np.vstack([others, totals])
        popped.append((state, before))
        if graph.ends[state] and aim.value(totals) < best:
            path, best = path_of(popped, len(popped) - 1), aim.value(totals)
        moves: Ints = np.arange(starts[state], starts[state + 1])
        then = totals + graph.amounts[moves]
        bounds = (then @ proving.T + left[:, graph.target[moves]].T).max(axis=1)
        for k in np.flatnonzero(bounds < _below(best)).tolist():
            count += 1
            row = (float(bounds[k]), -count, int(graph.target[moves[k]]), len(popped) - 1, then[k])
            heappush(heap, row)
    return LeastTotal(path, best, best, known.weights)


def path_of(popped: Sequence[tuple[int, int]], last: int) -> tuple[int, ...]:
    """Return the states of a label's path by where each one comes from, the start left out."""
    path = list[int]()
    while last > 0:
        state, last = popped[last]
        path.append(state)
    return tuple(reversed(path))
