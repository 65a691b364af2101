"""Aims in order of importance, and the least level that most steps keep, solved exactly."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from numbers import Real

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import ProblemError
from seqopt.graph.layers.compiled import best_in_order
from seqopt.graph.layers.costs import Joined, LayeredCosts
from seqopt.graph.layers.layers import Layers
from seqopt.problem.problem import Aim
from seqopt.scene._checks import short


@dataclass(frozen=True)
class InOrder:
    """The best choice for several aims in order of importance.

    ``choice``: a candidate for every move; ``values``: its value for every aim.
    """

    choice: tuple[int, ...]
    values: tuple[float, ...]


def solve_in_order(goals: Sequence[tuple[LayeredCosts, Aim]]) -> InOrder:
    """Return the choice that is best for the first aim; among these best for the second; and so on.

    Exact, sums that differ by less than `seqopt.graph.paths.TIED` counting as equal.

    ``goals`` (sequence of (LayeredCosts, Aim)): costs of the same moves, each by its own criterion,
    and whether their sum or the largest is to be small; the most important first. Raises
    `InfeasibleError` if no choice is allowed by all; `ProblemError` if there is no goal, or costs
    are of other moves or candidates.

    Examples
    --------
    >>> nothing = np.zeros((1, 2))
    >>> first, second = (
    ...     LayeredCosts((np.array(costs),), (np.zeros((1, 3)),))
    ...     for costs in ([2.0, 1.0, 1.0], [0.0, 5.0, 4.0])
    ... )
    >>> solve_in_order([(first, Aim.PEAK), (second, Aim.SUM)])
    InOrder(choice=(2,), values=(1.0, 4.0))
    """
    layers = [costs for costs, _ in goals]
    _require_same(layers)
    choice = best_in_order(goals)
    return InOrder(choice, tuple(aim.value_of(costs, choice) for costs, aim in goals))


def _require_same(layers: Sequence[LayeredCosts]) -> None:
    if not layers:
        raise ProblemError("there is no aim; give at least one")
    if len({costs.sizes for costs in layers}) > 1:
        raise ProblemError(
            "the problems have other moves or candidates; pose them with one schedule"
        )


StepCosts = Sequence[tuple[tuple[int, ...], Floats]]


@dataclass(frozen=True)
class StepQuantile:
    """A choice whose open steps, except a few, keep the least level.

    ``choice``: of those that keep it, one with the fewest steps above, and then of least sum;
    ``level``: in the unit of the criterion; ``above``: how many steps cost more; ``steps``: how
    many open steps there are.
    """

    choice: tuple[int, ...]
    level: float
    above: int
    steps: int


def least_quantile(problem: Layers, share: float = 0.1) -> StepQuantile:
    """Return the choice with the least level that no more than a share of open steps exceed.

    ``problem``: without budgets; ``share``: of the open steps, from 0 (the least peak) to below 1.
    Raises `InfeasibleError` if no choice is allowed; `ProblemError` if the share is none, or there
    are budgets.
    """
    number = isinstance(share, Real) and not isinstance(share, bool)
    if not number or not 0 <= share < 1:
        raise ProblemError(f"share is {short(share)}; give a number from 0 to below 1")
    if problem.budgets:
        raise ProblemError("quantiles over steps take no budgets; leave them out")
    best_in_order([(problem.sums, Aim.SUM)])  # says if no choice is allowed
    every = chain.from_iterable(problem.evaluation.levels())
    steps = [(each.moves, problem.step_costs(each)) for each in every]
    sizes = problem.sums.sizes
    most = math.floor(share * len(steps) + 1e-9)
    levels = np.unique(np.concatenate([costs[np.isfinite(costs)] for _, costs in steps]))

    def kept(level: float) -> bool:
        return _above(steps, sizes, level).least(Aim.SUM) <= most

    level = float(levels[bisect_left(levels, x=True, hi=len(levels) - 1, key=kept)])
    layers = (_above(steps, sizes, level), problem.sums)
    found = solve_in_order([(costs, Aim.SUM) for costs in layers])
    return StepQuantile(found.choice, level, round(found.values[0]), len(steps))


def _above(steps: StepCosts, sizes: Sequence[int], level: float) -> LayeredCosts:
    """Return how many steps of a choice cost more than a level, infinite where not allowed."""
    joined = Joined(sizes, np.add)
    for moves, costs in steps:
        joined.add(moves, np.where(np.isfinite(costs), (costs > level).astype(float), np.inf))
    return joined.layered()
