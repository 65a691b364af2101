r"""The states of a build by setting labels, vectors of all goals at once: exact.

A label of a state :math:`v` is what goals take of a path to it, :math:`z = (z_1, z_2, \dots)`. With
a move :math:`a = (v, w)` it becomes one of :math:`w`,

.. math::

   z'_g = \max \{ z_g, c_{a g} \} \quad\text{or}\quad z'_g = z_g + c_{a g} .

Continued first is the label whose vector :math:`f` is least, goal by goal,

.. math::

   f_g = \max \{ z_g, h_g(v) \} \quad\text{or}\quad f_g = z_g + h_g(v),

and one that another one of the same state dominates is dropped. The first one at an
end is the best, since no goal ever gets less on the way. Values up to `seqopt.graph.graph.TIED`
apart count as one. In ``path_labels`` the lower bound of the rest of a path is :math:`h = 0`
(Martins, On a multicriteria shortest path problem, 1984). In ``best_first`` (A*) it is the optimum
of every goal alone: 0 at an end, and

.. math::

   h_g(v) = \min_{a = (v, w)} \; \max \{ c_{a g}, h_g(w) \}
   \quad\text{or}\quad
   h_g(v) = \min_{a = (v, w)} \; \bigl( c_{a g} + h_g(w) \bigr)

(Mandow and Pérez de la Cruz, Multiobjective A* search with consistent heuristics, 2010).
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from operator import le

import numpy as np

from formulations.on_graph import Choice, on_graph
from seqopt.arrays import Floats
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph, tied

_Values = tuple[float, ...]


def _path(popped: Sequence[tuple[int, int]], last: int) -> tuple[int, ...]:
    """Return the states of a label's path by where each one comes from, the start left out."""
    path = list[int]()
    while last > 0:
        state, last = popped[last]
        path.append(state)
    return tuple(reversed(path))


def _best_label(graph: Graph, to_go: Floats, watch: Watch) -> Choice:
    """Return the best path by labels, goals taking ``to_go`` (n, g) at least from states to ends.

    No move makes that less.
    """
    starts = np.searchsorted(graph.source, np.arange(graph.states + 1)).tolist()
    targets, amounts = graph.target.tolist(), graph.amounts.tolist()
    ends, ahead, peaks = graph.ends.tolist(), to_go.tolist(), graph.peaks
    least = tuple(ahead[0])
    heap = [(least, 0, (0.0,) * len(peaks), 0, -1)]
    kept: list[list[_Values]] = [[] for _ in ends]
    popped: list[tuple[int, int]] = []  # state, and which label it continues
    best, last = (np.inf,) * len(peaks), -1
    while heap:
        if len(popped) % 1000 == 0 and watch.over:
            return Choice(_path(popped, last), heap[0][0][:1], stopped=True)
        least, _, taken, state, before = heappop(heap)
        if not _improves(least, best) or _is_dominated(least, kept[state]):
            continue
        kept[state].append(least)
        popped.append((state, before))
        if ends[state]:
            best, last = taken, len(popped) - 1
        for move in range(starts[state], starts[state + 1]):
            to, more = targets[move], _and(peaks, taken, amounts[move])
            bound = _and(peaks, more, ahead[to])
            if _improves(bound, best) and not _is_dominated(bound, kept[to]):
                heappush(heap, (bound, move, more, to, len(popped) - 1))
    return Choice(_path(popped, last), best)


def _and(peaks: Sequence[bool], first: Sequence[float], then: Sequence[float]) -> _Values:
    """Return the values of goals of two parts of a path joined."""
    pairs = zip(peaks, first, then, strict=True)
    return tuple([max(a, b) if peak else a + b for peak, a, b in pairs])


def _improves(bound: _Values, best: _Values) -> bool:
    """Return whether values are below the best in a goal, and not above it in those before."""
    for value, least in zip(bound, best, strict=True):
        if tied(value) < least:
            return True
        if value > tied(least):
            return False
    return False


def _is_dominated(bound: _Values, others: list[_Values]) -> bool:
    """Return whether one of others dominates values."""
    return any(all(map(le, other, bound)) for other in others)


def _left(graph: Graph) -> Floats:
    """Return lower bounds (n, g) of goals from states to ends; infinite where none is reached."""
    left = np.where(graph.ends[:, None], 0.0, np.inf) * np.ones(len(graph.peaks))
    states, firsts = np.unique(graph.source, return_index=True)
    while True:
        ahead = left[graph.target]
        through = np.where(graph.peaks, np.maximum(graph.amounts, ahead), graph.amounts + ahead)
        least = np.minimum.reduceat(through, firsts)
        if not (least < left[states]).any():
            return left
        left[states] = np.minimum(left[states], least)


PATH_LABELS = on_graph(
    "path_labels",
    "labels with a vector of all goals",
    lambda graph, watch: _best_label(graph, np.zeros((graph.states, len(graph.peaks))), watch),
)
BEST_FIRST = on_graph(
    "best_first",
    "most promising path first, with what is left known",
    lambda graph, watch: _best_label(graph, _left(graph), watch),
)
