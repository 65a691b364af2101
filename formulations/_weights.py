"""Weights of scenarios whose bound on the worst or tail total of any choice is highest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SolverError
from seqopt.graph.formulation import Watch
from seqopt.problem.problem import RobustAim

STEPS = 400  # weights that are tried at most
CLOSE = 1e-9  # differences that are none, and of bound and roof, over the size of the values


class _Weighable(Protocol):
    """Choices with a total in every scenario."""

    @property
    def aim(self) -> RobustAim:
        """What is made of the totals."""

    @property
    def scenarios(self) -> int:
        """How many there are."""

    def cheapest(self, weights: Floats) -> tuple[tuple[int, ...], float]:
        """Return the choice of least total by weights (S,), and what none stays below."""

    def totals(self, choice: tuple[int, ...]) -> Floats:
        """Return the total (S,) of a choice in every scenario."""


@dataclass(frozen=True, eq=False)
class Weighed:
    """The weights (S,) with the highest bound, and the best choice that was met, with its value.

    ``met``: all choices that were, the best first.
    """

    weights: Floats
    bound: float
    choice: tuple[int, ...]
    value: float
    met: tuple[tuple[int, ...], ...]


def best_weights(choices: _Weighable, watch: Watch) -> Weighed:
    """Return the weights whose bound is highest, and the best choice met on the way.

    ``choices``: some choice is allowed. A `SolverError` says that no highest point was found.
    """
    count = choices.scenarios
    ask = best = np.full(count, 1.0 / count)
    bound = -np.inf
    met: dict[tuple[int, ...], Floats] = {}
    for step in range(STEPS):
        choice, value = choices.cheapest(ask)
        met[choice] = choices.totals(choice)
        if value > bound:
            best, bound = ask, value
        watch.tell(choices.aim.value(met[choice]), bound)
        if watch.over:
            break
        highest, roof = _highest(np.array([*met.values()]), choices.aim.most(count))
        if roof - bound <= CLOSE * max(abs(roof), abs(bound)):
            break
        ask = highest if step % 2 == 0 else 0.5 * (highest + best)
    values = {choice: choices.aim.value(totals) for choice, totals in met.items()}
    ranked = sorted(values, key=values.__getitem__)
    return Weighed(best, bound, ranked[0], values[ranked[0]], tuple(ranked))


def provers(choices: _Weighable, weighed: Weighed) -> Floats:
    """Return weights that prove bounds of beginnings, (J, S): the best, and single scenarios."""
    if choices.aim.most(choices.scenarios) < 1:
        return weighed.weights[None]
    return np.vstack([weighed.weights, np.eye(choices.scenarios)])


def _highest(totals: Floats, most: float) -> tuple[Floats, float]:
    """Return the weights at which the lowest plane of totals (n, S) is highest, and its height."""
    from scipy.optimize import linprog  # noqa: PLC0415  # slow to import, for scenarios only

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
