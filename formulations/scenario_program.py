r"""Totals over scenarios as one mixed-integer program (cvxpy, HiGHS): a reference, for comparison.

.. math::

   \min_{y \in \{0, 1\}, \, t, \, u \ge 0} \; & t + \bar w \sum_s u_s \\
   \text{s.t.} \; & y \text{ is a unit flow from the start to an end}, \\
   & u_s \ge \sum_a c_{sa} \, y_a - t \quad \text{for every scenario,}

with the costs :math:`c_s` of moves in every scenario and the largest weight :math:`\bar w` of one:
1 for the worst total, :math:`1 / ((1 - \alpha) S)` for the mean total of the worst
:math:`1 - \alpha` of :math:`S` scenarios (Rockafellar and Uryasev). Without the integers its value
is that which weights of scenarios prove (`formulations.on_graph`), tens to hundreds of times
faster by dynamic programs.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np

from formulations.flow import conserved, unit_flow
from formulations.on_graph import Choice
from formulations.solvers import minimize_by_highs
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph


def solve_program(
    graph: Graph, most: float, *, whole: bool, watch: Watch | None = None
) -> tuple[Choice, float]:
    """Return the path of the largest flow with a bound, and the value of the program.

    ``graph``: with a sum for every scenario; ``most``: the largest weight of a scenario: 1 for the
    worst total; ``whole``: whether moves are whole; if not, the value is a bound; ``watch``: says
    when to stop. A `SolverError` says that the solver ended without an optimum.
    """
    flow, watch = unit_flow(graph), watch or Watch()
    scale = max(float(np.abs(flow.graph.amounts).max()), float(np.finfo(float).tiny))
    arcs = cp.Variable(len(flow.cost), boolean=whole, nonneg=None if whole else True)
    total, over = cp.Variable(), cp.Variable(len(graph.peaks), nonneg=True)
    above = cp.NonNeg(over + total - flow.graph.amounts.T / scale @ arcs)
    least = cp.Minimize(total + (most * np.ones(len(graph.peaks))) @ over)
    program = cp.Problem(least, [conserved(flow, arcs), above])
    optimum = minimize_by_highs(program, feasible=True, watch=watch)
    path = flow.path(np.asarray(arcs.value)) if np.isfinite(optimum.value) else ()
    return Choice(path, (optimum.bound * scale,), optimum.stopped), optimum.value * scale
