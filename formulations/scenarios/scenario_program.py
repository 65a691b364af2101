r"""Totals over scenarios as one mixed-integer program (cvxpy, HiGHS): a reference, for comparison.

.. math::

   \min_{y \in \{0, 1\}, \, t, \, u \ge 0} \; & t + \bar w \sum_s u_s \\
   \text{s.t.} \; & \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \\
   & u_s \ge \sum_k \sum_{i,j} c_{sk}(i, j) \, y_k(i, j) - t \quad \text{for every scenario,}

with the costs :math:`c_s` of pairs in every scenario and the largest weight :math:`\bar w` of one:
1 for the worst total, :math:`1 / ((1 - \alpha) S)` for the mean total of the worst
:math:`1 - \alpha` of :math:`S` scenarios (Rockafellar and Uryasev). Without the integers its value
is that which weights of scenarios prove (`formulations.scenarios.scenario_weights`), tens to
hundreds of times faster by dynamic programs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from formulations.solvers import minimize, minimize_whole
from seqopt.graph.layers.costs import TINY, Budget, LayeredCosts
from seqopt.graph.layers.interface import CostProblem
from seqopt.plan.calling.formulation import Watch
from seqopt.plan.calling.priced_paths import LayeredFlow, layered_flow


@dataclass(frozen=True)
class Reference:
    """What the program says.

    ``value``: of the program, in the unit of the costs; ``bound``: on it, as the solver says;
    ``choice``: the choice that the largest part of the flow takes.
    """

    value: float
    bound: float
    choice: tuple[int, ...]


def solve_program(
    layers: Sequence[LayeredCosts], most: float, *, whole: bool, watch: Watch | None = None
) -> Reference:
    """Return the least worst or tail total over scenarios, or a bound on it.

    ``layers``: of every scenario, for the same moves; ``most``: the largest weight of a scenario: 1
    for the worst total; ``whole``: whether choices are whole; if not, the value is a bound;
    ``watch``: says when to stop. Raises `InfeasibleError` if no choice is allowed in all scenarios;
    `SolverError` if the solver ends without an optimum.
    """
    flow = _flow(layers)
    scale = max(float(np.abs(np.array(flow.amounts) * np.array(flow.units)[:, None]).max()), TINY)
    arcs = cp.Variable(len(flow.cost), boolean=whole, nonneg=None if whole else True)
    total, over = cp.Variable(), cp.Variable(len(layers), nonneg=True)
    costs = np.array(flow.amounts) * (np.array(flow.units) / scale)[:, None]
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    above = cp.NonNeg(over + total - costs @ arcs)
    program = cp.Problem(
        cp.Minimize(total + (most * np.ones(len(layers))) @ over), [conserve, above]
    )
    watch = watch or Watch()
    optimum = (
        minimize_whole(program, feasible=True, watch=watch)
        if whole
        else minimize(program, feasible=True, time_limit=watch.left)
    )
    if not np.isfinite(optimum.value):
        return Reference(np.inf, optimum.bound * scale, ())
    return Reference(
        optimum.value * scale, optimum.bound * scale, flow.choice(np.asarray(arcs.value))
    )


def _flow(layers: Sequence[LayeredCosts]) -> LayeredFlow:
    """Return the flow of choices that are allowed in all scenarios, totals as its amounts."""
    moves = range(len(layers[0].single))
    shut = LayeredCosts(
        tuple(np.where(_open([e.single[k] for e in layers]), 0.0, np.inf) for k in moves),
        tuple(np.where(_open([e.shared[k] for e in layers]), 0.0, np.inf) for k in moves),
    )
    budgets = tuple(
        Budget(
            f"scenario {i}",
            tuple(np.where(np.isfinite(shut.single[k]), each.single[k], 0.0) for k in moves),
            tuple(np.where(np.isfinite(shut.shared[k]), each.shared[k], 0.0) for k in moves),
            np.inf,
        )
        for i, each in enumerate(layers, start=1)
    )
    return layered_flow(CostProblem(shut, budgets))


def _open(costs: Sequence[np.ndarray]) -> np.ndarray:
    return np.asarray(np.isfinite(costs).all(axis=0))
