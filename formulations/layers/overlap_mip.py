r"""The full overlap formulation as a mixed-integer program (cvxpy, HiGHS): exact, with budgets.

.. math::

   \min_{y \in \{0, 1\}} \; & \sum_k \sum_{i,j} \left[ d_k(i, j) + c_k(j) \right] y_k(i, j) \\
   \text{s.t.} \; & \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \\
   & \sum_k \sum_{i,j} a_k(i, j)\, y_k(i, j) \le b \quad \text{for every budget.}

It earns its price where budgets couple all moves: a cap on robot travel, on how often a robot is
used, on the count of steps over a level (`seqopt.graph.layers.layers`). Without them dynamic
programming gives the same answer hundreds of times faster.
"""

from __future__ import annotations

import cvxpy as cp

from formulations.whole_program import WholeProgram, solve_whole
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.calling.formulation import Formulation, FormulationKind, Selection, Watch
from seqopt.plan.calling.priced_paths import layered_flow
from seqopt.problem.problem import Aim


def write(problem: PlacementProblem) -> WholeProgram:
    """Return the program of a problem.

    ``problem``: its sums and budgets are used. Raises `InfeasibleError` if no choice is allowed, or
    none is within one of the budgets.
    """
    flow = layered_flow(problem)
    arcs = cp.Variable(len(flow.cost), boolean=True)
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    caps = [
        cp.NonNeg(cap - amount @ arcs) for cap, amount in zip(flow.caps, flow.amounts, strict=True)
    ]
    program = cp.Problem(cp.Minimize(flow.cost @ arcs), [conserve, *caps])
    return WholeProgram(program, arcs, flow.choice, flow.bound, flow.feasible)


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return the exact optimum within the budgets.

    ``problem``: its sums and budgets are used; ``watch``: says when to stop, and is told what is
    found. Result: with a bound. Raises `InfeasibleError` if no choice is allowed, or none is within
    all budgets; `SolverError` if the solver ends without an optimum, or stops and no choice is at
    hand.
    """
    return solve_whole(problem, write(problem), Aim.SUM, watch)


FORMULATION = Formulation(
    "overlap_mip",
    "full overlap, integer program with budgets",
    FormulationKind.EXACT,
    Aim.SUM,
    solve,
    takes_budgets=True,
)
