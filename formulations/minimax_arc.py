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

from dataclasses import dataclass

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.solvers import minimize_whole
from seqopt.placement.costs import LayeredCosts
from seqopt.placement.first_choice import stopped
from seqopt.placement.flow import LayeredFlow, layered_flow
from seqopt.placement.formulation import End, Formulation, FormulationKind, Selection
from seqopt.placement.interface import Aim, CostProblem, PlacementProblem
from seqopt.placement.watch import Watch


@dataclass(frozen=True, eq=False)
class Written:
    """The program, written down.

    Attributes
    ----------
    program : cvxpy.Problem
        Costs are scaled, and less the least of all if that is negative.
    arcs : cvxpy.Variable
        Of every allowed pair.
    flow : LayeredFlow
        The arcs and their scale.
    least : float
        The least cost of any pair if negative, else zero.
    """

    program: cp.Problem
    arcs: cp.Variable
    flow: LayeredFlow
    least: float

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
        return self.least + self.flow.bound(value)


def write(problem: PlacementProblem) -> Written:
    """Return the program of a problem.

    Parameters
    ----------
    problem : PlacementProblem
        Its peaks are used.

    Returns
    -------
    Written

    Raises
    ------
    InfeasibleError
        If no choice is allowed.
    """
    costs = problem.peaks
    worst = [np.maximum(d, c) for d, c in zip(costs.shared, costs.single, strict=True)]
    least = min(0.0, *(float(part.min()) for part in worst))
    nothing = tuple(np.zeros(size) for size in costs.sizes)
    flow = layered_flow(CostProblem(LayeredCosts(nothing, tuple(p - least for p in worst))))
    arcs = cp.Variable(len(flow.cost), boolean=True)
    peak = cp.Variable(nonneg=True)
    conserve = cp.Zero(flow.balance @ arcs - flow.source)
    above = cp.NonNeg(peak - sparse.diags_array(flow.cost) @ arcs)
    return Written(cp.Problem(cp.Minimize(peak), [conserve, above]), arcs, flow, least)


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return a choice whose worst cost is least.

    Parameters
    ----------
    problem : PlacementProblem
        Its peaks are used.
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
        return stopped(problem, Aim.PEAK, written.bound(optimum.bound))
    choice = written.flow.choice(np.asarray(written.arcs.value))
    worth = problem.peaks.worst(choice)
    bound = written.bound(optimum.bound if optimum.stopped else optimum.value)
    end = End.STOPPED if optimum.stopped else End.DONE
    return Selection(choice, worth, bound, {}, optimum.compile_seconds, end)


FORMULATION = Formulation(
    "minimax_arc", "worst cost, epigraph per arc", FormulationKind.EXACT, Aim.PEAK, solve
)
