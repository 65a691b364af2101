r"""The full overlap formulation as an assignment with loose links: an exhibit.

.. math::

   \min_{x, y} \; & \sum_k \sum_i c_k(i)\, x_k(i) + \sum_k \sum_{i,j} d_k(i, j)\, y_k(i, j) \\
   \text{s.t.} \; & \sum_i x_k(i) = 1, \qquad x_k(i) \in \{0, 1\}, \qquad y \ge 0, \\
   & y_k(i, j) \ge x_{k-1}(i) + x_k(j) - 1, \\
   & x_{k-1}(i) + x_k(j) \le 1 \quad \text{for every pair that is not allowed.}

The product of two assignments, written pair by pair. It is right for whole :math:`x`. Where
:math:`x` may be fractions, no pair of candidates adds up to more than one, and every :math:`y` is
zero: the relaxation counts no shared step at all. (Where some :math:`d` is negative the least of
its move is taken out first.) Branching has to put back what ``assignment_tight`` says at once.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np
from scipy import sparse

from formulations.whole_program import WholeProgram, below, largest_of_each, solve_whole
from seqopt.arrays import Floats
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.calling.formulation import Formulation, FormulationKind, Selection, Watch
from seqopt.problem.problem import Aim


def write(problem: PlacementProblem) -> WholeProgram:
    """Return the program of a problem.

    ``problem``: its sums are used. Raises `InfeasibleError` if no choice is allowed.
    """
    costs = problem.sums
    costs.continuable()
    starts = np.cumsum([0, *costs.sizes])
    count = int(starts[-1])
    single = np.concatenate([costs.single[0] + costs.shared[0][0], *costs.single[1:]])
    never = np.flatnonzero(~np.isfinite(single))
    single[never] = 0.0
    links, links_cost, banned, least = _links(costs, starts)
    scale = max(float(np.abs(single).max()), float(np.abs(links_cost).max(initial=0.0)), 1e-300)
    picks = cp.Variable(count, boolean=True)
    moves = np.repeat(np.arange(len(costs.sizes)), costs.sizes)
    one_each = sparse.csr_array((np.ones(count), (moves, np.arange(count))))
    rules = [cp.Zero(one_each @ picks - np.ones(len(costs.sizes)))]
    total = single @ picks / scale + least / scale
    if len(links_cost):
        pairs = cp.Variable(len(links_cost), nonneg=True)
        rules.append(cp.NonNeg(pairs - _both(links, count) @ picks + np.ones(len(links_cost))))
        total = total + links_cost @ pairs / scale
    if len(banned[0]):
        rules.append(cp.NonNeg(np.ones(len(banned[0])) - _both(banned, count) @ picks))
    if len(never):
        rules.append(cp.Zero(picks[never]))
    program = cp.Problem(cp.Minimize(total), rules)
    return WholeProgram(program, picks, largest_of_each(costs.sizes), below(scale))


def _links(costs: LayeredCosts, starts: np.ndarray) -> tuple[np.ndarray, Floats, np.ndarray, float]:
    """Return the allowed pairs (2, A), what they cost, and the rest.

    Costs are those beyond the least of the move where that is negative. The rest: the pairs that
    are not allowed, and the sum of what was taken out.
    """
    none = np.zeros((2, 0), dtype=int)
    links, values, banned, least = [none], [np.zeros(0)], [none], 0.0
    for k in range(1, len(costs.sizes)):
        shared = costs.shared[k]
        at = np.array([[starts[k - 1]], [starts[k]]])
        allowed = np.isfinite(shared)
        low = min(0.0, float(shared[allowed].min()))
        least += low
        links.append(np.array(np.nonzero(allowed)) + at)
        values.append(shared[allowed] - low)
        banned.append(np.array(np.nonzero(~allowed)) + at)
    return (
        np.concatenate(links, axis=1),
        np.concatenate(values),
        np.concatenate(banned, axis=1),
        least,
    )


def _both(pairs: np.ndarray, count: int) -> sparse.csr_array:
    """Return the matrix that adds up the two assignments of every pair."""
    rows = np.tile(np.arange(pairs.shape[1]), 2)
    return sparse.csr_array(
        (np.ones(len(rows)), (rows, pairs.ravel())), shape=(pairs.shape[1], count)
    )


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return the exact optimum.

    ``problem``: its sums are used; ``watch``: says when to stop, and is told what is found. Result:
    with a bound. Raises `InfeasibleError` if no choice is allowed; `SolverError` if the solver ends
    without an optimum.
    """
    return solve_whole(problem, write(problem), Aim.SUM, watch)


FORMULATION = Formulation(
    "assignment_loose", "assignment, loose links", FormulationKind.EXACT, Aim.SUM, solve
)
