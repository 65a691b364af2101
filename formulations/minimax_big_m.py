r"""The smallest worst cost as an integer program with a large constant (big-M): an exhibit.

.. math::

   \min_{t, \, x} \; & t \\
   \text{s.t.} \; & t \ge p_k(i, j) - M \left( 2 - x_{k-1}(i) - x_k(j) \right)
   \quad \text{for every pair of every move}, \\
   & \sum_i x_k(i) = 1, \qquad x_k(i) \in \{0, 1\}, \qquad t \ge 0, \\
   & x_{k-1}(i) + x_k(j) \le 1 \quad \text{for every pair that is not allowed,}

with the worst cost :math:`p_k(i, j) = \max \{ c_k(j), d_k(i, j) \}` of a pair and :math:`M` the
largest of them. A row holds only where both candidates are taken; elsewhere
:math:`M` switches it off. With fractions of many candidates it switches off everything: the bound
of the relaxation is zero. The program has the fewest variables, and proves least.
"""

from __future__ import annotations

from dataclasses import dataclass

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.solvers import minimize_whole
from seqopt.arrays import Floats
from seqopt.placement.first_choice import stopped
from seqopt.placement.flow import ACCURACY
from seqopt.placement.formulation import End, Formulation, FormulationKind, Selection
from seqopt.placement.interface import Aim, PlacementProblem
from seqopt.placement.watch import Watch


@dataclass(frozen=True, eq=False)
class Written:
    """The program, written down.

    Attributes
    ----------
    program : cvxpy.Problem
        Costs are scaled, and less the least of all if that is negative.
    picks : cvxpy.Variable
        Of every candidate of every move, one after the other.
    scale : float
        By which costs are divided.
    least : float
        The least cost of any pair if negative, else zero.
    """

    program: cp.Problem
    picks: cp.Variable
    scale: float
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
        return self.least + self.scale * (value - ACCURACY * max(abs(value), 1.0))


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
    costs.continuable()
    worst = [np.maximum(d, c) for d, c in zip(costs.shared, costs.single, strict=True)]
    least = min(0.0, *(float(part.min()) for part in worst))
    starts = np.cumsum([0, *costs.sizes])
    count = int(starts[-1])
    picks = cp.Variable(count, boolean=True)
    peak = cp.Variable(nonneg=True)
    moves = np.repeat(np.arange(len(costs.sizes)), costs.sizes)
    one_each = sparse.csr_array((np.ones(count), (moves, np.arange(count))))
    rules = [cp.Zero(one_each @ picks - np.ones(len(costs.sizes)))]
    size = np.concatenate([part[np.isfinite(part)] for part in worst]) - least
    scale = float(size.max()) or 1.0
    taken, most, banned = _pairs(worst, starts)
    switched_off = most - taken @ picks  # zero where all candidates of a pair are taken
    rules.append(cp.NonNeg(peak - size / scale + switched_off))
    if banned.shape[0]:
        rules.append(cp.NonNeg(np.ones(banned.shape[0]) - banned @ picks))
    never = np.flatnonzero(~np.isfinite(worst[0][0]))
    if len(never):
        rules.append(cp.Zero(picks[never]))
    return Written(cp.Problem(cp.Minimize(peak), rules), picks, scale, least)


def _pairs(
    worst: list[Floats], starts: np.ndarray
) -> tuple[sparse.csr_array, Floats, sparse.csr_array]:
    """Return what adds up the assignments of allowed pairs, to how many, and of the others."""
    count = int(starts[-1])
    allowed = [np.nonzero(np.isfinite(part)) for part in worst]
    others = [np.nonzero(~np.isfinite(part)) for part in worst[1:]]
    first = sparse.csr_array(
        (np.ones(len(allowed[0][1])), (np.arange(len(allowed[0][1])), allowed[0][1])),
        shape=(len(allowed[0][1]), count),
    )
    later = [_both(pair, starts[k : k + 2], count) for k, pair in enumerate(allowed[1:])]
    banned = [_both(pair, starts[k : k + 2], count) for k, pair in enumerate(others)]
    taken = sparse.csr_array(sparse.vstack([first, *later]))
    most = np.where(np.arange(taken.shape[0]) < first.shape[0], 1.0, 2.0)
    none = sparse.csr_array((0, count))
    return taken, most, sparse.csr_array(sparse.vstack([none, *banned]))


def _both(pair: tuple[np.ndarray, ...], starts: np.ndarray, count: int) -> sparse.csr_array:
    """Return the matrix that adds up the two assignments of every pair of neighboring moves."""
    rows = np.tile(np.arange(len(pair[0])), 2)
    columns = np.concatenate([pair[0] + starts[0], pair[1] + starts[1]])
    return sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(len(pair[0]), count))


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
    ends = np.cumsum(problem.peaks.sizes)[:-1]
    choice = tuple(int(np.argmax(part)) for part in np.split(np.asarray(written.picks.value), ends))
    worth = problem.peaks.worst(choice)
    bound = written.bound(optimum.bound if optimum.stopped else optimum.value)
    end = End.STOPPED if optimum.stopped else End.DONE
    return Selection(choice, worth, bound, {}, optimum.compile_seconds, end)


FORMULATION = Formulation(
    "minimax_big_m", "worst cost, big-M", FormulationKind.EXACT, Aim.PEAK, solve
)
