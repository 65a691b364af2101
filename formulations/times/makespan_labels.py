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

from dataclasses import replace

import numpy as np

from formulations.times._search import in_time
from formulations.times._stages import ALMOST, Asked, Chosen
from seqopt.graph._labels import Labels, LateError
from seqopt.graph.formulation import FormulationKind

SHARES = (0.25, 0.5, 0.75, 1.0)  # of the gap that is left, up to which labels are set
MOST = 40_000_000  # labels that are kept at once


def _least(asked: Asked) -> Chosen:
    """Return the path of least makespan, with the labels that prove it."""
    best, bound = asked.first, asked.prices.bound
    labels: tuple[Labels, ...] = ()
    if not best.path:  # narrow searches found nothing, as budgets leave little
        try:
            own = asked.kept, asked.caps, asked.prices
            found = asked.carrying.sweep(*own, asked.watch, most=MOST)
        except LateError:
            return Chosen((), np.inf, bound, late=True)
        return Chosen(found.path, found.best, found.best, tuple(found.kept))
    start = bound
    for share in SHARES:
        limit = start + (best.value - start) * share if share < 1.0 else best.value * (1 - ALMOST)
        caps = replace(asked.caps, time=min(limit, asked.caps.time))
        try:
            own = asked.kept, caps, asked.prices
            swept = asked.carrying.sweep(*own, asked.watch, most=MOST)
        except LateError:
            return Chosen(best.path, best.value, bound, labels, late=True)
        asked.watch.tell(bound=bound)
        labels = tuple(swept.kept)
        if swept.path:
            return Chosen(swept.path, swept.best, swept.best, labels)
        bound = max(bound, min(swept.left_out, best.value))
        if bound >= best.value * (1 - ALMOST):
            break
    return Chosen(best.path, best.value, best.value, labels)


FORMULATION = in_time(
    "makespan_labels",
    "labels of time and readiness, bounded by multipliers of the robots' time",
    FormulationKind.EXACT,
    _least,
    exact=True,
)
