r"""The full overlap formulation as a mixed-integer program (cvxpy, HiGHS): exact, with budgets.

.. math::

   \min_{y \in \{0, 1\}} \; & \sum_k \sum_{i,j} \left[ d_k(i, j) + c_k(j) \right] y_k(i, j) \\
   \text{s.t.} \; & \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \\
   & \sum_k \sum_{i,j} a_k(i, j)\, y_k(i, j) \le b \quad \text{for every budget.}

It earns its price where budgets couple all moves: a cap on robot travel, on how often a robot is
used, on the count of steps over a level (`seqopt.placement.budgets`). Without them dynamic programming gives
the same answer hundreds of times faster.
"""

from __future__ import annotations

from formulations.solvers import Program, follow, solve_flow
from seqopt.placement.costs import PlacementProblem
from seqopt.placement.formulation import Aim, Formulation, FormulationKind, Selection


def solve(problem: PlacementProblem) -> Selection:
    """Return the exact optimum within the budgets."""
    flow = solve_flow(problem, Program.INTEGER)
    choice = follow(flow.arcs)
    objective = problem.sums.cost(choice)
    return Selection(choice, objective, flow.bound, compile_seconds=flow.compile_seconds)


FORMULATION = Formulation(
    "overlap_mip",
    "full overlap, integer program with budgets",
    FormulationKind.EXACT,
    Aim.SUM,
    solve,
)
