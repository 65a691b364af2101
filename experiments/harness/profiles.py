"""Comparisons over many instances: Pareto fronts, profiles, and means that no instance dominates.

Performance profiles: Dolan and Moré (2002), Math. Program. 91. Data profiles: Moré and Wild (2009),
SIAM J. Optim. 20.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from seqopt.arrays import Floats


def pareto(cost: Floats, loss: Floats) -> np.ndarray:
    """Return which points no other one beats in cost and loss at once, (n,) bool."""
    no_worse = (cost[:, None] <= cost) & (loss[:, None] <= loss)
    better = (cost[:, None] < cost) | (loss[:, None] < loss)
    return ~(no_worse & better).any(axis=0)


def performance_profile(costs: pd.DataFrame, ratios: Floats) -> pd.DataFrame:
    """Return the share of instances that each solver does within a multiple of the best.

    Parameters
    ----------
    costs : DataFrame
        A row per instance, a column per solver; infinite where it failed.
    ratios : (r,) float
    """
    best = costs.min(axis=1)
    relative = costs.div(best, axis=0)
    return pd.DataFrame(
        {name: [(relative[name] <= r).mean() for r in ratios] for name in costs}, index=ratios
    )


def data_profile(evaluations: pd.DataFrame, budgets: Floats) -> pd.DataFrame:
    """Return the share of instances that each solver does within a budget of evaluations."""
    return pd.DataFrame(
        {name: [(evaluations[name] <= b).mean() for b in budgets] for name in evaluations},
        index=budgets,
    )


def shifted_mean(values: Floats, shift: float) -> float:
    """Return the geometric mean of values shifted by a constant, shifted back."""
    return float(np.exp(np.log(np.asarray(values) + shift).mean()) - shift)
