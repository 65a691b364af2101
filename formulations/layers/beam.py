r"""A beam of given width between the cascade and the exact optimum.

Move by move it extends the ``width`` best partial choices by every candidate and, for each
candidate, keeps the cheapest way to it:

.. math::

   B_k = \text{the } w \text{ candidates } j \text{ with the least } \;
   s_k(j) = c_k(j) + \min_{i \in B_{k-1}} \left[ s_{k-1}(i) + d_k(i, j) \right] .

With a width of all candidates it is dynamic programming and exact. The greedy choice that ranks
the shared step among the candidates of one move, as the cascade does, is kept beside it: the beam
never does worse.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from formulations.layers.priced_paths import conditional, move_by_move, stopped
from seqopt.errors import ProblemError
from seqopt.graph.formulation import End, Formulation, FormulationKind, Watch
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim


def solve(problem: PlacementProblem, *, watch: Watch | None = None, width: int = 5) -> Selection:
    """Return the best choice found with a beam.

    ``width``: how many partial choices are kept, from 1. Raises `InfeasibleError` if no choice is
    allowed; `ProblemError` if the width is below 1.
    """
    if width < 1:
        raise ProblemError(f"beam: width is {width}; give a whole number from 1")
    costs = problem.sums
    watch = watch or Watch()
    found = [_greedy(problem, watch), _beam(problem, width, watch)]
    met = [choice for choice in found if choice is not None]
    if not met:
        return stopped(problem)
    choice = min(reversed(met), key=costs.cost)
    end = End.DONE if len(met) == len(found) else End.STOPPED
    return Selection(choice, costs.cost(choice), end=end)


def _beam(problem: PlacementProblem, width: int, watch: Watch) -> tuple[int, ...] | None:
    """Return the best choice of the beam, the greedy one if none leads on; None if time is over."""
    costs = problem.sums
    good = costs.continuable()
    paths: list[tuple[int, ...]] = [()]
    spent = np.zeros(1)
    for k, (single, shared) in enumerate(zip(costs.single, costs.shared, strict=True)):
        if watch.over:
            return None
        ends = [path[-1] if path else 0 for path in paths]
        through = spent[:, None] + shared[ends]
        best = through.argmin(axis=0)
        total = np.where(good[k], through.min(axis=0) + single, np.inf)
        order = np.argsort(total, kind="stable")
        kept = order[np.isfinite(total[order])][:width]
        if not len(kept):  # no kept choice can be continued
            return _greedy(problem, Watch())
        paths = [(*paths[best[j]], int(j)) for j in kept]
        spent = total[kept]
    return paths[0]


def _greedy(problem: PlacementProblem, watch: Watch) -> tuple[int, ...] | None:
    return move_by_move(problem.sums, partial(conditional, problem), watch)


FORMULATION = Formulation(
    "beam", "a beam between cascade and exact", FormulationKind.HEURISTIC, Aim.SUM, solve
)
