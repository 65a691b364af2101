r"""Exhaustive rank search: every combination of the next moves, the first one committed.

At move :math:`k`, with the choices before it committed, it enumerates all combinations of the
next :math:`h` moves,

.. math::

   \min_{o_k, \dots, o_{k+h-1}} \; \sum_{l=k}^{k+h-1} c_l(o_l) + d_k(o_{k-1}, o_k)
   + \sum_{l=k+1}^{k+h-1} d_l(o_{l-1}, o_l),

and commits :math:`o_k`. The step shared with the committed choice is ranked among the candidates
of move :math:`k` alone. With ``horizon=1`` this is the search of a single move of Bruun et al.
(equation 1), every candidate analyzed in every step of its window, ranked per criterion, least sum
wins, and chooses as ``cascade`` does; without proof it is that. With the whole build as horizon it
is brute force and exact; tests hold the other formulations against it on small builds. The work
grows with the product of the candidates' numbers.
"""

from __future__ import annotations

import math

import numpy as np

from formulations.layers.priced_paths import conditional, stopped
from seqopt.arrays import Floats
from seqopt.errors import ProblemError
from seqopt.graph.formulation import Formulation, FormulationKind, Watch
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim

MOST = 20_000_000  # combinations in one enumeration: 160 MB


def solve(problem: PlacementProblem, *, watch: Watch | None = None, horizon: int = 2) -> Selection:
    """Return the committed choices.

    ``horizon``: how many moves are enumerated at once, from 1. Raises `InfeasibleError` if no
    choice is allowed; `ProblemError` if it is below 1, or combinations are more than `MOST`.
    """
    watch = watch or Watch()
    costs = problem.sums
    sizes = costs.sizes
    if horizon < 1:
        raise ProblemError(f"rank_search: horizon is {horizon}; give a whole number from 1")
    good = costs.continuable()
    choice: list[int] = []
    while len(choice) < len(sizes):
        if watch.over:
            return stopped(problem)
        k = len(choice)
        count = math.prod(sizes[k : k + horizon])
        if count > MOST:
            raise ProblemError(
                f"rank_search: {count:.2g} combinations of {min(horizon, len(sizes))} moves; "
                f"lower the horizon (at most {MOST:.0e} are enumerated)"
            )
        before = choice[-1] if choice else 0
        row = conditional(problem, k, before)
        blocked = ~np.isfinite(costs.shared[k][before])
        total = _enumerate(costs, np.where(blocked, np.inf, row), k, horizon, good)
        best = np.unravel_index(int(np.argmin(total)), total.shape)
        whole = k + horizon >= len(sizes)  # nothing is left to be decided after these
        choice += [int(c) for c in (best if whole else best[:1])]
    return Selection(tuple(choice), costs.cost(choice))


def _enumerate(
    costs: LayeredCosts, row: Floats, k: int, horizon: int, good: tuple[np.ndarray, ...]
) -> Floats:
    """Return the cost of every combination of the moves from ``k`` on, one axis each."""
    total = np.where(good[k], row + costs.single[k], np.inf)
    for move in range(k + 1, min(k + horizon, len(costs.single))):
        step = costs.shared[move] + np.where(good[move], costs.single[move], np.inf)
        total = total[..., None] + step
    return total


FORMULATION = Formulation(
    "rank_search",
    "exhaustive search of the next moves",
    FormulationKind.HEURISTIC,
    Aim.SUM,
    solve,
    windowed=(("horizon", 1),),
)
