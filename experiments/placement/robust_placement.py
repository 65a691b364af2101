"""Claim: plans made for many scenarios keep peaks low in others, but gain little in totals.

Method: the three-robot loop on `arch25`. Scenarios multiply the stiffness of every joint by
log-uniform factors between 1/3 and 3 (translational and rotational apart), change every brick's
density by up to 10 % and move every brick and joint by up to 2 mm along every axis. A plan is made
for 10, 30 or 100 scenarios of one of three seeds, and judged on 100 others of one further seed,
which no plan is made for, beside the nominal plan and the plan that knows each scenario. Aims:
worst peak under ``worst-ratio-published``, worst total and mean total of the worst tenth and half
under ``weighted-published``. Last, plans of eight ways to say what is good are judged by all
measures.

The claim holds if every plan is optimal over its scenarios, by weights or by search; with 30 or
more the worst peak over unseen scenarios is at most nine tenths of the nominal plan's for every
seed, at a price of at most a quarter in the nominal scene; totals over unseen scenarios are within
3 % of the nominal plan's; no plan beats the one that knows each scenario. These bounds were set
after a first look at two of the seeds and 60 unseen scenarios. One arch is one arch, and how far
scenarios spread is taken, not measured.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import repeat
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.charts import subplots, ticks
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.layers import LayeredCosts, Layers, best_in_order, cost_layers
from experiments.harness.results import drawn, stored
from experiments.harness.scenes import half_circle
from seqopt import Plan, Scene, build_network, load_scene, make_engine, scenarios, solve
from seqopt.arrays import Floats
from seqopt.graph.states import States, over_scenarios
from seqopt.plan.solve import graph_of, pose
from seqopt.problem.criteria import Criterion
from seqopt.problem.problem import WORST_PEAK, WORST_TOTAL, Aim, Problem, RobustAim, cvar
from seqopt.report._style import BLUE, GRAY, VERMILION, dress, styled
from seqopt.sequence.methods import three_robot_loop
from seqopt.study import EQUATIONS, WEIGHTED, WORST_RATIO

Choice = tuple[int, ...]


def least_quantile(layers: Layers, share: float = 0.1) -> Choice:
    """Return the choice with the least level that no more than a share of open steps exceed.

    Of those that keep it one with the fewest steps above, and then of least sum.
    """
    most = math.floor(share * len(layers.steps) + 1e-9)
    levels = np.unique(np.concatenate([costs[np.isfinite(costs)] for _, costs in layers.steps]))

    def above(level: float) -> LayeredCosts:
        """Return how many steps of a choice cost more, infinite where not allowed."""
        counts = [
            (moves, np.where(np.isfinite(costs), costs > level, np.inf))
            for moves, costs in layers.steps
        ]
        return layers.joined(np.add, counts)

    def kept(level: float) -> bool:
        return above(level).least(Aim.SUM) <= most

    level = float(levels[bisect_left(levels, x=True, hi=len(levels) - 1, key=kept)])
    return best_in_order([(above(level), Aim.SUM), (layers.sums, Aim.SUM)])


AIMS: dict[RobustAim, Criterion] = {
    WORST_PEAK: WORST_RATIO,
    WORST_TOTAL: WEIGHTED,
    cvar(0.9): WEIGHTED,
    cvar(0.5): WEIGHTED,
}
UNSEEN_SEED = 1000  # no plan is made with it
TAIL = cvar(0.9)


class Effort(NamedTuple):
    """How many scenarios there are, and how often."""

    counts: tuple[int, ...]
    seeds: int
    unseen: int


def posed(scene: Scene, criterion: Criterion) -> Problem:
    engine = make_engine("compliance", build_network(scene))
    return pose(engine, three_robot_loop(engine.network), criterion)


def over_draws(problem: Problem, count: int, seed: int) -> States:
    """Return the states over so many scenarios, whose peaks or totals count by the criterion."""
    over = WORST_PEAK if problem.criterion.name == WORST_RATIO.name else WORST_TOTAL
    some = scenarios(problem.scene, count=count, seed=seed).scenes
    return over_scenarios(graph_of(problem, over.aim), some, over)


def of_scenarios(graph: States) -> list[LayeredCosts]:
    """Return what candidates cost in every scenario, as its aim counts."""
    found = map(cost_layers, graph.each)
    return [own.sums if graph.over.aim is Aim.SUM else own.peaks for own in found]


def values(aim: Aim, every: Sequence[LayeredCosts], choices: Iterable[Choice]) -> Floats:
    """Return the value of a choice in every scenario, infinite where it exceeds a limit."""
    pairs = zip(every, choices, strict=False)
    return np.array([(c.cost if aim is Aim.SUM else c.worst)(choice) for c, choice in pairs])


def best(costs: LayeredCosts, aim: Aim) -> Choice:
    return best_in_order([(costs, aim), (costs, Aim.SUM)])


def made(scene: Scene, effort: Effort) -> Iterator[dict[str, object]]:
    for criterion in (WORST_RATIO, WEIGHTED):
        problem = posed(scene, criterion)
        alone = cost_layers(problem)
        nominal = alone.peaks if criterion is WORST_RATIO else alone.sums
        unseen = of_scenarios(over_draws(problem, effort.unseen, UNSEEN_SEED))
        for seed in range(effort.seeds):
            most = over_draws(problem, max(effort.counts), seed)
            sets = {"nominal": (nominal,), "optimized": of_scenarios(most), "unseen": unseen}
            for aim in (aim for aim, own in AIMS.items() if own is criterion):
                for count in effort.counts:
                    some = replace(most, over=aim, scenarios=most.scenarios[:count])
                    row = {"aim": str(aim), "criterion": criterion.name, "seed": seed}
                    seen = sets | {"optimized": sets["optimized"][:count]}
                    yield row | {"scenarios": count} | measured(some, seen)


def measured(graph: States, sets: Mapping[str, Sequence[LayeredCosts]]) -> dict[str, object]:
    """Return the objective of the plan of a graph where it was made and elsewhere, beside two more.

    Those are the exact optimum of the nominal scene, and the best plan of each scenario alone.
    """
    plan, aim = solved(graph), graph.over.aim
    proof = plan.certificate
    assert proof is not None
    row = {"objective": proof.objective, "gap": proof.claimed_gap, "gap_by_weights": proof.gap}
    nominal = best(sets["nominal"][0], aim)
    for name, found in sets.items():
        choices = {"robust": repeat(plan.choice), "nominal": repeat(nominal)}
        for who, each in {**choices, "knows_it": (best(own, aim) for own in found)}.items():
            row[f"{name}_{who}"] = graph.over.value(values(aim, found, each))
    return {**row}


def solved(graph: States) -> Plan:
    return solve(graph, "overlap_dp" if graph.totals else "minimax")


def judged(scene: Scene, count: int, unseen: int) -> pd.DataFrame:
    asked = [posed(scene, criterion) for criterion in (EQUATIONS, WEIGHTED, WORST_RATIO)]
    (ranks, total, worst), (_, *pair) = map(cost_layers, asked), asked
    totals, peaks = (over_draws(problem, count, 0) for problem in pair)
    plans = {
        "rank": best_in_order([(ranks.sums, Aim.SUM)]),
        "sum": best_in_order([(total.sums, Aim.SUM)]),
        "worst": solve(asked[2], "minimax").choice,
        "worst, then sum": best_in_order([(worst.peaks, Aim.PEAK), (total.sums, Aim.SUM)]),
        "all but a tenth of the steps": least_quantile(worst, 0.1),
        "robust, worst peak": solved(peaks).choice,
        "robust, worst total": solved(totals).choice,
        "robust, cvar=0.9": solved(replace(totals, over=TAIL)).choice,
    }
    sums, high = (of_scenarios(over_draws(problem, unseen, UNSEEN_SEED)) for problem in pair)

    def tenth(choice: Choice) -> float:
        costs = np.sort([c[tuple(choice[m] for m in moves)] for moves, c in worst.steps])
        return float(costs[::-1][int(0.1 * len(costs) + 1e-9)])

    rows = []
    for name, choice in plans.items():
        peak = values(Aim.PEAK, high, repeat(choice))
        each = values(Aim.SUM, sums, repeat(choice))
        row = {"plan": name, "ranks": ranks.sums.cost(choice), "sum": total.sums.cost(choice)}
        row |= {"worst": worst.peaks.worst(choice), "tenth": tenth(choice)}
        row |= {"unseen_peak": WORST_PEAK.value(peak), "unseen_peak_median": float(np.median(peak))}
        row |= {"unseen_total": WORST_TOTAL.value(each), "unseen_tail": TAIL.value(each)}
        rows.append(row)
    return pd.DataFrame(rows)


TITLES = {
    "worst-peak": "worst step, worst scenario",
    "worst-total": "sum, worst scenario",
    "cvar=0.9": "sum, mean of the worst tenth",
}


@styled
def chart(table: pd.DataFrame) -> Figure:
    figure, panels = subplots(3.4, 1, len(TITLES))
    for panel, (aim, title) in zip(panels, TITLES.items(), strict=True):
        rows = table[table["aim"] == aim]
        mean, first = rows.groupby("scenarios")["unseen_robust"].mean(), rows.iloc[0]
        look = {"color": BLUE, "mfc": "white", "label": "robust plan, each draw"}
        panel.plot(rows["scenarios"], rows["unseen_robust"], "o", **look)
        panel.plot(mean.index, mean, "-", color=BLUE, label="its mean")
        panel.axhline(first["unseen_nominal"], color=VERMILION, ls="--", label="nominal plan")
        look = {"color": GRAY, "ls": ":", "lw": 2, "label": "plan that knows each scenario"}
        panel.axhline(first["unseen_knows_it"], **look)
        panel.set(title=title, xlabel="scenarios the plan is made for", xscale="log")
        counts = sorted(table["scenarios"].unique())
        ticks(counts, panel.xaxis)
        panel.set_xlim(counts[0] / 1.4, counts[-1] * 1.4)
        dress(panel)
    panels[0].set_ylabel("cost in unseen scenarios")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


FULL = Effort(counts=(10, 30, 100), seeds=3, unseen=100)
QUICK = Effort(counts=(3, 6), seeds=2, unseen=5)
ENOUGH = 30  # scenarios
PEAK, PRICE, TOTAL = 0.9, 0.25, 0.03
PROVEN = 1e-6


def holds(table: pd.DataFrame) -> bool:
    enough = table[table["scenarios"] >= ENOUGH]
    peak = enough["aim"] == "worst-peak"
    peaks, totals = enough[peak], enough[~peak]
    unseen = totals["unseen_robust"] / totals["unseen_nominal"]
    known = table["unseen_knows_it"] * (1 - PROVEN)
    return bool(
        len(peaks)
        and len(totals)
        and (table["gap"] <= PROVEN).all()
        and (peaks["unseen_robust"] <= PEAK * peaks["unseen_nominal"]).all()
        and (peaks["nominal_robust"] <= (1 + PRICE) * peaks["nominal_nominal"]).all()
        and (np.abs(unseen - 1) <= TOTAL).all()
        and (table["unseen_robust"] >= known).all()
    )


def experiment(options: Options) -> Finding:
    scene = half_circle(6).scene if options.quick else load_scene("arch25")
    effort = QUICK if options.quick else FULL
    table = pd.DataFrame(made(scene, effort))
    beside = judged(scene, min(ENOUGH, max(effort.counts)), effort.unseen)
    print(table.groupby(["aim", "scenarios"], sort=False).mean(numeric_only=True).T.to_string())
    print(beside.to_string(index=False))
    if options.quick:  # six bricks say little: the stored rows are judged
        return Finding(holds(stored("robust_placement")), ": stored rows")
    tables = {"robust_placement": table, "robust_judged": beside}
    return Finding(holds(table), tables=tables)


CLAIM = Claim(
    experiment,
    digits=6,
    quick="six bricks, the stored rows judged",
    pictures={"robust_placement.png": drawn(chart, "robust_placement")},
)
