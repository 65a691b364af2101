r"""The full overlap formulation by dynamic programming: exact.

.. math::

   \min_{o_1, \dots, o_K} \; \sum_{k=1}^{K} c_k(o_k) + \sum_{k=2}^{K} d_k(o_{k-1}, o_k)

with the single costs :math:`c` and the costs :math:`d` of the step that neighboring moves share.
It is a shortest path in a layered graph; the cost to go

.. math::

   V_K(i) = c_K(i), \qquad V_k(i) = c_k(i) + \min_j \left[ d_{k+1}(i, j) + V_{k+1}(j) \right]

is found backward, the choice forward. Of sums equal to the last bit the first candidate wins.
"""

from __future__ import annotations

import numpy as np

from seqopt.graph.formulation import Formulation, FormulationKind, Watch
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return the exact optimum of the sum; an `InfeasibleError` says that no choice is allowed."""
    watch = watch or Watch()
    costs = problem.sums
    costs.continuable()
    to_go = [costs.single[-1]]
    for single, shared in zip(costs.single[-2::-1], costs.shared[:0:-1], strict=True):
        if watch.over:
            from formulations.layers.priced_paths import stopped  # noqa: PLC0415  # seldom needed

            return stopped(problem)
        to_go.insert(0, single + (shared + to_go[0]).min(axis=1))
    choice: list[int] = []
    for shared, rest in zip(costs.shared, to_go, strict=True):
        choice.append(int(np.argmin(shared[choice[-1] if choice else 0] + rest)))
    value = costs.cost(choice)
    return Selection(tuple(choice), value, bound=value)


FORMULATION = Formulation(
    "overlap_dp", "full overlap, dynamic programming", FormulationKind.EXACT, Aim.SUM, solve
)
