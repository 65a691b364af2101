"""Plans over scenarios on one scene: made on few, judged on many others."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from formulations.scenario_program import solve_program
from seqopt.engines.registry import make_engine
from seqopt.network.build import build_network
from seqopt.placement.in_order import solve_in_order
from seqopt.placement.interface import Aim
from seqopt.placement.problem import Problem, pose
from seqopt.placement.requirements import Criterion
from seqopt.placement.robust_aim import WORST_PEAK, WORST_TOTAL, RobustAim, cvar
from seqopt.placement.robust_plan import RobustPlan, solve_robust
from seqopt.placement.robust_problem import RobustProblem, robust
from seqopt.placement.scenario_arcs import Choice
from seqopt.placement.solving import solve
from seqopt.placement.step_quantile import least_quantile
from seqopt.placement.unseen import judge_unseen
from seqopt.placement.watch import Watch
from seqopt.scene.scenarios import scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.presets import EQUATIONS, WEIGHTED, WORST_RATIO

AIMS: dict[RobustAim, Criterion] = {
    WORST_PEAK: WORST_RATIO,
    WORST_TOTAL: WEIGHTED,
    cvar(0.9): WEIGHTED,
    cvar(0.5): WEIGHTED,
}
UNSEEN_SEED = 1000  # no plan is made with it
TAIL = cvar(0.9)


@dataclass(frozen=True)
class Effort:
    """How many scenarios there are, how often, and how long a program may take."""

    counts: tuple[int, ...]
    seeds: int
    unseen: int
    limit: float


def posed(scene: Scene, criterion: Criterion) -> Problem:
    network = build_network(scene)
    return pose(make_engine("compliance", network), three_robot_loop(network), criterion)


def drawn(problem: Problem, count: int, seed: int) -> RobustProblem:
    """Return the problem over so many scenarios, costs computed."""
    scene = problem.schedule.scene
    found = robust(problem, scenarios(scene, count=count, seed=seed), WORST_PEAK)
    assert found.costs
    return found


def rows(scene: Scene, effort: Effort) -> Iterator[dict[str, object]]:
    """Yield a row for every aim, seed and count of scenarios."""
    for criterion in (WORST_RATIO, WEIGHTED):
        problem = posed(scene, criterion)
        unseen = drawn(problem, effort.unseen, UNSEEN_SEED)
        for seed in range(effort.seeds):
            most = drawn(problem, max(effort.counts), seed)
            for aim in (aim for aim, own in AIMS.items() if own is criterion):
                for count in effort.counts:
                    plan = solve_robust(most.under(aim).first(count))
                    row = {"aim": str(aim), "criterion": criterion.name, "seed": seed}
                    yield row | {"scenarios": count} | measured(plan, unseen)


def measured(plan: RobustPlan, unseen: RobustProblem) -> dict[str, object]:
    """Return what a plan is worth where it was made and elsewhere."""
    trial = judge_unseen(plan, unseen).summary()
    return {
        "objective": plan.objective,
        "gap": plan.gap,
        "gap_by_weights": (plan.objective - plan.proven) / plan.objective,
        "solve_s": plan.seconds["solve"],
        **{f"{name}_{who}": trial[name][who] for name in trial for who in trial[name]},
    }


def references(scene: Scene, count: int, limit: float) -> pd.DataFrame:
    """Return the integer programs beside the cuts: values, bounds and times."""
    found = []
    most = drawn(posed(scene, WEIGHTED), count, 0)
    for aim in (WORST_TOTAL, TAIL):
        plan = solve_robust(most.under(aim))
        start = time.perf_counter()
        told = solve_program(most.layered(Aim.SUM), aim.most(count), whole=True, watch=Watch(limit))
        row = {"aim": str(aim), "scenarios": count, "objective": plan.objective}
        row |= {"bound": plan.bound, "solve_s": plan.seconds["solve"]}
        row |= {"program": told.value, "program_bound": told.bound}
        found.append(row | {"program_s": time.perf_counter() - start, "limit_s": limit})
    return pd.DataFrame(found)


def plans(scene: Scene, count: int) -> dict[str, Choice]:
    """Return a choice for every way to say what is good."""
    ranks, total, worst = (posed(scene, c) for c in (EQUATIONS, WEIGHTED, WORST_RATIO))
    peaks, totals = (drawn(problem, count, 0) for problem in (worst, total))
    return {
        "rank": solve(ranks, "overlap_dp").selection.choice,
        "sum": solve(total, "overlap_dp").selection.choice,
        "worst": solve(worst, "minimax").selection.choice,
        "worst, then sum": solve_in_order([(worst, Aim.PEAK), (total, Aim.SUM)]).choice,
        "all but a tenth of the steps": least_quantile(worst, 0.1).choice,
        "robust, worst peak": solve_robust(peaks).choice,
        "robust, worst total": solve_robust(totals.under(WORST_TOTAL)).choice,
        "robust, cvar=0.9": solve_robust(totals.under(TAIL)).choice,
    }


def judged(scene: Scene, count: int, unseen: int) -> pd.DataFrame:
    """Return every plan judged by every measure."""
    ranks, total, worst = (posed(scene, c) for c in (EQUATIONS, WEIGHTED, WORST_RATIO))
    peaks, totals = (drawn(problem, unseen, UNSEEN_SEED) for problem in (worst, total))
    steps = [(c.moves, worst.step_costs(c)) for c in worst.evaluation.steps]

    def tenth(choice: Choice) -> float:
        costs = np.sort([costs[tuple(choice[m] for m in moves)] for moves, costs in steps])
        return float(costs[::-1][int(0.1 * len(costs) + 1e-9)])

    return pd.DataFrame(
        {
            "plan": name,
            "ranks": ranks.sums.cost(choice),
            "sum": total.sums.cost(choice),
            "worst": worst.peaks.worst(choice),
            "tenth": tenth(choice),
            "unseen_peak": WORST_PEAK.value(peaks.values(choice, Aim.PEAK)),
            "unseen_peak_median": float(np.median(peaks.values(choice, Aim.PEAK))),
            "unseen_total": WORST_TOTAL.value(totals.values(choice, Aim.SUM)),
            "unseen_tail": TAIL.value(totals.values(choice, Aim.SUM)),
        }
        for name, choice in plans(scene, count).items()
    )
