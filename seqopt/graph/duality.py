"""Lower bounds of all paths through a graph by weak duality, checked with arithmetic alone.

A sum is bounded by potentials: no move leads to a state by less than the difference of both states'
potentials, so that no path takes less than the end's potential. A worst amount is bounded by a cut:
every move that leaves a set of states, with the start among them and no end, takes at least as
much. Potentials and sets come from wherever they may; only the inequalities count.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Bools, Floats
from seqopt.graph.graph import Graph
from seqopt.graph.paths import _least_or_none, distances, reached, tied

ROUNDING = 1e-12  # by how much sums may be off, over the largest potential


def lexicographic_bounds(graph: Graph, values: Sequence[float]) -> tuple[float, ...]:
    """Return lexicographic lower bounds of all paths, goals before each being at their values.

    Infinite where no path leads to an end, minus infinity where an inequality does not hold.
    """
    out = []
    for goal, value in enumerate(values):
        bound, kept = (cut if graph.peaks[goal] else potentials)(graph, goal, value)
        out.append(bound)
        graph = graph.only(kept)
    return tuple(out)


def cut(graph: Graph, goal: int, value: float) -> tuple[float, Bools]:
    """Return the bound of a worst amount, and the moves that take no more than a value."""
    amounts = graph.amounts[:, goal]
    least = _least_or_none(graph, goal)
    inside = reached(graph, amounts < (np.inf if least is None else least))
    leaving = inside[graph.source] & ~inside[graph.target]
    bound = float(amounts[leaving].min(initial=np.inf))
    if not inside[0] or graph.ends[inside].any():
        bound = 0.0 if least == 0.0 else -np.inf
    return bound, amounts <= tied(value)


def potentials(graph: Graph, goal: int, value: float) -> tuple[float, Bools]:
    """Return the bound of a sum, and the moves that can be on a path of no more than a value."""
    costs = graph.amounts[:, goal]
    before, after = distances(graph, costs), distances(graph, costs, back=True)
    bound, every = _sum_bound(graph, costs, before), np.ones(len(costs), dtype=bool)
    if bound == -np.inf or after[graph.ends].any() or not _hold(after, costs, graph, back=True):
        return bound, every
    return bound, before[graph.source] + costs + after[graph.target] <= tied(value)


def _sum_bound(graph: Graph, costs: Floats, before: Floats) -> float:
    """Return a lower bound of a sum of costs (m,) on all paths, by potentials of states (n,).

    Minus infinity where a move takes less than the difference of its states' potentials.
    """
    if before[0] > 0 or not _hold(before, costs, graph):
        return -np.inf
    return float(before[graph.ends].min(initial=np.inf))


def least_sum(graph: Graph, costs: Floats) -> float:
    """Return a lower bound of a sum of costs (m,), from 0, on all paths, by potentials.

    Infinite where no path leads to an end, minus infinity where an inequality does not hold.
    """
    return _sum_bound(graph, costs, distances(graph, costs))


def _to_go(graph: Graph, costs: Floats) -> Floats:
    """Return lower bounds (n,) of a sum of costs (m,), from 0, from states to ends.

    Infinite where no path leads to an end; zero where an inequality does not hold.
    """
    left = distances(graph, costs, back=True)
    if left[graph.ends].any() or not _hold(left, costs, graph, back=True):
        return np.zeros(graph.states)
    return left


def _hold(least: Floats, costs: Floats, graph: Graph, *, back: bool = False) -> bool:
    """Return whether potentials (n,) are dual feasible: no move costs less than their rise."""
    ends = (graph.target, graph.source) if back else (graph.source, graph.target)
    first, second = least[ends[0]], least[ends[1]]
    ways = np.isfinite(first)
    slack = ROUNDING * np.max(np.abs(least[np.isfinite(least)]), initial=0.0)
    return bool((second[ways] <= first[ways] + costs[ways] + slack).all())
