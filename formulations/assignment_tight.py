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

from dataclasses import dataclass

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.solvers import minimize_whole
from seqopt.placement.first_choice import stopped
from seqopt.placement.flow import LayeredFlow, layered_flow
from seqopt.placement.formulation import End, Formulation, FormulationKind, Selection
from seqopt.placement.interface import Aim, PlacementProblem
from seqopt.placement.watch import Watch


@dataclass(frozen=True, eq=False)
class Written:
    """The program, written down.

    Attributes
    ----------
    program : cvxpy.Problem
        Costs are scaled.
    picks : cvxpy.Variable
        Of every candidate of every move, one after the other.
    flow : LayeredFlow
        The arcs and their scale.
    """

    program: cp.Problem
    picks: cp.Variable
    flow: LayeredFlow

    def bound(self, value: float) -> float:
        """Return a lower bound in the unit of the costs, lower by what the solver may be off.

        Parameters
        ----------
        value : float
            Of the scaled program.

        Returns
        -------
        float
        """
        return self.flow.bound(value)


def write(problem: PlacementProblem) -> Written:
    """Return the program of a problem.

    Parameters
    ----------
    problem : PlacementProblem
        Its sums are used.

    Returns
    -------
    Written

    Raises
    ------
    InfeasibleError
        If no choice is allowed.
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
    rules = [
        cp.Zero(one_each @ picks - np.ones(len(sizes))),
        cp.Zero(into @ pairs - picks),
    ]
    if continued:
        rules.append(cp.Zero(out[:continued] @ pairs - picks[:continued]))
    return Written(cp.Problem(cp.Minimize(flow.cost @ pairs), rules), picks, flow)


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return the exact optimum.

    Parameters
    ----------
    problem : PlacementProblem
        Its sums are used.
    watch : Watch, optional
        Says when to stop, and is told what is found.

    Returns
    -------
    Selection
        With a bound.

    Raises
    ------
    InfeasibleError
        If no choice is allowed.
    SolverError
        If the solver ends without an optimum.
    """
    watch = watch or Watch()
    written = write(problem)
    optimum = minimize_whole(written.program, feasible=True, watch=watch, told=written.bound)
    if not np.isfinite(optimum.value):
        return stopped(problem, bound=written.bound(optimum.bound))
    ends = np.cumsum(problem.sums.sizes)[:-1]
    choice = tuple(int(np.argmax(part)) for part in np.split(np.asarray(written.picks.value), ends))
    bound = written.bound(optimum.bound if optimum.stopped else optimum.value)
    end = End.STOPPED if optimum.stopped else End.DONE
    return Selection(choice, problem.sums.cost(choice), bound, {}, optimum.compile_seconds, end)


FORMULATION = Formulation(
    "assignment_tight", "assignment, tight links", FormulationKind.EXACT, Aim.SUM, solve
)
