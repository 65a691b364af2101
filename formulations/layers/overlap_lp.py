r"""The full overlap formulation as a linear program: a unit flow of least cost (cvxpy, Clarabel).

.. math::

   \min_{y \ge 0} \; & \sum_k \sum_{i,j} \left[ d_k(i, j) + c_k(j) \right] y_k(i, j) \\
   \text{s.t.} \; & \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \\
   & \sum_k \sum_{i,j} a_k(i, j)\, y_k(i, j) \le b \quad \text{for every budget.}

Without budgets the matrix is totally unimodular and an optimal vertex is a choice. An
interior-point answer is a mixture where costs tie: the choice follows the largest flow, every arc
of which lies on an optimal path. The duals of the budgets are reported as prices: what one more
unit of each would save. With budgets the value is a bound and the choice, if it is within them,
need not be the best: use ``overlap_mip``.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np

from formulations.solvers import minimize
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.calling.formulation import Formulation, FormulationKind, Selection, Watch
from seqopt.plan.calling.priced_paths import layered_flow, stopped
from seqopt.problem.problem import Aim


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return the choice that the largest flow follows.

    ``problem``: its sums and budgets are used; ``watch``: says when to stop, and is told what is
    found. Result: with a bound, and the price of every budget. Raises `InfeasibleError` if no
    choice is allowed, or no flow is within all budgets; `SolverError` if the solver ends without an
    optimum, or stops and no choice is at hand.
    """
    watch = watch or Watch()
    flow = layered_flow(problem)
    arcs = cp.Variable(len(flow.cost), nonneg=True)
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    caps = [
        cp.NonNeg(cap - amount @ arcs) for cap, amount in zip(flow.caps, flow.amounts, strict=True)
    ]
    program = cp.Problem(cp.Minimize(flow.cost @ arcs), [conserve, *caps])
    optimum = minimize(program, feasible=flow.feasible, time_limit=watch.left)
    if optimum.stopped:
        return stopped(problem)
    choice = flow.choice(np.asarray(arcs.value))
    prices = flow.prices([float(cap.dual_value) for cap in caps])
    objective = problem.sums.cost(choice)
    bound = flow.bound(optimum.value)
    return Selection(choice, objective, bound, prices, optimum.compile_seconds)


FORMULATION = Formulation(
    "overlap_lp",
    "full overlap, linear program",
    FormulationKind.BOUND,
    Aim.SUM,
    solve,
    takes_budgets=True,
)
