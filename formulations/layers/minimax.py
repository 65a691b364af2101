r"""The smallest achievable worst cost over the build: exact.

.. math::

   \min_{o_1, \dots, o_K} \; \max \left\{ \max_k c_k(o_k), \; \max_k d_k(o_{k-1}, o_k) \right\}

where :math:`c_k(i)` is the worst of the steps in which move :math:`k` alone is open, and
:math:`d_k` that of the steps it shares with the move before. It is a bottleneck path in a layered
graph; dynamic programming solves it with the maximum instead of the sum. Among the choices with the
same worst cost the least sum of costs wins. The certificate proves the value again: no choice stays
strictly below it.
"""

from __future__ import annotations

import numpy as np

from formulations.layers.priced_paths import stopped
from seqopt.graph.formulation import Formulation, FormulationKind, Watch
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim


def solve(problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
    """Return a choice of least peak; an `InfeasibleError` says that no choice is allowed."""
    costs = problem.peaks
    costs.continuable()
    if (watch or Watch()).over:
        return stopped(problem, Aim.PEAK)
    peak = _least_peak(costs)
    allowed = LayeredCosts(
        tuple(np.where(single <= peak, single, np.inf) for single in costs.single),
        tuple(np.where(shared <= peak, shared, np.inf) for shared in costs.shared),
    )
    choice = _least_sum(allowed)
    return Selection(choice, costs.worst(choice), bound=peak)


def _least_peak(costs: LayeredCosts) -> float:
    reached = np.full(1, -np.inf)
    for single, shared in zip(costs.single, costs.shared, strict=True):
        reached = np.maximum(single, np.maximum(reached[:, None], shared).min(axis=0))
    return float(reached.min())


def _least_sum(costs: LayeredCosts) -> tuple[int, ...]:
    total = np.zeros(1)
    back = []
    for single, shared in zip(costs.single, costs.shared, strict=True):
        through = total[:, None] + shared
        back.append(through.argmin(axis=0))
        total = through.min(axis=0) + single
    choice = [int(total.argmin())]
    for best in reversed(back[1:]):
        choice.append(int(best[choice[-1]]))
    return tuple(reversed(choice))


FORMULATION = Formulation(
    "minimax", "smallest worst cost over the build", FormulationKind.EXACT, Aim.PEAK, solve
)
