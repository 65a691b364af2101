r"""The least makespan, by labels over the states of a build, bounded by multipliers: exact.

A state says which bricks stand and who holds what, a move who takes a grip or lets go. A *label* of
a state :math:`v` is when the last step ended and since when every robot :math:`r` that is free has
been so, :math:`(t, \rho)`. An act of robot :math:`r` that takes :math:`p` to be prepared and
:math:`a` to be done makes it a label of the next state with

.. math::

   t' = \max \{ t, \, \rho_r + p \} + a, \qquad \rho'_r = t' \; \text{ where it lets go } (p = 0).

Of two labels of a state one is dropped if the other dominates it, where of :math:`\rho_r` only what
is later than :math:`t` less the longest preparation counts, and robots that are alike are sorted.
With multipliers :math:`\lambda_r \ge 0` of the time of robots and :math:`\lambda_0` of the time of
all, :math:`\sum \lambda = 1`, every build from a label ends no sooner than

.. math::

   \lambda_0 t + \sum_r \lambda_r \rho_r + h_\lambda(v), \qquad
   h_\lambda(v) = \min_{\text{paths}} \sum_{a} \Bigl( \lambda_0 a
   + \sum_{r \text{ holds or acts}} \lambda_r a + \lambda_r p \Bigr),

since no robot does two things at once (:math:`\rho_r = t` while it holds). The best ones are
found by cutting planes, a first build by narrow searches. Then labels that may end before some
time are set, brick by brick, for four times up to that of the first build: where none reaches an
end, none ends before the least bound that was left out.
"""

from __future__ import annotations

from formulations.times._search import plan_in_time
from seqopt.graph.formulation import Formulation, FormulationKind

FORMULATION = Formulation(
    "makespan_labels",
    "labels of time and readiness, bounded by multipliers of the robots' time",
    FormulationKind.EXACT,
    None,
    plan_in_time,
    answers=("time", "resource", "instance"),
    takes_budgets=True,
)
