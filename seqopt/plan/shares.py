"""Budgets of a problem from what is asked of them, as shares of what its optimum takes, say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from seqopt.graph.layers.budgets import steps_over, travel
from seqopt.graph.layers.costs import Budget
from seqopt.graph.layers.layers import Layers
from seqopt.plan.solving import on_the_way, solve
from seqopt.problem.budgets import AskedBudget

UNBOUND = "overlap_dp"  # finds the optimum without budgets, of which a share may be asked


def with_budgets(problem: Layers, asked: Sequence[AskedBudget]) -> Layers:
    """Return a problem with budgets; shares are those of its optimum without any.

    ``problem``: posed with the responses that the budgets name.
    """
    budgets: list[Budget] = []
    for each in asked:
        bound = each.bound
        if each.share:
            free = on_the_way(solve(problem, UNBOUND)).selection.choice
            bound *= _budget(problem, each, np.inf).spent(free)
        budgets.append(_budget(problem, each, bound))
    return replace(problem, budgets=tuple(budgets))


def _budget(problem: Layers, asked: AskedBudget, bound: float) -> Budget:
    """Return the budget of how much there is, in its unit."""
    if not asked.response:
        return travel(problem, bound)
    return steps_over(problem, asked.response, asked.level, bound)
