r"""Totals over scenarios as one mixed-integer program (cvxpy, HiGHS): a reference, for comparison.

.. math::

   \min_{y \in \{0, 1\}, \, t, \, u \ge 0} \; & t + \bar w \sum_s u_s \\
   \text{s.t.} \; & \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \\
   & u_s \ge \sum_k \sum_{i,j} c_{sk}(i, j) \, y_k(i, j) - t \quad \text{for every scenario,}

with the costs :math:`c_s` of pairs in every scenario and the largest weight :math:`\bar w` of one:
1 for the worst total, :math:`1 / ((1 - \alpha) S)` for the mean total of the worst
:math:`1 - \alpha` of :math:`S` scenarios (Rockafellar and Uryasev). Without the integers its value
is that which weights of scenarios prove (`formulations.scenarios.scenario_search`), tens to
hundreds of times faster by dynamic programs.
"""

from __future__ import annotations

from collections.abc import Sequence

import cvxpy as cp
import numpy as np

from formulations.layers.priced_paths import layered_flow
from formulations.solvers import minimize, minimize_whole
from seqopt.graph.formulation import Watch
from seqopt.graph.layers.costs import TINY, LayeredCosts
from seqopt.graph.layers.interface import CostProblem
from seqopt.graph.solution import Selection


def _solve_program(
    layers: Sequence[LayeredCosts], most: float, *, whole: bool, watch: Watch | None = None
) -> Selection:
    """Return the choice of the largest flow, with the value of the program and a bound on it.

    ``layers``: of every scenario, for the same moves; ``most``: the largest weight of a scenario: 1
    for the worst total; ``whole``: whether choices are whole; if not, the objective is a bound;
    ``watch``: says when to stop. Raises `InfeasibleError` if no choice is allowed in all scenarios;
    `SolverError` if the solver ends without an optimum.
    """
    every = [[d + c for d, c in zip(each.shared, each.single, strict=True)] for each in layers]
    allowed = tuple(np.sum(pairs, axis=0) for pairs in zip(*every, strict=True))
    free = tuple(np.zeros(size) for size in layers[0].sizes)
    flow = layered_flow(CostProblem(LayeredCosts(free, allowed)))
    costs = np.array(
        [np.concatenate([a[m] for a, m in zip(each, flow.allowed, strict=True)]) for each in every]
    )
    scale = max(float(np.abs(costs).max()), TINY)
    arcs = cp.Variable(len(flow.cost), boolean=whole, nonneg=None if whole else True)
    total, over = cp.Variable(), cp.Variable(len(layers), nonneg=True)
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    above = cp.NonNeg(over + total - costs / scale @ arcs)
    least = cp.Minimize(total + (most * np.ones(len(layers))) @ over)
    program, watch = cp.Problem(least, [conserve, above]), watch or Watch()
    if whole:
        optimum = minimize_whole(program, feasible=True, watch=watch)
    else:
        optimum = minimize(program, feasible=True, time_limit=watch.left)
    choice = flow.choice(np.asarray(arcs.value)) if np.isfinite(optimum.value) else ()
    return Selection(choice, optimum.value * scale, optimum.bound * scale)
