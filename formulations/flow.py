r"""A build as a unit flow through the graph of its states, one goal after the other: exact.

With moves :math:`a = (u, v)` that take :math:`c_a`, for a goal that is a sum,

.. math::

   \min_y \; \sum_a c_a y_a
   \quad\text{s.t.}\quad
   \sum_{a \text{ from } s} y_a - \sum_{a \text{ to } s} y_a =
   \begin{cases} 1 & s \text{ the start} \\ 0 & \text{else, but at ends} \end{cases}
   \quad\text{and}\quad
   y \ge 0 \;\text{ or }\; y \in \{0, 1\} .

``flow_lp`` takes :math:`y \ge 0`. The matrix is totally unimodular: the optimum is a path. With the
multipliers :math:`\pi_s` of its rows, paths of moves with :math:`c_a = \pi_u - \pi_v` that end
where :math:`\pi_s = 0` are the best ones, and only these are left for the next goal. The largest
amount on a path is no linear function of :math:`y`. Of a peak therefore the least :math:`t` is
found by bisection for which

.. math::

   y \ge 0, \qquad \text{the rows above}, \qquad y_a = 0 \; \text{ where } \; c_a > t

has a solution. Where it has none, the multipliers that prove this are a cut.

``flow_mip`` takes :math:`y \in \{0, 1\}`, and for a peak

.. math::

   \min_{t, \, y \in \{0, 1\}} \; t \quad\text{s.t.}\quad \text{the rows above}, \qquad
   t \ge \sum_{a \text{ to } s} c_a y_a \; \text{ for every state } s .

After a sum of value :math:`z` the row :math:`\sum_a c_a y_a \le z` stays, after a peak moves that
take more are left out. The epigraph says little where :math:`y` may be fractions, since a flow that
spreads over many states has a small peak. It is here to show that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from formulations.choice import Choice
from formulations.on_graph import on_graph
from formulations.solvers import STOPS, Point, minimize_rows
from seqopt.arrays import Floats
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph
from seqopt.graph.paths import TIED, fewest_moves, path_values, tied


def _rows(graph: Graph) -> tuple[sparse.csc_array, Floats]:
    """Return what leaves states (n,) by a flow, and what does: one from the start, at an end.

    Results: ``matrix`` (n, m + e): by move, then by state in which a build may end; ``right`` (n,).
    """
    ends, moves = np.flatnonzero(graph.ends), np.arange(len(graph.source))
    ones = np.ones(len(moves) + len(ends))
    rows = np.concatenate([graph.source, ends, graph.target])
    columns = np.concatenate([np.arange(len(ones)), moves])
    values = np.concatenate([ones, -np.ones(len(moves))])
    matrix = sparse.csc_array((values, (rows, columns)), shape=(graph.states, len(ones)))
    return matrix, np.eye(1, graph.states)[0]


def _linear(graph: Graph, watch: Watch) -> Choice:
    """Return the best path; where time is over, one that is best in the first goals."""
    bounds = list[float]()
    for goal, peak in enumerate(graph.peaks):
        graph, bound, stopped = (_least_peak if peak else _least_sum)(graph, goal, watch)
        bounds.append(bound)
        if stopped:
            return Choice(fewest_moves(graph), tuple(bounds), stopped=True)
    return Choice(fewest_moves(graph), tuple(bounds))


def _least_sum(graph: Graph, goal: int, watch: Watch) -> tuple[Graph, float, bool]:
    """Return the moves on paths of least sum, that sum, and whether time was over before."""
    rows, right = _rows(graph)
    scale = path_values(graph, fewest_moves(graph))[goal] or 1.0
    costs = np.pad(graph.amounts[:, goal] / scale, (0, rows.shape[1] - len(graph.source)))
    found = minimize_rows(costs, rows, right, watch=watch)
    if found.end in STOPS:
        return graph, -np.inf, True
    best = costs - rows.T @ found.multipliers <= TIED
    moves, ends = np.split(best, [len(graph.source)])
    kept = graph.ends.copy()
    kept[graph.ends] = ends  # a build that ends elsewhere takes more
    return replace(graph.only(moves), ends=kept), scale * found.bound, False


def _least_peak(graph: Graph, goal: int, watch: Watch) -> tuple[Graph, float, bool]:
    """Return the moves that take no more than the least peak, that peak, and the same."""
    amounts = graph.amounts[:, goal]
    levels = np.unique(amounts)
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        rows, right = _rows(graph.only(amounts <= levels[middle]))
        end = minimize_rows(np.zeros(rows.shape[1]), rows, right, watch=watch).end
        if end in STOPS:
            return graph.only(amounts <= levels[high]), float(levels[low]), True
        low, high = (middle + 1, high) if end == "kInfeasible" else (low, middle)
    return graph.only(amounts <= tied(levels[high])), float(levels[high]), False


def _whole(graph: Graph, watch: Watch) -> Choice:
    """Return the best path; where time is over, the best one so far."""
    path, bounds = fewest_moves(graph), list[float]()
    caps: list[tuple[Floats, float]] = []
    for goal, peak in enumerate(graph.peaks):
        scale = path_values(graph, path)[goal] or 1.0
        costs = graph.amounts[:, goal] / scale
        found = _minimize(graph, (costs, peak), caps, watch)
        used = found.values[: len(costs)] > 0.5
        if len(used):
            path = fewest_moves(graph.only(used))
        bounds.append(scale * found.bound)
        if found.end in STOPS:
            return Choice(path, tuple(bounds), stopped=True)
        if peak:
            kept = costs <= tied(costs[used].max())
            graph, caps = graph.only(kept), [(each[kept], most) for each, most in caps]
        else:
            caps.append((costs, tied(costs[used].sum())))
    return Choice(path, tuple(bounds))


def _minimize(
    graph: Graph, goal: tuple[Floats, bool], caps: list[tuple[Floats, float]], watch: Watch
) -> Point:
    """Return the flow that is best in a goal: its costs (m,), and whether their peak counts."""
    (costs, peak), (flow, right) = goal, _rows(graph)
    ends, none = flow.shape[1] - len(costs), sparse.csc_array((graph.states, 1))
    rows = [sparse.hstack([flow, none])]
    rows += [sparse.csc_array(np.pad(each, (0, ends + 1))[None]) for each, _ in caps]
    below = [most for _, most in caps]
    if peak:
        into = (costs, (graph.target, np.arange(len(costs))))
        entered = sparse.csc_array(into, shape=(graph.states, flow.shape[1]))
        rows.append(sparse.hstack([entered, sparse.csc_array(-np.ones((graph.states, 1)))]))
        below += [0.0] * graph.states
    return minimize_rows(
        np.eye(1, flow.shape[1] + 1, flow.shape[1])[0] if peak else np.pad(costs, (0, ends + 1)),
        sparse.vstack(rows, format="csc"),
        np.concatenate([right, below]),
        watch=watch,
        whole=flow.shape[1],
        equations=graph.states,
    )


FLOW_LP = on_graph("flow_lp", "a unit flow of states, linear programs", _linear)
FLOW_MIP = on_graph("flow_mip", "a whole unit flow of states, integer programs", _whole)
