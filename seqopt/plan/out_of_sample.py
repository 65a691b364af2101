"""Out-of-sample evaluation of a robust plan.

A plan that is good over some scenarios may be fitted to these only. It is therefore judged on
others and compared with two plans: the nominal plan, which uses no scenario, and the best plan for
each single scenario (wait and see), which is a lower bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from seqopt.arrays import Terse
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.decision_costs import ScenarioCosts, best_in_order
from seqopt.graph.states.states import States, over_scenarios
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Aim
from seqopt.scene.scenarios import Scenarios
from seqopt.scene.scene import Scene

PLANS = ("robust", "nominal", "knows_it")


@dataclass(frozen=True, repr=False)
class Trial(Terse):
    """Values of plans, scenario by scenario.

    ``plan``: what was judged; ``graph``: the candidates over scenarios that it was chosen from;
    ``nominal``: the exact optimum of the nominal scene, of the same aim in one scenario; ``table``:
    a row per scenario. Columns: ``set`` (``nominal``, ``optimized`` or ``unseen``), ``scenario``
    (from 1), then for each of the plans ``robust``, ``nominal`` and ``knows_it`` its ``_total`` and
    ``_peak`` there: infinite where it exceeds a limit, or nothing keeps it. The last is the best of
    the aim in that scenario.
    """

    plan: Plan
    graph: States
    nominal: tuple[int, ...]
    table: pd.DataFrame

    def __repr__(self) -> str:
        counts = self.table.groupby("set", sort=False).size()
        sets = ", ".join(f"{count} {name}" for name, count in counts.items())
        return f"<Trial of {self.plan} in scenarios: {sets}>"

    @property
    def known(self) -> tuple[Scene, ...]:
        """The scenarios of the optimization."""
        return self.graph.worlds

    def summary(self) -> dict[str, dict[str, float]]:
        """Return the robust objective of each set of scenarios, by plan; some may be infinite."""
        aim = self.graph.over
        column = "peak" if aim.aim is Aim.PEAK else "total"
        return {
            str(name): {plan: aim.value(rows[f"{plan}_{column}"].to_numpy()) for plan in PLANS}
            for name, rows in self.table.groupby("set", sort=False)
        }


def judge_unseen(plan: Plan, scenes: States | Scenarios | Sequence[Scene]) -> Trial:
    """Evaluate a plan in other scenarios, with two plans for comparison.

    ``plan``: of candidates over scenarios; ``scenes``: not those it was made for: drawn with
    another seed. Or the graph over them, whose costs may be known. Result: also of the nominal
    scene and of the scenarios that it was made for. Raises `ProblemError` if a scenario has other
    bricks or nodes.
    """
    graph = plan.graph.alone_in_scene
    own = graph.decisions
    if own is None or not graph.scenarios:
        raise ProblemError("the plan was not chosen over scenarios; pose with scenarios")
    aim = graph.over.aim
    known = ScenarioCosts(own.sums, own.peaks, 0, 0.0)
    costs = aim.costs(own)
    chosen = best_in_order([(costs, aim), (costs, Aim.SUM)])
    if not isinstance(scenes, States):
        some = scenes.scenes if isinstance(scenes, Scenarios) else scenes
        scenes = over_scenarios(replace(graph, scenarios=()), some, graph.over)
    sets = {"nominal": (known,), "optimized": graph.costs_in_scenarios}
    sets["unseen"] = scenes.costs_in_scenarios
    rows: list[dict[str, object]] = [
        {"set": name, "scenario": i, **_row(costs, aim, (plan.choice, chosen))}
        for name, found in sets.items()
        for i, costs in enumerate(found, start=1)
    ]
    return Trial(plan, graph, chosen, pd.DataFrame(rows))


def _row(costs: ScenarioCosts, aim: Aim, choices: Sequence[tuple[int, ...]]) -> dict[str, float]:
    """Return total and peak cost of the three plans in a scenario."""
    best, layered = None, aim.costs(costs)
    with suppress(InfeasibleError):
        best = best_in_order([(layered, aim), (layered, Aim.SUM)])
    out: dict[str, float] = {}
    for name, choice in zip(PLANS, (*choices, best), strict=True):
        out[f"{name}_total"] = np.inf if choice is None else costs.sums.cost(choice)
        out[f"{name}_peak"] = np.inf if choice is None else costs.peaks.worst(choice)
    return out
