r"""The path of least worst or tail total over scenarios: weights, then labels that they bound.

A path :math:`p` has a total :math:`c_s(p)` in every scenario, and the aim makes
:math:`\max_{w \in W} \sum_s w_s \, c_s(p)` of them, over weights from 0 up to the largest of one
that add up to one. At fixed weights the cheapest path is what a formulation finds for a single sum,
and a bound on all. What the best weights leave open is closed by labels, vectors of totals
(`seqopt.graph._labels`): with the least from every state on, under each of some weights, a label
has a bound.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from formulations.choice import Choose
from seqopt.arrays import Floats, Ints
from seqopt.graph._labels import LabelSearch, SummedLabels, widening
from seqopt.graph._multipliers import Plane, Polyhedron, highest_bound
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph
from seqopt.graph.paths import distances, moves_along
from seqopt.problem.problem import RobustAim

_Cheapest = Callable[[Graph], tuple[tuple[int, ...], float]]
STEPS = 400  # weights that are tried at most
CLOSE = 1e-9  # differences that are none, over the size of the values
LABELS = 16_384  # of a level that are continued at most


class StopError(Exception):
    """The limit of time or of memory, as its text says, is reached."""


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
    if watch.over or best.bound >= best.value - CLOSE * abs(best.value):
        return best._replace(bound=min(best.bound, best.value))
    growth = _Totals(graph, aim, best.weights)  # labels close the gap that weights leave
    known = LabelSearch(None, best.value, best.bound)
    found = widening(growth, np.zeros(0), known, watch, LABELS)
    path = best.path if found.arcs is None else tuple(graph.target[found.arcs].tolist())
    return LeastTotal(path, found.cost, found.bound, best.weights)


def by_weights(graph: Graph, aim: RobustAim, cheapest: _Cheapest, watch: Watch) -> LeastTotal:
    """Return the best path met on the way to the weights of the highest lower bound."""
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


class _Totals(SummedLabels):
    """Labels of the totals of all scenarios, bounded by weights (S,), and by single scenarios."""

    def __init__(self, graph: Graph, aim: RobustAim, weights: Floats) -> None:
        super().__init__(graph, graph.amounts)
        scenarios, self._aim = len(weights), aim
        single = np.eye(scenarios if aim.most(scenarios) >= 1 else 0, scenarios)
        self._weights = np.vstack([weights, single])
        left = [distances(graph, graph.amounts @ own, back=True) for own in self._weights]
        self._left = np.column_stack(left)

    def bounds(self, state: Ints, taken: Floats) -> Floats:
        """Return a lower bound of the aim by totals of paths."""
        weighed = taken @ self._weights.T + self._left[state]
        return np.asarray(weighed.max(axis=1, keepdims=True))

    def values(self, taken: Floats, _: int) -> Floats:
        """Return the aim of totals."""
        return self._aim.each(taken)
