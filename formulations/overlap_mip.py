r"""The full overlap formulation as a mixed-integer program (cvxpy, HiGHS): exact, with budgets.

.. math::

   \min_{y \in \{0, 1\}} \; & \sum_k \sum_{i,j} \left[ d_k(i, j) + c_k(j) \right] y_k(i, j) \\
   \text{s.t.} \; & \sum_j y_1(0, j) = 1, \qquad \sum_i y_k(i, j) = \sum_l y_{k+1}(j, l), \\
   & \sum_k \sum_{i,j} a_k(i, j)\, y_k(i, j) \le b \quad \text{for every budget.}

It earns its price where budgets couple all moves: a cap on robot travel, on how often a robot is
used, on the count of steps over a level (`seqopt.placement.budgets`). Without them dynamic
programming gives the same answer hundreds of times faster.
"""

from __future__ import annotations

from dataclasses import dataclass

import cvxpy as cp
import numpy as np

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
    arcs : cvxpy.Variable
        Of every allowed pair.
    flow : LayeredFlow
        The arcs and their scale.
    """

    program: cp.Problem
    arcs: cp.Variable
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
        Its sums and budgets are used.

    Returns
    -------
    Written

    Raises
    ------
    InfeasibleError
        If no choice is allowed, or none is within one of the budgets.
    """
    flow = layered_flow(problem)
    arcs = cp.Variable(len(flow.cost), boolean=True)
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    caps = [
        cp.NonNeg(cap - amount @ arcs) for cap, amount in zip(flow.caps, flow.amounts, strict=True)
    ]
    return Written(cp.Problem(cp.Minimize(flow.cost @ arcs), [conserve, *caps]), arcs, flow)


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return the exact optimum within the budgets.

    Parameters
    ----------
    problem : PlacementProblem
        Its sums and budgets are used.
    watch : Watch, optional
        Says when to stop, and is told what is found.

    Returns
    -------
    Selection
        With a bound.

    Raises
    ------
    InfeasibleError
        If no choice is allowed, or none is within all budgets.
    SolverError
        If the solver ends without an optimum, or stops and no choice is at hand.
    """
    watch = watch or Watch()
    written = write(problem)
    flow = written.flow
    optimum = minimize_whole(
        written.program, feasible=flow.feasible, watch=watch, told=written.bound
    )
    if not np.isfinite(optimum.value):
        return stopped(problem, bound=written.bound(optimum.bound))
    choice = flow.choice(np.asarray(written.arcs.value))
    bound = written.bound(optimum.bound if optimum.stopped else optimum.value)
    end = End.STOPPED if optimum.stopped else End.DONE
    return Selection(choice, problem.sums.cost(choice), bound, {}, optimum.compile_seconds, end)


FORMULATION = Formulation(
    "overlap_mip",
    "full overlap, integer program with budgets",
    FormulationKind.EXACT,
    Aim.SUM,
    solve,
    takes_budgets=True,
)
