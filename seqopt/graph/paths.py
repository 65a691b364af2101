"""Best paths through a graph, for one goal after the other, by scipy.sparse.csgraph."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.csgraph import breadth_first_order, dijkstra

from seqopt.arrays import Bools, Floats
from seqopt.errors import InfeasibleError
from seqopt.graph.graph import Graph

TIED = 1e-9  # of the least: by how much a path may exceed it and still be one of the best


class Best(NamedTuple):
    """A best path.

    Attributes
    ----------
    path : tuple of int
        Its states, the start left out.
    values : tuple of float
        What every goal takes of it.
    """

    path: tuple[int, ...]
    values: tuple[float, ...]


def lexicographic(graph: Graph) -> Best:
    """Return the path that is best in the first goal, among these in the second, and so on.

    Of equal ones it is the shortest, and of these the one whose states come first.

    Parameters
    ----------
    graph : Graph

    Returns
    -------
    Best

    Raises
    ------
    InfeasibleError
        If no path leads to an end.
    """
    values = []
    for goal in range(len(graph.peaks)):
        graph, least = keep_best(graph, goal)
        values.append(least)
    return Best(fewest_moves(graph), tuple(values))


def keep_best(graph: Graph, goal: int) -> tuple[Graph, float]:
    """Return the moves on paths that are best in a goal, and its least value."""
    amounts = graph.amounts[:, goal]
    if graph.peaks[goal]:
        least = least_peak(graph, goal)
        return graph.only(amounts <= tied(least)), least
    before, after = distances(graph, amounts), distances(graph, amounts, back=True)
    least = float(after[0])
    if not np.isfinite(least):
        raise InfeasibleError("no path leads to an end")
    return graph.only(before[graph.source] + amounts + after[graph.target] <= tied(least)), least


def tied(value: float) -> float:
    """Return up to what values count as one: no path is better by an error of rounding."""
    return value + TIED * abs(value)


def least_peak(graph: Graph, goal: int) -> float:
    """Return the least worst amount of any path; an `InfeasibleError` says that there is none."""
    least = least_or_none(graph, goal)
    if least is None:
        raise InfeasibleError("no path leads to an end")
    return least


def least_or_none(graph: Graph, goal: int) -> float | None:
    """Return the least worst amount of any path, by bisection over all amounts that occur."""
    amounts = graph.amounts[:, goal]
    levels = np.unique(amounts)
    low, high = 0, len(levels)
    if graph.ends[0]:
        return 0.0
    while low < high:
        middle = (low + high) // 2
        if graph.ends[reached(graph, amounts <= levels[middle])].any():
            high = middle
        else:
            low = middle + 1
    return None if low == len(levels) else float(levels[low])


def reached(graph: Graph, kept: Bools | None = None) -> Bools:
    """Return which states the start reaches by some of the moves, (n,) bool."""
    out = np.zeros(graph.states, dtype=bool)
    matrix = graph.matrix(np.ones(len(graph.source)), kept)
    out[breadth_first_order(matrix, 0, return_predecessors=False)] = True
    return out


def distances(graph: Graph, costs: Floats, *, back: bool = False) -> Floats:
    """Return the least sum of costs (m,) from the start to every state, or from it to an end.

    Infinite where no path leads, (n,).
    """
    matrix: Any = graph.matrix(costs)
    if not back:
        return np.asarray(dijkstra(matrix, indices=[0])[0])
    ends = np.flatnonzero(graph.ends)
    if not len(ends):
        return np.full(graph.states, np.inf)
    return np.asarray(dijkstra(matrix.T.tocsr(), indices=ends, min_only=True))


def fewest_moves(graph: Graph) -> tuple[int, ...]:
    """Return the states on a path of fewest moves, the first of them in the order of states."""
    after = distances(graph, np.ones(len(graph.source)), back=True)
    tight = graph.only(after[graph.target] == after[graph.source] - 1)
    state, path = 0, list[int]()
    while after[state] > 0:
        state = int(tight.target[np.searchsorted(tight.source, state)])
        path.append(state)
    return tuple(path)
