"""The value of a robust plan in scenarios that it was not made for.

A plan that is good over some scenarios may be fitted to these only. It is therefore judged on
others and compared with two plans: the nominal plan, which uses no scenario, and the best plan for
each single scenario (wait and see), which no plan can beat.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from seqopt.arrays import Terse
from seqopt.errors import InfeasibleError
from seqopt.graph.layers.interface import Aim
from seqopt.graph.scenarios.arcs import Choice
from seqopt.graph.scenarios.costs import ScenarioCosts
from seqopt.graph.scenarios.scenarios import ScenarioLayers, robust
from seqopt.plan.robust_plan import RobustPlan, best_choice
from seqopt.scene.scenarios import Scenarios
from seqopt.scene.scene import Scene

PLANS = ("robust", "nominal", "knows_it")


@dataclass(frozen=True, repr=False)
class Trial(Terse):
    """Plans, scenario by scenario.

    ``plan``: what was judged; ``nominal``: the exact optimum of the nominal scene, of the same aim
    in one scenario; ``table``: a row per scenario. Columns: ``set`` (``nominal``, ``optimized`` or
    ``unseen``), ``scenario`` (from 1), then for each of the plans ``robust``, ``nominal`` and
    ``knows_it`` its ``_total`` and ``_peak`` there: infinite where it exceeds a limit, or nothing
    keeps it. The last is the best of the aim in that scenario.
    """

    plan: RobustPlan
    nominal: Choice
    table: pd.DataFrame

    def __repr__(self) -> str:
        counts = self.table.groupby("set", sort=False).size()
        sets = ", ".join(f"{count} {name}" for name, count in counts.items())
        return f"<Trial of {self.plan} in scenarios: {sets}>"

    def summary(self) -> dict[str, dict[str, float]]:
        """Return what the aim makes of every set of scenarios, ready for JSON.

        Result: by set and plan; infinite numbers are left to the caller.
        """
        aim = self.plan.problem.aim
        column = "peak" if aim.aim is Aim.PEAK else "total"
        return {
            str(name): {plan: aim.value(rows[f"{plan}_{column}"].to_numpy()) for plan in PLANS}
            for name, rows in self.table.groupby("set", sort=False)
        }


def judge_unseen(plan: RobustPlan, scenes: ScenarioLayers | Scenarios | Sequence[Scene]) -> Trial:
    """Return the value of a plan in other scenarios, beside two plans for comparison.

    ``scenes``: not those it was made for: drawn with another seed. Or the problem over them, whose
    costs may be known. Result: also of the nominal scene and of the scenarios that it was made for.
    Raises `ProblemError` as `seqopt.graph.scenarios.scenarios.robust`.
    """
    problem = plan.problem
    nominal = problem.nominal
    known = ScenarioCosts(nominal.sums, nominal.peaks, 0, 0.0)
    aim = problem.aim.aim
    chosen = best_choice(aim.costs(nominal), aim).choice
    unseen = scenes
    if not isinstance(unseen, ScenarioLayers):
        unseen = robust(nominal, unseen, problem.aim)
    sets = {"nominal": (known,), "optimized": problem.costs, "unseen": unseen.costs}
    rows: list[dict[str, object]] = [
        {"set": name, "scenario": i, **_row(costs, problem, (plan.choice, chosen))}
        for name, found in sets.items()
        for i, costs in enumerate(found, start=1)
    ]
    return Trial(plan, chosen, pd.DataFrame(rows))


def _row(
    costs: ScenarioCosts, problem: ScenarioLayers, choices: tuple[Choice, Choice]
) -> dict[str, float]:
    """Return what three plans cost in a scenario."""
    aim = problem.aim.aim
    try:
        best = best_choice(costs.sums if aim is Aim.SUM else costs.peaks, aim).choice
    except InfeasibleError:
        best = None
    out: dict[str, float] = {}
    for name, choice in zip(PLANS, (*choices, best), strict=True):
        out[f"{name}_total"] = np.inf if choice is None else costs.sums.cost(choice)
        out[f"{name}_peak"] = np.inf if choice is None else costs.peaks.worst(choice)
    return out
