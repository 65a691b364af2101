"""Claim: all exact formulations of the free schedule that end within a minute find the same plan.

From 11 bricks on the programs of a solver take at least three times as long as the search by
thresholds, and on 25 bricks ten times, or they do not end. Of the exact ones that search computes
the fewest responses where the worst step counts.

Method: the arch of the paper and shorter ones of its shape, three robots, criterion
`worst-ratio-published`, the smallest worst step and then the fewest steps, and the least sum. Each
formulation solves a problem posed anew, in one process, responses among its processor time; of
those that take less than five seconds the best of three rounds counts. What a minute leaves open is
the gap that a formulation claims itself; of others the gap is proven.

Inputs: the shipped scenes. Command: ``python -m experiments.placement.free_formulations
[--quick]``. Writes ``experiments/results/free_formulations.csv``.
"""

from __future__ import annotations

import time
from dataclasses import replace

import pandas as pd

from experiments.harness.claim import Claim, Finding, Options, Times, on_this_run
from experiments.harness.results import RESULTS
from experiments.harness.runs import scene_named
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.placement.formulation import FormulationKind
from seqopt.placement.free_plan import FreePlan
from seqopt.placement.free_problem import pose_free
from seqopt.placement.schedule_formulation import (
    Finds,
    find_schedule_formulation,
    schedule_formulation_names,
)
from seqopt.placement.solving import solve
from seqopt.sequence.free_rules import FreeRules
from seqopt.study.presets import CRITERIA

SIZES = ("chain7", "chain11", "chain15", "arch25")
AIMS = ("minmax,steps", "sum")
PATIENCE, SHORT = 60.0, 5.0  # s after which one is stopped; below which it is run three times
SEARCH, PROGRAMS = "schedule_search", ("flow_lp", "flow_mip")
SLOWER = {11: 3.0, 25: 10.0}  # how many times as long programs take, from a brick count on
CLOSE = 1e-6


def run(scene: str, aim: str, name: str) -> tuple[FreePlan, float]:
    """Return the plan of a formulation for a problem of which nothing is computed, and its time."""
    engine = ComplianceEngine(build_network(scene_named(scene)))
    problem = pose_free(engine, FreeRules(), CRITERIA["worst-ratio-published"], aim)
    formulation = find_schedule_formulation(name)
    start = time.process_time()
    found = formulation.solve(problem, seconds=PATIENCE)
    seconds = time.process_time() - start
    return solve(problem, replace(formulation, solve=lambda _: found)), seconds


def row(scene: str, aim: str, name: str, rounds: int) -> dict[str, object]:
    """Return how a formulation does."""
    plan, first = run(scene, aim, name)
    times = [first, *(run(scene, aim, name)[1] for _ in range(1, rounds if first < SHORT else 1))]
    chosen, proof = plan.selection, plan.certificate
    value, bound = chosen.objective[0], chosen.bound[0]
    if proof is not None and not chosen.stopped:
        bound = proof.bound[0]
    return {
        "bricks": len(plan.problem.network.scene.bricks),
        "aim": aim,
        "formulation": name,
        "kind": plan.formulation.kind.value,
        "status": plan.status,
        "seconds": min(times),
        "value": value,
        "steps": len(plan.steps),
        "bound": bound,
        "gap": (value - bound) / value,
        "models": plan.problem.models,
        "states": sum(map(len, chosen.visited)),
    }


def agree(table: pd.DataFrame) -> bool:
    """Return whether exact ones that ended have the same values, and no plan is better."""
    best = table[table["formulation"] == SEARCH]
    both = table.merge(best, on=["bricks", "aim"], suffixes=("", "_best"))
    off = both["value"] / both["value_best"] - 1
    ended = (both["kind"] == FormulationKind.EXACT.value) & (both["status"] == "optimal")
    same = (off.abs() <= CLOSE) & ((both["steps"] == both["steps_best"]) | (both["aim"] == "sum"))
    return bool((off >= -CLOSE).all() and same[ended].all())


def slower(table: pd.DataFrame) -> bool:
    """Return whether programs are as much slower than the search as is claimed, or do not end."""
    times = table.pivot_table("seconds", ["bricks", "aim"], "formulation")
    ratios = times[[*PROGRAMS]].div(times[SEARCH], axis=0)
    own = ratios[table.pivot_table("gap", ["bricks", "aim"], "formulation")[[*PROGRAMS]] <= CLOSE]
    bricks = own.index.get_level_values("bricks")
    return all(not (own[bricks >= least] < most).any(axis=None) for least, most in SLOWER.items())


def fewest(table: pd.DataFrame) -> bool:
    """Return whether the search computes the fewest responses of exact ones, where peaks count."""
    mine = table[(table["aim"] != "sum") & (table["kind"] == FormulationKind.EXACT.value)]
    models = mine.pivot_table("models", "bricks", "formulation")
    return bool((models.min(axis=1) == models[SEARCH]).all())


def holds(table: pd.DataFrame) -> bool:
    """Return whether all that is claimed is so."""
    return agree(table) and slower(table) and fewest(table)


def experiment(options: Options) -> Finding:
    names = schedule_formulation_names(Finds.PLAN)
    sizes, rounds = (SIZES[:1], 1) if options.quick else (SIZES, 3)
    rows = []
    for scene in sizes:
        for aim in AIMS:
            rows += [row(scene, aim, name, rounds) for name in names]
    table = pd.DataFrame(rows)
    print(table.to_string(index=False, float_format="%.4g"))
    if not options.quick:
        table.to_csv(RESULTS / "free_formulations.csv", index=False, float_format="%.9g")
    return on_this_run(holds=holds(table))


CLAIM = Claim(experiment, quick="seven bricks, nothing written", times=Times.SHOWN)

if __name__ == "__main__":
    CLAIM.main()
