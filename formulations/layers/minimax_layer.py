r"""The smallest worst cost as an integer program, an epigraph per layer: an exhibit.

.. math::

   \min_{t, \, y} \; & t \\
   \text{s.t.} \; & t \ge \sum_{i,j} p_k(i, j)\, y_k(i, j) \quad \text{for every move } k, \\
   & \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \qquad
   y_k(i, j) \in \{0, 1\},

with the worst cost :math:`p_k(i, j) = \max \{ c_k(j), d_k(i, j) \}` of a pair. One pair of every
move is taken, so the sum over a layer of pairs is what that pair costs. A mixture of pairs costs
their mean, and the bound of the relaxation is close to the optimum. ``minimax`` finds it by dynamic
programming in a thousandth of the time.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np
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
    layer = np.repeat(np.arange(len(flow.allowed)), [int(mask.sum()) for mask in flow.allowed])
    of_layer = sparse.csr_array((flow.cost, (layer, np.arange(len(layer)))))
    above = cp.NonNeg(peak - of_layer @ arcs)
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
    "minimax_layer", "worst cost, epigraph per layer", FormulationKind.EXACT, Aim.PEAK, solve
)
