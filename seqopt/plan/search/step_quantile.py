"""The least level that all open steps except a few keep: a quantile over steps, solved exactly.

A peak is the cost of one step, and one step that cannot be helped may hide all others. Here some
steps may cost more than the level. How many do is a sum over steps, so for a given level dynamic
programming finds the choice with the fewest; the least level is found by bisection over all costs
that occur.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import ProblemError
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.interface import CostProblem
from seqopt.graph.layers.joining import Joined
from seqopt.graph.layers.layers import Layers
from seqopt.graph.layers.possible import compared
from seqopt.plan.judge.certificate import least_sum
from seqopt.plan.search.in_order import solve_in_order
from seqopt.problem.aims import Aim
from seqopt.scene.checks import short

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
    problem.sums.continuable()
    steps = _step_costs(problem)
    sizes = problem.sums.sizes
    most = math.floor(share * len(steps) + 1e-9)
    levels = np.unique(np.concatenate([costs[np.isfinite(costs)] for _, costs in steps]))
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        if least_sum(_above(steps, sizes, float(levels[middle]))) <= most:
            high = middle
        else:
            low = middle + 1
    above = _above(steps, sizes, float(levels[low]))
    goals = [(CostProblem(above), Aim.SUM), (CostProblem(problem.sums), Aim.SUM)]
    found = solve_in_order(goals)
    return StepQuantile(found.choice, float(levels[low]), round(found.values[0]), len(steps))


def _step_costs(problem: Layers) -> list[tuple[tuple[int, ...], Floats]]:
    """Return the costs of every open step's choices, with the moves that are open in it."""
    out = []
    for steps in problem.evaluation.levels():
        for choices in steps:
            faced = compared(choices, problem.schedule, problem.criterion)
            out.append((faced.moves, problem.step_costs(faced)))
    return out


def _above(steps: StepCosts, sizes: Sequence[int], level: float) -> LayeredCosts:
    """Return how many steps of a choice cost more than a level, infinite where not allowed."""
    joined = Joined(sizes, np.add)
    for moves, costs in steps:
        joined.add(moves, np.where(np.isfinite(costs), (costs > level).astype(float), np.inf))
    return joined.layered()
