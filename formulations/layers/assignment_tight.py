r"""The full overlap formulation as an assignment with tight links: an exhibit.

.. math::

   \min_{x, y} \; & \sum_k \sum_{i,j} \left[ d_k(i, j) + c_k(j) \right] y_k(i, j) \\
   \text{s.t.} \; & \sum_i x_k(i) = 1, \qquad x_k(i) \in \{0, 1\}, \qquad y \ge 0, \\
   & \sum_i y_k(i, j) = x_k(j), \qquad \sum_j y_k(i, j) = x_{k-1}(i) .

A candidate of each move is assigned by :math:`x`; the product of two assignments is a variable
:math:`y` of its own, and its row and column sums are the assignments. These links are the tightest
there are: the bound of the relaxation is that of the flow. The flow (``overlap_mip``) needs no
:math:`x`, which follows from :math:`y`, and so is the smaller program.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.whole_program import WholeProgram, largest_of_each, solve_whole
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.calling.formulation import Formulation, FormulationKind, Selection, Watch
from seqopt.plan.calling.priced_paths import layered_flow
from seqopt.problem.problem import Aim


def write(problem: PlacementProblem) -> WholeProgram:
    """Return the program of a problem.

    ``problem``: its sums are used. Raises `InfeasibleError` if no choice is allowed.
    """
    flow = layered_flow(problem)
    sizes = problem.sums.sizes
    starts = np.cumsum([0, *sizes])
    first, second = [], []  # the candidates that every pair links, -1 at the source
    for k, mask in enumerate(flow.allowed):
        before, now = np.nonzero(mask)
        first.append(starts[k - 1] + before if k else np.full(len(now), -1))
        second.append(starts[k] + now)
    tail, head = np.concatenate(first), np.concatenate(second)
    pairs = cp.Variable(len(tail), nonneg=True)
    picks = cp.Variable(starts[-1], boolean=True)
    moves = np.repeat(np.arange(len(sizes)), sizes)
    one_each = sparse.csr_array((np.ones(len(moves)), (moves, np.arange(len(moves)))))
    inner = tail >= 0
    shape = (int(starts[-1]), len(tail))
    out = sparse.csr_array((np.ones(inner.sum()), (tail[inner], np.flatnonzero(inner))), shape)
    into = sparse.csr_array((np.ones(len(head)), (head, np.arange(len(head)))), shape)
    continued = int(starts[-2])
    rules = [cp.Zero(one_each @ picks - np.ones(len(sizes))), cp.Zero(into @ pairs - picks)]
    if continued:
        rules.append(cp.Zero(out[:continued] @ pairs - picks[:continued]))
    program = cp.Problem(cp.Minimize(flow.cost @ pairs), rules)
    return WholeProgram(program, picks, largest_of_each(sizes), flow.bound)


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return the exact optimum.

    ``problem``: its sums are used; ``watch``: says when to stop, and is told what is found. Result:
    with a bound. Raises `InfeasibleError` if no choice is allowed; `SolverError` if the solver ends
    without an optimum.
    """
    return solve_whole(problem, write(problem), Aim.SUM, watch)


FORMULATION = Formulation(
    "assignment_tight", "assignment, tight links", FormulationKind.EXACT, Aim.SUM, solve
)
