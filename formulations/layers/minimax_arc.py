r"""The smallest worst cost as an integer program, an epigraph per arc: an exhibit.

.. math::

   \min_{t, \, y} \; & t \\
   \text{s.t.} \; & t \ge p_k(i, j)\, y_k(i, j) \quad \text{for every pair of every move}, \\
   & \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \qquad
   y_k(i, j) \in \{0, 1\},

with the worst cost :math:`p_k(i, j) = \max \{ c_k(j), d_k(i, j) \}` of a pair. It is right for
whole :math:`y`, and says less than ``minimax_layer`` where :math:`y` may be fractions: a unit that
spreads over :math:`n` pairs of a move costs an :math:`n`-th of one.
"""

from __future__ import annotations

import cvxpy as cp
from scipy import sparse

from formulations.whole_program import WholeProgram, flow_of_peaks, solve_whole
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.calling.formulation import Formulation, FormulationKind, Selection, Watch
from seqopt.problem.problem import Aim


def write(problem: PlacementProblem) -> WholeProgram:
    """Return the program of a problem.

    ``problem``: its peaks are used. Raises `InfeasibleError` if no choice is allowed.
    """
    flow, bound = flow_of_peaks(problem)
    arcs = cp.Variable(len(flow.cost), boolean=True)
    peak = cp.Variable(nonneg=True)
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    above = cp.NonNeg(peak - sparse.diags_array(flow.cost) @ arcs)
    program = cp.Problem(cp.Minimize(peak), [conserve, above])
    return WholeProgram(program, arcs, flow.choice, bound)


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return a choice whose worst cost is least.

    ``problem``: its peaks are used; ``watch``: says when to stop, and is told what is found.
    Result: with a bound. Raises `InfeasibleError` if no choice is allowed; `SolverError` if the
    solver ends without an optimum.
    """
    return solve_whole(problem, write(problem), Aim.PEAK, watch)


FORMULATION = Formulation(
    "minimax_arc", "worst cost, epigraph per arc", FormulationKind.EXACT, Aim.PEAK, solve
)
