r"""A build as a unit flow through the graph of its states, one goal after the other: exact.

With moves :math:`a = (u, v)` that take :math:`c_a`, for a goal that is a sum,

.. math::

   \min_y \; \sum_a c_a y_a
   \quad\text{s.t.}\quad
   \sum_{a \text{ from } s} y_a - \sum_{a \text{ to } s} y_a =
   \begin{cases} 1 & s \text{ the start} \\ 0 & \text{else, but at ends} \end{cases}
   \quad\text{and}\quad
   y \ge 0 \;\text{ or }\; y \in \{0, 1\} ,

the flow of `formulations.overlap_flow`, solved by HiGHS. ``flow_lp`` takes :math:`y \ge 0`. The
matrix is totally unimodular: the optimum is a path. With the multipliers :math:`\pi_s` of its rows,
0 at ends, paths of moves with :math:`c_a = \pi_u - \pi_v` are the best ones, and only these are
left for the next goal. The largest amount on a path is no linear function of :math:`y`. Of a peak
therefore the least :math:`t` is found by bisection for which

.. math::

   y \ge 0, \qquad \text{the rows above}, \qquad y_a = 0 \; \text{ where } \; c_a > t

has a solution.

``flow_mip`` takes :math:`y \in \{0, 1\}`, and for a peak

.. math::

   \min_{t, \, y \in \{0, 1\}} \; t \quad\text{s.t.}\quad \text{the rows above}, \qquad
   t \ge \sum_{a \text{ to } s} c_a y_a \; \text{ for every state } s .

After a sum of value :math:`z` the row :math:`\sum_a c_a y_a \le z` stays, after a peak moves that
take more are left out. The epigraph says little where :math:`y` may be fractions, since a flow that
spreads over many states has a small peak. It is here to show that.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.choice import Choice
from formulations.on_graph import on_graph
from formulations.overlap_flow import Flow, unit_flow
from formulations.solvers import EXACTLY, minimize_by_highs
from seqopt.arrays import Floats
from seqopt.errors import InfeasibleError
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph
from seqopt.graph.paths import TIED, fewest_moves, path_values, tied


def _linear(graph: Graph, watch: Watch) -> Choice:
    """Return the best path; where time is over, one that is best in the first goals."""
    if graph.ends[0]:
        return Choice((), (0.0,) * len(graph.peaks))
    graph, bounds = graph.only(~graph.ends[graph.source]), list[float]()
    for goal, peak in enumerate(graph.peaks):
        graph, bound, stopped = (_least_peak if peak else _least_sum)(graph, goal, watch)
        bounds.append(bound)
        if stopped:
            return Choice(fewest_moves(graph), tuple(bounds), stopped=True)
    return Choice(fewest_moves(graph), tuple(bounds))


def _least_sum(graph: Graph, goal: int, watch: Watch) -> tuple[Graph, float, bool]:
    """Return the moves on paths of least sum, that sum, and whether time was over before."""
    flow = unit_flow(graph, graph.amounts[:, goal])
    arcs = cp.Variable(len(flow.cost), nonneg=True)
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    program = cp.Problem(cp.Minimize(flow.cost @ arcs), [conserve])
    found = minimize_by_highs(program, feasible=True, watch=watch, tolerance=EXACTLY)
    if found.stopped:
        return graph, -np.inf, True
    reduced = flow.cost + flow.balance.T @ np.asarray(conserve.dual_value)
    return flow.graph.only(reduced <= TIED * max(found.value, 1.0)), flow.scale * found.value, False


def _least_peak(graph: Graph, goal: int, watch: Watch) -> tuple[Graph, float, bool]:
    """Return the moves within the least peak, that peak, and whether time was over before."""
    amounts = graph.amounts[:, goal]
    levels = np.unique(amounts)
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        flow = unit_flow(graph.only(amounts <= levels[middle]))
        arcs = cp.Variable(len(flow.cost), nonneg=True)
        program = cp.Problem(cp.Minimize(0), [cp.Zero(flow.balance @ arcs - flow.source)])
        try:
            found = minimize_by_highs(program, feasible=False, watch=watch, tolerance=EXACTLY)
        except InfeasibleError:
            low = middle + 1
            continue
        if found.stopped:
            return graph.only(amounts <= levels[high]), float(levels[low]), True
        high = middle
    return graph.only(amounts <= tied(levels[high])), float(levels[high]), False


def _whole(graph: Graph, watch: Watch) -> Choice:
    """Return the best path; where time is over, the best one so far."""
    if graph.ends[0]:
        return Choice((), (0.0,) * len(graph.peaks))
    path, bounds = fewest_moves(graph), list[float]()
    caps: list[tuple[int, float]] = []
    for goal, peak in enumerate(graph.peaks):
        flow = unit_flow(graph, graph.amounts[:, goal])
        graph, arcs = flow.graph, cp.Variable(len(flow.cost), boolean=True)
        program = _written(flow, arcs, caps, peak=peak)
        found = minimize_by_highs(program, feasible=True, watch=watch, tolerance=EXACTLY)
        bounds.append(flow.scale * found.bound)
        if np.isfinite(found.value):
            path = fewest_moves(graph.only(np.asarray(arcs.value) > 0.5))
        if found.stopped:
            return Choice(path, tuple(bounds), stopped=True)
        most = tied(path_values(graph, path)[goal])
        if peak:
            graph = graph.only(graph.amounts[:, goal] <= most)
        else:
            caps.append((goal, most))
    return Choice(path, tuple(bounds))


def _written(
    flow: Flow, arcs: cp.Variable, caps: list[tuple[int, float]], *, peak: bool
) -> cp.Problem:
    """Return the program of a goal, its costs those of the flow, and of sums that are capped."""
    rules: list[cp.Constraint] = [cp.Zero(flow.balance @ arcs - flow.source)]
    for column, most in caps:
        amounts: Floats = flow.graph.amounts[:, column]
        size = max(most, float(amounts.max())) or 1.0
        rules.append(cp.NonNeg(most / size - amounts / size @ arcs))
    if not peak:
        return cp.Problem(cp.Minimize(flow.cost @ arcs), rules)
    shape = (flow.graph.states, len(flow.cost))
    rows = (flow.graph.target, np.arange(len(flow.cost)))
    largest, entered = cp.Variable(nonneg=True), sparse.csr_array((flow.cost, rows), shape=shape)
    return cp.Problem(cp.Minimize(largest), [*rules, cp.NonNeg(largest - entered @ arcs)])


FLOW_LP = on_graph("flow_lp", "a unit flow of states, linear programs", _linear)
FLOW_MIP = on_graph("flow_mip", "a whole unit flow of states, integer programs", _whole)
