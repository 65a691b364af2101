r"""A build as a whole unit flow through the graph of its states (HiGHS): exact.

With moves :math:`a = (u, v)` that take :math:`c_a`, for a goal that is a sum or a peak,

.. math::

   \min_{y \in \{0, 1\}} \; \sum_a c_a y_a
   \qquad\text{or}\qquad
   \min_{t, \, y \in \{0, 1\}} \; t \quad\text{s.t.}\quad
   t \ge \sum_{a \text{ to } s} c_a y_a \; \text{ for every state } s,

both with the rows of a flow from the start to an end,

.. math::

   \sum_{a \text{ from } s} y_a - \sum_{a \text{ to } s} y_a =
   \begin{cases} 1 & s \text{ the start} \\ 0 & \text{else, but at ends.} \end{cases}

Goals are solved one after the other: after a sum of value :math:`z` the row :math:`\sum_a c_a y_a
\le z` stays, after a peak moves that take more are left out. The epigraph says little where
:math:`y` may be fractions, since a flow that spreads over many states has a small peak. It is here
to show that; ``flow_lp`` finds the same by thresholds.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from formulations.solvers import STOPS, Point, minimize_rows
from formulations.states.on_graph import Choice, on_graph, unit_flow, worth
from seqopt.arrays import Floats
from seqopt.graph.graph import Graph
from seqopt.graph.paths import fewest_moves, tied
from seqopt.plan.calling.formulation import Watch


def choose(graph: Graph, watch: Watch) -> Choice:
    """Return the best path; where time is over, the best one so far."""
    path, bounds = fewest_moves(graph), list[float]()
    caps: list[tuple[Floats, float]] = []
    for goal, peak in enumerate(graph.peaks):
        scale = worth(graph, path)[goal] or 1.0
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
    (costs, peak), (flow, right) = goal, unit_flow(graph)
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


FORMULATION = on_graph("flow_mip", "a whole unit flow of states, integer programs", choose)
