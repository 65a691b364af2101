"""The prices of budgets that prove most, by cutting planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from seqopt.arrays import Floats
from seqopt.errors import InfeasibleError, SolverError
from seqopt.plan.calling.priced_paths import ROUNDING, Path, PricedPaths
from seqopt.plan.calling.watch import Watch

STEPS = 200  # prices that are tried at most
WIDEST = 1e12  # prices that are thought of at most, in scaled units


@dataclass(frozen=True, eq=False)
class Priced:
    """What prices tell of a problem.

    ``prices`` (B,): those with the highest bound, scaled; ``bound``: which they prove; scaled;
    ``paths``: the cheapest at all prices that were tried, different ones.
    """

    prices: Floats
    bound: float
    paths: tuple[Path, ...]

    @property
    def best(self) -> Path | None:
        """The cheapest path within the budgets; None if none was met."""
        found = [path for path in self.paths if path.within]
        return min(found, key=lambda path: path.cost, default=None)


def best_prices(paths: PricedPaths, watch: Watch) -> Priced:
    """Return the prices whose bound is highest, by cutting planes.

    Every path is a plane over the prices; their lowest is a concave roof, of which the highest
    point is asked for next, in turn with the middle between it and the best prices so far.

    ``watch``: is told bounds and choices. Raises `InfeasibleError` if prices prove that no choice,
    and no mixture of choices, keeps the budgets; `SolverError` if the highest point of the roof is
    not found.
    """
    ask, reach = np.zeros(len(paths.caps)), 1.0
    best, bound, found = ask, -np.inf, {}
    for step in range(STEPS):
        path, value = paths.cheapest(ask)
        found[path.choice] = path
        if value > bound:
            best, bound = ask, value
        told = path.cost * paths.scale if path.within else np.inf
        watch.tell(told, bound * paths.scale)
        if bound > paths.loosest:
            raise InfeasibleError("no choice is within all budgets; raise a bound")
        if watch.over or not len(ask):
            break
        highest, roof = _highest(list(found.values()), reach)
        if max(best) < reach and roof - bound <= ROUNDING * max(abs(roof), 1.0):
            break
        at_the_edge = bool((highest >= reach * (1 - ROUNDING)).any())
        reach *= 4.0 if at_the_edge and reach < WIDEST else 1.0
        ask = highest if step % 2 == 0 or at_the_edge else 0.5 * (highest + best)
    return Priced(best, bound, tuple(found.values()))


def _highest(paths: Sequence[Path], reach: float) -> tuple[Floats, float]:
    """Return the prices up to ``reach`` at which the lowest plane of the paths is highest.

    And its height there.
    """
    planes = np.array([[1.0, *-path.over] for path in paths])
    heights = np.array([path.cost for path in paths])
    count = planes.shape[1] - 1
    if count == 1:
        return _highest_of_lines(heights, -planes[:, 1], reach)
    bounds = [(None, None), *([(0.0, reach)] * count)]
    found = linprog([-1.0, *[0.0] * count], planes, heights, bounds=bounds)
    if found.x is None or found.fun is None or not found.success:
        raise SolverError(f"prices of budgets: {found.message}; rescale the costs")
    return np.asarray(found.x[1:]), float(-found.fun)


def _highest_of_lines(heights: Floats, slopes: Floats, reach: float) -> tuple[Floats, float]:
    """Return where the lowest of few lines is highest: at an end, or where two of them meet."""
    with np.errstate(divide="ignore", invalid="ignore"):
        meet = (heights[:, None] - heights) / (slopes - slopes[:, None])
    inside = np.isfinite(meet) & (meet > 0) & (meet < reach)
    at = np.concatenate([[0.0, reach], np.unique(meet[inside])])
    lowest = (heights[:, None] + slopes[:, None] * at).min(axis=0)
    best = int(np.argmax(lowest))
    return at[best : best + 1], float(lowest[best])
