r"""The full overlap formulation as a unit flow of least cost: a linear or an integer program.

.. math::

   \min_{y} \; & \sum_k \sum_{i,j} \left[ d_k(i, j) + c_k(j) \right] y_k(i, j) \\
   \text{s.t.} \; & \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \\
   & \sum_k \sum_{i,j} a_k(i, j)\, y_k(i, j) \le b \quad \text{for every budget,} \\
   & y \ge 0 \quad \text{or} \quad y \in \{0, 1\} .

``overlap_lp`` (cvxpy, Clarabel) takes :math:`y \ge 0`. Without budgets the matrix is totally
unimodular and an optimal vertex is a choice. An interior-point answer is a mixture where costs tie:
the choice follows the largest flow, every arc of which lies on an optimal path. The duals of the
budgets are reported as prices: what one more unit of each would save. With budgets the value is a
bound and the choice, if it is within them, need not be the best.

``overlap_mip`` (cvxpy, HiGHS) takes :math:`y \in \{0, 1\}`: exact, with budgets. It earns its price
where these couple all moves: a cap on robot travel, on how often a robot is used, on the count of
steps over a level (`seqopt.graph.layers.layers`). Without them dynamic programming gives the same
answer hundreds of times faster.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np

from formulations.layers.priced_paths import LayeredFlow, layered_flow, stopped
from formulations.solvers import minimize
from formulations.whole_program import WholeProgram, integer_program
from seqopt.graph.formulation import Formulation, FormulationKind, Watch
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim


def _written(flow: LayeredFlow, arcs: cp.Variable) -> tuple[cp.Problem, list[cp.Constraint]]:
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    caps = [cp.NonNeg(cap - a @ arcs) for cap, a in zip(flow.caps, flow.amounts, strict=True)]
    return cp.Problem(cp.Minimize(flow.cost @ arcs), [conserve, *caps]), caps


def _whole(problem: PlacementProblem) -> WholeProgram:
    flow = layered_flow(problem)
    arcs = cp.Variable(len(flow.cost), boolean=True)
    return WholeProgram(_written(flow, arcs)[0], arcs, flow.choice, flow.bound, flow.feasible)


def _relaxed(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return the choice that the largest flow follows, with a bound and the price of every budget.

    Raises `InfeasibleError` if no choice is allowed, or no flow is within all budgets;
    `SolverError` if the solver ends without an optimum, or stops and no choice is at hand.
    """
    flow = layered_flow(problem)
    arcs = cp.Variable(len(flow.cost), nonneg=True)
    program, caps = _written(flow, arcs)
    optimum = minimize(program, feasible=flow.feasible, time_limit=(watch or Watch()).left)
    if optimum.stopped:
        return stopped(problem)
    choice = flow.choice(np.asarray(arcs.value))
    prices = flow.prices([float(cap.dual_value) for cap in caps])
    objective, bound = problem.sums.cost(choice), flow.bound(optimum.value)
    return Selection(choice, objective, bound, prices, optimum.compile_seconds)


OVERLAP_LP = Formulation(
    "overlap_lp",
    "full overlap, linear program",
    FormulationKind.BOUND,
    Aim.SUM,
    _relaxed,
    takes_budgets=True,
)
OVERLAP_MIP = integer_program(
    "overlap_mip", "full overlap, integer program with budgets", Aim.SUM, _whole, takes_budgets=True
)
