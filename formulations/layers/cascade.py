r"""The simplified cascading scheme of Bruun et al., move by move.

With ``charge="later"`` move :math:`k` knows the choice before it and takes

.. math::

   o_k = \arg\min_i \; c_k(i) + d_k(o_{k-1}, i)

where :math:`d_k(o_{k-1}, \cdot)` is ranked among the candidates of move :math:`k` alone. With
``charge="earlier"`` a move answers for the step it shares with the next one, at the next one's
best:

.. math::

   o_k = \arg\min_i \; c_k(i) + \min_j d_{k+1}(i, j) .

Bruun et al. count four steps per optimization, from the reposition to the last release; these, and
the steps that their printed plan optimizes over, are those of ``later``, the default. Choices that
cannot be continued to the last move are left out. It is a heuristic: what it leaves to the next
move may cost more than it saved.
"""

from __future__ import annotations

import numpy as np

from formulations.layers.priced_paths import conditional, move_by_move, stopped
from seqopt.arrays import Floats
from seqopt.errors import ProblemError
from seqopt.graph.formulation import Formulation, FormulationKind, Reads, Watch
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim

CHARGES = ("later", "earlier")


def solve(
    problem: PlacementProblem, *, watch: Watch | None = None, charge: str = "later"
) -> Selection:
    """Return the choices of the cascade.

    ``charge``: which of two moves answers for the step that they share: ``later`` or ``earlier``.
    Raises `InfeasibleError` if no choice is allowed; `ProblemError` if the charge is neither.
    """
    if charge not in CHARGES:
        raise ProblemError(f"cascade: charge is {charge!r}; give one of {', '.join(CHARGES)}")
    costs = problem.sums

    def charged(k: int, before: int) -> Floats:
        if charge == "later":
            return conditional(problem, k, before)
        last = k + 1 == len(costs.sizes)
        return np.zeros(costs.sizes[k]) if last else costs.shared[k + 1].min(axis=1)

    choice = move_by_move(costs, charged, watch or Watch())
    return Selection(choice, costs.cost(choice)) if choice else stopped(problem)


FORMULATION = Formulation(
    "cascade",
    "the cascading scheme of Bruun et al. over the whole build",
    FormulationKind.HEURISTIC,
    Aim.SUM,
    solve,
    Reads.WINDOW,
)
