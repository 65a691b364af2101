"""The objective as a function of a budget; its slope is the price of the budget."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from seqopt.errors import InfeasibleError
from seqopt.graph.layers.costs import Budget
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.calling.formulation import Formulation, Selection
from seqopt.plan.layers import on_the_way
from seqopt.plan.plan import Plan
from seqopt.plan.solving import solve


def price_curve(
    problem: PlacementProblem,
    budget: Budget,
    bounds: Sequence[float],
    formulation: Formulation | str = "labels",
    **options: Any,
) -> pd.DataFrame:
    """Solve a problem for several bounds of a budget.

    ``problem``: its own budgets stay; ``budget``: whatever its bound is; ``bounds``: how much there
    is of it, in its unit; ``formulation``: one that takes budgets; ``**options``: of `seqopt.solve`
    and of the formulation. Result: a row per bound. Columns: ``bound``, ``objective``, ``proven``
    (the certificate's lower bound), ``gap``, ``spent`` and ``price``, the cost that one more unit
    would save (the slope of the relaxation, downward); NaN where no choice is within the budgets.
    """
    rows = [_row(problem, replace(budget, bound=bound), formulation, options) for bound in bounds]
    columns = ["bound", "objective", "proven", "gap", "spent", "price"]
    return pd.DataFrame(rows, columns=columns)


def _row(
    problem: PlacementProblem,
    budget: Budget,
    formulation: Formulation | str,
    options: dict[str, Any],
) -> dict[str, float]:
    capped = _with(problem, budget)
    try:
        plan = on_the_way(solve(capped, formulation, **options))
    except InfeasibleError:
        return {"bound": budget.bound}
    proof = plan.certificate
    if proof is None:
        return {"bound": budget.bound}
    return {
        "bound": budget.bound,
        "objective": proof.objective,
        "proven": proof.bound,
        "gap": proof.gap,
        "spent": proof.spent[budget.name],
        "price": _price(plan, budget.name),
    }


def _with(problem: PlacementProblem, budget: Budget) -> PlacementProblem:
    """Return a problem with one more budget."""
    changed: PlacementProblem = replace(problem, budgets=(*problem.budgets, budget))  # type: ignore[type-var]
    return changed


def _price(plan: Plan, budget: str) -> float:
    """Return what one more unit of a budget would save; NaN if its formulation says nothing."""
    assert isinstance(plan.selection, Selection)  # budgets of candidates
    return plan.selection.prices.get(budget, np.nan)
