"""Claim: all exact formulations of the free schedule that end within a minute find the same plan.

On 25 bricks a linear program takes at least twice and an integer program twenty times as long as
the search by thresholds, or it does not end. Of the exact ones that search computes the fewest
responses where the worst step counts.

Method: the arch of the paper, shorter and longer ones of its shape, three robots, criterion
`worst-ratio-published`, the smallest worst step and then the fewest steps, and the least sum. Each
formulation solves a problem posed anew, in one process, responses among its processor time; of
those that take less than five seconds the best of three rounds counts. What a minute leaves open is
the gap that a formulation claims itself; of others the gap is proven.

Inputs: the shipped scenes. Command: ``python -m experiments.placement.free_formulations
[--quick]``.
"""

import time
from dataclasses import replace
from itertools import product

import pandas as pd

from experiments.harness.claim import Claim, Finding, Options, Times, on_this_run
from experiments.harness.runs import scene_named
from seqopt import CRITERIA, FreeRules, Plan, build_network, solve
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.graph.states.states import build_states
from seqopt.plan.calling.formulation import FormulationKind, On, find_formulation, formulation_names

SIZES = ("chain7", "chain11", "chain15", "arch25", "chain49", "chain97")
AIMS = ("minmax,steps", "sum")
PATIENCE, SHORT = 60.0, 5.0  # s after which one is stopped; below which it is run three times
SEARCH, SLOWER = "schedule_search", {"flow_lp": 2.0, "flow_mip": 20.0}  # on so many bricks:
ON = 25
CLOSE = 1e-6


def run(scene: str, aim: str, name: str) -> tuple[Plan, float]:
    """Return the plan of a formulation for a problem of which nothing is computed, and its time."""
    engine = ComplianceEngine(build_network(scene_named(scene)))
    problem = build_states(engine, FreeRules(), CRITERIA["worst-ratio-published"], aim)
    formulation = find_formulation(name)
    start = time.process_time()
    found = formulation.solve(problem, seconds=PATIENCE)
    seconds = time.process_time() - start
    return solve(problem, replace(formulation, solve=lambda _: found)), seconds


def row(scene: str, aim: str, name: str, rounds: int) -> dict[str, object]:
    plan, first = run(scene, aim, name)
    times = [first, *(run(scene, aim, name)[1] for _ in range(1, rounds if first < SHORT else 1))]
    chosen, proof = plan.selection, plan.certificate
    value, bound = chosen.objective[0], chosen.bound[0]
    bound = bound if proof is None or chosen.stopped else proof.bound
    out = {"bricks": len(plan.engine.network.scene.bricks), "aim": aim, "formulation": name}
    out |= {"kind": plan.formulation.kind.value, "status": plan.status, "seconds": min(times)}
    out |= {"value": value, "steps": len(plan.steps), "bound": bound}
    out |= {"gap": (value - bound) / value, "models": plan.models}
    return out | {"states": sum(map(len, chosen.visited))}


def agree(table: pd.DataFrame) -> bool:
    ended = (table["kind"] == FormulationKind.EXACT.value) & (table["status"] == "optimal")
    exact = table[ended].groupby(["bricks", "aim"])
    values, steps = exact["value"], exact["steps"]
    same = (values.max() <= values.min() * (1 + CLOSE)) & (steps.max() == steps.min())
    worst = table.merge(values.max().rename("worst").reset_index(), on=["bricks", "aim"])
    return bool(same.all() and (worst["value"] >= worst["worst"] * (1 - CLOSE)).all())


def slower(table: pd.DataFrame) -> bool:
    on = table[table["bricks"] == ON]
    times = on.pivot_table("seconds", "aim", "formulation")
    ended = on[on["status"] == "optimal"].groupby(["aim", "formulation"]).size()
    return all(
        (aim, name) not in ended or times.loc[aim, name] >= least * times.loc[aim, SEARCH]
        for name, least in SLOWER.items()
        for aim in times.index
    )


def fewest(table: pd.DataFrame) -> bool:
    mine = table[(table["aim"] != "sum") & (table["kind"] == FormulationKind.EXACT.value)]
    models = mine.pivot_table("models", "bricks", "formulation")
    return bool((models.min(axis=1) == models[SEARCH]).all())


def holds(table: pd.DataFrame) -> bool:
    return agree(table) and slower(table) and fewest(table)


def experiment(options: Options) -> Finding:
    names = formulation_names(On.STATES)
    sizes, rounds = (SIZES[:1], 1) if options.quick else (SIZES, 3)
    rows: list[dict[str, object]] = []
    late = set[tuple[str, str]]()
    for scene, *way in product(sizes, AIMS, names):
        if tuple(way) not in late:
            rows.append(row(scene, *way, rounds))
            late |= {tuple(way)} if rows[-1]["seconds"] > 0.9 * PATIENCE else set()
    table = pd.DataFrame(rows)
    print(table.to_string(index=False, float_format="%.4g"))
    return on_this_run(holds=holds(table), free_formulations=table)


CLAIM = Claim(experiment, quick="seven bricks, nothing written", times=Times.SHOWN, digits=9)

if __name__ == "__main__":
    CLAIM.main()
