r"""A build as a unit flow through the graph of its states, by linear programs: exact.

With moves :math:`a = (u, v)` that take :math:`c_a`, for a goal that is a sum,

.. math::

   \min_{y \ge 0} \; \sum_a c_a y_a
   \quad\text{s.t.}\quad
   \sum_{a \text{ from } s} y_a - \sum_{a \text{ to } s} y_a =
   \begin{cases} 1 & s \text{ the start} \\ 0 & \text{else, but at ends} \end{cases}

whose matrix is totally unimodular: the optimum is a path. With the multipliers :math:`\pi_s` of its
rows, paths of moves with :math:`c_a = \pi_u - \pi_v` that end where :math:`\pi_s = 0` are the best
ones, and only these are left for the next goal. The largest amount on a path is no linear function
of :math:`y`: where an epigraph :math:`t \ge c_a y_a` bounds it, half a unit each on two paths costs
half. Of a peak therefore the least :math:`t` is found by bisection for which

.. math::

   y \ge 0, \qquad \text{the rows above}, \qquad y_a = 0 \; \text{ where } \; c_a > t

has a solution. Where it has none, the multipliers that prove this are a cut.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from formulations.solvers import STOPS, minimize_rows
from formulations.states.on_graph import Choice, on_graph, unit_flow, worth
from seqopt.graph.graph import Graph
from seqopt.graph.paths import TIED, fewest_moves, tied
from seqopt.plan.calling.formulation import Watch


def choose(graph: Graph, watch: Watch) -> Choice:
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
    rows, right = unit_flow(graph)
    scale = worth(graph, fewest_moves(graph))[goal] or 1.0
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
        rows, right = unit_flow(graph.only(amounts <= levels[middle]))
        end = minimize_rows(np.zeros(rows.shape[1]), rows, right, watch=watch).end
        if end in STOPS:
            return graph.only(amounts <= levels[high]), float(levels[low]), True
        low, high = (middle + 1, high) if end == "kInfeasible" else (low, middle)
    return graph.only(amounts <= tied(levels[high])), float(levels[high]), False


FORMULATION = on_graph("flow_lp", "a unit flow of states, linear programs", choose)
