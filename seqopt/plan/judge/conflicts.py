"""The smallest set of budgets that no choice can keep together, and the message about it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from seqopt.errors import InfeasibleError
from seqopt.graph.layers.costs import Budget, LayeredCosts
from seqopt.graph.layers.interface import CostProblem, PlacementProblem
from seqopt.plan.judge.budget_proof import least_within
from seqopt.plan.judge.certificate import least_sum

PROVEN = 1 - 1e-6  # of a choice that costs nothing and is said to cost this much: there is none


def smallest_conflict(problem: PlacementProblem) -> tuple[Budget, ...]:
    """Return as few budgets as possible that no choice keeps together.

    ``problem``: its sums say which choices are allowed. Result: empty if no set of budgets is
    proven to conflict.
    """
    for count in range(1, len(problem.budgets) + 1):
        for some in combinations(problem.budgets, count):
            if _conflict(problem.sums, some):
                return some
    return ()


def _conflict(costs: LayeredCosts, budgets: tuple[Budget, ...]) -> bool:
    """Return whether it is proven that no allowed choice keeps all budgets."""
    allowed = LayeredCosts(
        *(
            tuple(np.where(np.isfinite(part), 0.0, np.inf) for part in parts)
            for parts in (costs.single, costs.shared)
        )
    )
    return least_within(CostProblem(allowed, budgets), 1.0, {}, 1.0) >= PROVEN


def _least_spent(costs: LayeredCosts, budget: Budget) -> float:
    """Return the least that an allowed choice takes of a budget.

    ``costs``: say which choices are allowed. Result: in its unit.
    """
    pairs = ((budget.single, costs.single), (budget.shared, costs.shared))
    single, shared = (
        tuple(np.where(np.isfinite(c), a, np.inf) for a, c in zip(amounts, parts, strict=True))
        for amounts, parts in pairs
    )
    return least_sum(LayeredCosts(single, shared))


def refusal(problem: PlacementProblem, name: str) -> InfeasibleError:
    """Return the error that says which budgets no choice keeps, or that this is claimed alone.

    ``problem``: some choice is allowed, and it is claimed that none is within all budgets;
    ``name``: of the formulation that claims it.
    """
    found = smallest_conflict(problem)
    if not found:
        return InfeasibleError(
            f"claimed by {name}, and not proven: no choice is within all budgets; raise a bound"
        )
    if len(found) == 1:
        least = _least_spent(problem.sums, found[0])
        return InfeasibleError(
            f"no choice is within all budgets: every choice uses at least {least:.6g} of "
            f"{found[0].name!r}, more than {found[0].bound:.6g}; raise that bound"
        )
    return InfeasibleError(
        f"no choice is within all budgets: {_listed(found)} cannot be kept together, though "
        f"{'each can alone' if len(found) == 2 else 'any fewer of them can'}; raise one of them"
    )


def _listed(budgets: Sequence[Budget]) -> str:
    named = [f"{budget.bound:.6g} of {budget.name!r}" for budget in budgets]
    return f"{', '.join(named[:-1])} and {named[-1]}"
