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

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.whole_program import (
    WholeProgram,
    below,
    largest_of_each,
    solve_whole,
    worst_pairs,
)
from seqopt.arrays import Floats
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.calling.formulation import Formulation, FormulationKind, Selection, Watch
from seqopt.problem.problem import Aim


def write(problem: PlacementProblem) -> WholeProgram:
    """Return the program of a problem.

    ``problem``: its peaks are used. Raises `InfeasibleError` if no choice is allowed.
    """
    costs = problem.peaks
    costs.continuable()
    worst, least = worst_pairs(costs)
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
    program = cp.Problem(cp.Minimize(peak), rules)
    return WholeProgram(program, picks, largest_of_each(costs.sizes), below(scale, least))


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

    ``problem``: its peaks are used; ``watch``: says when to stop, and is told what is found.
    Result: with a bound. Raises `InfeasibleError` if no choice is allowed; `SolverError` if the
    solver ends without an optimum.
    """
    return solve_whole(problem, write(problem), Aim.PEAK, watch)


FORMULATION = Formulation(
    "minimax_big_m", "worst cost, big-M", FormulationKind.EXACT, Aim.PEAK, solve
)
