"""Budgets of a problem from what is asked of them, as shares of what its optimum takes, say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from seqopt.graph.layers.budgets import steps_over, travel
from seqopt.graph.layers.costs import Budget
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.layers.layers import Layers
from seqopt.plan.calling.formulation import End, Selection, find_formulation
from seqopt.plan.calling.selecting import select
from seqopt.plan.judge.certificate import judge
from seqopt.problem.aims import Aim
from seqopt.problem.budgets import AskedBudget

CHOOSES = {Aim.PEAK: "minimax", Aim.SUM: "overlap_dp"}  # of one scenario, without budgets


def with_budgets(problem: Layers, asked: Sequence[AskedBudget]) -> Layers:
    """Return a problem with budgets; shares are those of its optimum without any.

    ``problem``: posed with the responses that the budgets name.
    """
    budgets: list[Budget] = []
    for each in asked:
        bound = each.bound
        if each.share:
            free = best_choice(problem, Aim.SUM).choice
            bound *= _budget(problem, each, np.inf).spent(free)
        budgets.append(_budget(problem, each, bound))
    return replace(problem, budgets=tuple(budgets))


def _budget(problem: Layers, asked: AskedBudget, bound: float) -> Budget:
    """Return the budget of how much there is, in its unit."""
    if not asked.response:
        return travel(problem, bound)
    return steps_over(problem, asked.response, asked.level, bound)


def best_choice(problem: PlacementProblem, aim: Aim) -> Selection:
    """Return the best choice without budgets, judged; an interrupt ends more than this.

    Raises `InfeasibleError` if no choice is allowed; `KeyboardInterrupt` if it was interrupted.
    """
    formulation = find_formulation(CHOOSES[aim])
    found = select(formulation, problem)
    if found.end is End.INTERRUPTED:
        raise KeyboardInterrupt
    judge(problem, found, formulation)
    return found
