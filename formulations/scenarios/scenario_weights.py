r"""The weights of scenarios that prove most, by cutting planes.

.. math::

   \max_{w \in W} \; \min_{o_1, \dots, o_K} \; \sum_s w_s \, c_s(o), \qquad
   W = \Bigl\{ w \ge 0 : \sum_s w_s = 1, \; w_s \le \bar w \Bigr\}

with the totals :math:`c_s` of a choice in every scenario. The largest of :math:`\sum_s w_s c_s`
over :math:`W` is what the aim makes of totals: the worst for :math:`\bar w = 1`, the mean of the
worst for less. At fixed weights the cheapest choice is a shortest path, which dynamic programming
finds; its value is a bound on the value of any choice. Every choice is a plane over the weights,
and the highest point below all planes met so far is asked for next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from seqopt.arrays import Floats
from seqopt.errors import SolverError
from seqopt.graph.scenarios import Choice, ScenarioArcs
from seqopt.plan.calling.formulation import Watch

STEPS = 400  # weights that are tried at most
CLOSE = 1e-9  # distance of bound and roof treated as zero, over their size


@dataclass(frozen=True, eq=False)
class Weighed:
    """What weights tell of a problem.

    ``weights`` (S,): those with the highest bound; ``bound``: which they prove; ``choice``: the
    best that was met; ``value``: what the aim makes of its totals; ``met``: all choices that were
    met.
    """

    weights: Floats
    bound: float
    choice: Choice
    value: float
    met: tuple[Choice, ...]


def best_weights(arcs: ScenarioArcs, watch: Watch) -> Weighed:
    """Return the weights whose bound is highest, and the best choice met on the way.

    ``arcs``: some choice is allowed; ``watch``: is told choices and bounds. Raises `SolverError` if
    the highest point below the planes is not found.
    """
    count = arcs.scenarios
    ask = best = np.full(count, 1.0 / count)
    bound = -np.inf
    met: dict[Choice, Floats] = {}
    for step in range(STEPS):
        choice, value = arcs.cheapest(ask)
        met[choice] = arcs.totals(choice)
        if value > bound:
            best, bound = ask, value
        watch.tell(arcs.aim.value(met[choice]), bound)
        if watch.over:
            break
        highest, roof = _highest(np.array([*met.values()]), arcs.aim.most(count))
        if roof - bound <= CLOSE * max(abs(roof), abs(bound)):
            break
        ask = highest if step % 2 == 0 else 0.5 * (highest + best)
    values = {choice: arcs.aim.value(totals) for choice, totals in met.items()}
    chosen = min(values, key=values.__getitem__)
    return Weighed(best, bound, chosen, values[chosen], tuple(met))


def _highest(totals: Floats, most: float) -> tuple[Floats, float]:
    """Return the weights at which the lowest plane of totals (n, S) is highest, and its height."""
    planes, count = totals.shape
    size = float(np.abs(totals).max()) or 1.0
    found = linprog(
        [*[0.0] * count, -1.0],
        np.hstack([-totals / size, np.ones((planes, 1))]),
        np.zeros(planes),
        [[*[1.0] * count, 0.0]],
        [1.0],
        bounds=[*[(0.0, most)] * count, (None, None)],
    )
    if found.x is None or found.fun is None or not found.success:
        raise SolverError(f"weights of scenarios: {found.message}; rescale the costs")
    weights = np.clip(found.x[:count], 0.0, most)
    return np.asarray(weights / weights.sum()), float(-found.fun) * size
