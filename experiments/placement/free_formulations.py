"""Claim: all exact formulations of a free schedule or a loop that end in time find the same plan.

Time is a minute. For a free schedule of 25 bricks a linear program takes at least twice and an
integer program twenty times as long as the search by thresholds, or it does not end. Of the exact
ones that search computes the fewest responses where the worst step counts. In a loop formulations
of states and of layers have one smallest worst step; their sums count different steps.

Method, ``free`` and ``loop``: the arch of the paper, shorter and longer ones of its shape up to 145
bricks, three robots, criterion `worst-ratio-published`, the smallest worst step and then the fewest
steps, and the least sum. Each formulation solves a problem posed anew, in a process of its own with
at most 6 GB, responses among its processor time; of those that take less than a second the best of
three rounds counts. What does not end in its minute is not asked on longer arches. What a minute
leaves open is the gap that a formulation claims itself; others are proven, up to 97 bricks.

Inputs: the shipped scenes. Command: ``python -m experiments.placement.free_formulations [--quick]
[--only PART] [--sizes NAMES]``; with ``--sizes`` stored rows of other arches stay.
"""

import resource
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from functools import partial
from multiprocessing import get_context

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Finding, Option, Options, Times, on_this_run
from experiments.harness.results import stored
from experiments.harness.runs import scene_named
from seqopt import CRITERIA, FreeRules, Plan, build_network, pose, solve, three_robot_loop
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import TimeUpError
from seqopt.graph.formulation import Formulation, FormulationKind, find_formulation, formulations
from seqopt.graph.layers.compiled import compile_layers
from seqopt.graph.source import CANDIDATES, STATES
from seqopt.plan.pose import graph_of
from seqopt.problem.problem import Aim

SIZES = ("chain7", "chain11", "chain15", "arch25", "chain49", "chain97", "chain145")
AIMS = {"minmax,steps": Aim.PEAK, "sum": Aim.SUM}
PATIENCE, SHORT = 60.0, 1.0  # s after which one is stopped; below which it is run three times
MOST_TIME, MOST_MEMORY = 300, 6 * 2**30  # s of the processor and bytes of a process
PROVEN = 97  # bricks up to which the judge proves plans over states
SEARCH, SLOWER = "schedule_search", {"flow_lp": 2.0, "flow_mip": 20.0}  # on so many bricks:
ON = 25
CLOSE = 1e-6
COLUMNS = [
    *("bricks", "aim", "formulation", "graph", "kind", "status", "seconds", "value", "steps"),
    *("bound", "gap", "models", "states"),
]
ENDED = ("optimal", "unproven")  # the latter: what is claimed is left as it is


def run(part: str, scene: str, aim: str, formulation: Formulation) -> tuple[Plan, float]:
    """Return the plan of a formulation for a problem of which nothing is computed, and its time."""
    engine = ComplianceEngine(build_network(scene_named(scene)))
    moves = FreeRules() if part == "free" else three_robot_loop(engine.network)
    goals = aim if formulation.of_states else ()
    problem = pose(engine, moves, CRITERIA["worst-ratio-published"], goals)
    start = time.process_time()
    graph = graph_of(problem, STATES if formulation.of_states else CANDIDATES)
    if formulation.aim:
        graph = compile_layers(graph, formulation.aim, alone=formulation.alone).instance
    found = formulation.solve(graph, seconds=PATIENCE)
    seconds = time.process_time() - start
    layers, bricks = not formulation.of_states, len(engine.network.scene.bricks)
    proof = layers or (not found.stopped and bricks <= PROVEN)
    told = replace(formulation, solve=lambda *_, **__: found)
    return solve(problem, told, proof=proof), seconds


def row(part: str, scene: str, aim: str, name: str, rounds: int = 3) -> dict[str, object]:
    formulation = find_formulation(name)
    plan, first = run(part, scene, aim, formulation)
    again = rounds - 1 if first < SHORT else 0
    times = [first, *(run(part, scene, aim, formulation)[1] for _ in range(again))]
    chosen, proof = plan.selection, plan.certificate
    value, bound = chosen.objective[0], chosen.bound[0]
    bound = bound if proof is None or chosen.stopped else proof.bounds[0]
    out = {"status": str(plan.status), "seconds": min(times), "value": value}
    out |= {"steps": len(plan.steps), "bound": bound, "gap": (value - bound) / value}
    return out | {"models": plan.models, "states": sum(map(len, chosen.visited))}


def limited() -> None:
    """Let this process have so much memory, and watches in it count its processor's time."""
    time.perf_counter = time.process_time
    resource.setrlimit(resource.RLIMIT_CPU, (MOST_TIME, MOST_TIME))
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))


def alone(*case: str) -> dict[str, object]:
    """Return the row of a process of its own; what ends without an answer says how."""
    with ProcessPoolExecutor(1, get_context("fork"), limited) as pool:
        try:
            return pool.submit(row, *case).result()
        except (BrokenProcessPool, TimeUpError):
            return {"status": "out of time", "seconds": MOST_TIME}
        except MemoryError:
            return {"status": "out of memory", "seconds": np.nan}


def asked(part: str, aim: str) -> dict[str, Formulation]:
    """Return the formulations of states, and of a loop those of layers with the same aim."""
    some = {name: f for name, f in formulations("goals").items() if f.of_states}
    layers = {name: f for name, f in formulations("costs").items() if f.aim is AIMS[aim]}
    return some | layers if part == "loop" else some


def agree(table: pd.DataFrame) -> bool:
    ended = (table["kind"] == FormulationKind.EXACT.value) & table["status"].isin(ENDED)
    by = ["bricks", "aim", "graph"]
    exact = table[ended].groupby(by)
    values, steps = exact["value"], exact["steps"]
    same = (values.max() <= values.min() * (1 + CLOSE)) & (steps.max() == steps.min())
    worst = table.merge(values.max().rename("worst").reset_index(), on=by)
    return bool(same.all() and (~(worst["value"] < worst["worst"] * (1 - CLOSE))).all())


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
    exact = table["status"].isin(ENDED) & (table["kind"] == FormulationKind.EXACT.value)
    models = table[exact & (table["aim"] != "sum")].pivot_table("models", "bricks", "formulation")
    return bool((models.min(axis=1) == models[SEARCH]).all())


def loop_holds(table: pd.DataFrame) -> bool:
    """Return whether exact ones agree, and states and layers on the smallest worst step."""
    exact = table["status"].isin(ENDED) & (table["kind"] == FormulationKind.EXACT.value)
    peaks = table[exact & (table["aim"] != "sum")].groupby("bricks")["value"]
    return agree(table) and bool((peaks.max() <= peaks.min() * (1 + CLOSE)).all())


def holds(table: pd.DataFrame) -> bool:
    return agree(table) and slower(table) and fewest(table)


def late(rows: pd.DataFrame, bricks: int) -> set[tuple[str, str]]:
    """Return aims and formulations, not heuristic ones, that did not end on a shorter arch."""
    open_ends = ~rows["status"].isin(ENDED) & (rows["kind"] != FormulationKind.HEURISTIC.value)
    shorter = rows[open_ends & (rows["bricks"] < bricks)]
    return {*zip(shorter["aim"], shorter["formulation"], strict=True)}


def experiment(part: str, options: Options) -> Finding:
    named = options.sizes.split(",") if options.sizes else SIZES
    solved = partial(row, rounds=1) if options.quick else alone
    table = stored(f"{part}_formulations") if options.sizes else pd.DataFrame(columns=COLUMNS)
    for scene in SIZES[:1] if options.quick else named:
        bricks, rows = len(scene_named(scene).bricks), []
        for aim in AIMS:
            for name, formulation in asked(part, aim).items():
                base = {"bricks": bricks, "aim": aim, "formulation": name}
                base |= {"graph": "states" if formulation.of_states else "layers"}
                base |= {"kind": formulation.kind.value}
                if (aim, name) not in late(table, bricks):
                    rows.append(base | solved(part, scene, aim, name))
                    print(*rows[-1].values(), flush=True)
        new, old = pd.DataFrame(rows), table[table["bricks"] != bricks]
        table = pd.concat([old, new]) if len(old) else new
    table = table[COLUMNS].sort_values("bricks", kind="stable")
    good = holds(table) if part == "free" else loop_holds(table)
    return on_this_run(holds=good, **{f"{part}_formulations": table})


def free(options: Options) -> Finding:
    return experiment("free", options)


def loop(options: Options) -> Finding:
    return experiment("loop", options)


CLAIM = Claim(
    {"free": free, "loop": loop},
    quick="seven bricks in one round, nothing written",
    times=Times.SHOWN,
    options=(Option("--sizes", "some arches alone, as chain145 or arch25,chain49", ""),),
    digits=9,
)

if __name__ == "__main__":
    CLAIM.main()
