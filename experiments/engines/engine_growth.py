"""Claim: memory grows at most as the square of the brick count, and answers stay exact to 1e-9.

Exponents up to 2.1 for memory count as that. Time: up to 2.5 for an analysis, up to 3 for a search
without proof, which meets as many models as the square of the brick count, each with fields as long
as that count; the proof over all pairs is shown.
An analysis of barrel vaults of 735 to 3,010 bricks, whose courses are equally long, takes time as
a power of at most 2 and memory as a power of at most 1.2: every step has responses of every brick.
Their factors alone, block by block, take time and memory as powers of at most 1.5.
Edge forces of the steps of every plan err by at most 1e-9 of the largest of each grip set, and by
1e-6 where candidates are only compared.

Method: `analyze` of all steps of the sequential method, and the three-robot loop
without proof (criterion `equations-2-3`, cascade; also with two processes) and with proof
(overlap_dp), on chains of 25 to 1,000 bricks in the shape of `arch25`, on `vault338` and vaults
from words. Every run has a process of its own; seconds of the
core are counted, by the clock where two processes work. Errors are those against the refined mixed
system at up to forty steps of the plan, and at random sets of three grips as they are screened.
Exponents are fitted over 100 bricks and more; of memory what the smallest run takes is taken off,
libraries above all.

Inputs: the shipped scenes; seed 0.
"""

import json
import resource
import sys
import time
from collections.abc import Sequence
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import seqopt
from experiments.harness.charts import subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import apart, drawn, exponents_by
from experiments.harness.scenes import scene_named
from seqopt.engines.interface import Engine, Want
from seqopt.engines.rigid._mixed import solve_mixed
from seqopt.report._style import GRAY, dress, looks, plain, styled
from seqopt.responses import Resources
from seqopt.sequence.steps import Step
from seqopt.study import EQUATIONS

Done = tuple[Engine, Sequence[Step], int]
LOOKED_AT, OF_LARGE = 40, 6  # steps of a run, and brick counts, whose errors are looked at
SETS = 5  # random grip sets at each of these


def analyzed(network: seqopt.Network) -> Done:
    """Analyze the steps of the sequential method; a model each."""
    engine, steps = seqopt.make_engine("compliance", network), seqopt.sequential(network)
    return engine, steps, len(seqopt.analyze(engine, steps))


def factored(network: seqopt.Network) -> Done:
    """Eliminate blocks up to the whole structure, and answer the last step of the sequence."""
    engine, steps = seqopt.make_engine("compliance", network), seqopt.sequential(network)
    return engine, steps[-1:], len(seqopt.analyze(engine, steps[-1:]))


def searched(network: seqopt.Network, **more: object) -> Done:
    engine, schedule = seqopt.make_engine("compliance", network), seqopt.three_robot_loop(network)
    plan = seqopt.solve(seqopt.pose(engine, schedule, EQUATIONS, **more), "cascade", proof=False)
    return engine, plan.steps, plan.models


def proven(network: seqopt.Network) -> Done:
    """Choose the grips of the three-robot loop with proof, all pairs being solved."""
    engine, schedule = seqopt.make_engine("compliance", network), seqopt.three_robot_loop(network)
    plan = seqopt.solve(seqopt.pose(engine, schedule, EQUATIONS), "overlap_dp")
    return engine, plan.steps, plan.models


TASKS = {
    "analyze": analyzed,
    "factors": factored,
    "no proof": searched,
    "no proof, two processes": partial(searched, resources=Resources(workers=2)),
    "proof": proven,
}


def errors(engine: Engine, steps: Sequence[Step]) -> dict[str, float]:
    """Return the largest errors of edge forces, over the largest of each set.

    Against the refined mixed system, one grip set at a time: ``error`` in steps of the plan, and
    ``screen_error`` of what candidates are chosen by, at random grip sets of three.
    """
    network, random = engine.network, np.random.default_rng(7)

    def largest(bricks: int, sets: np.ndarray, want: Want) -> float:
        wanted, index = network.index_of_grip
        exact = solve_mixed(network, bricks, index[np.searchsorted(wanted, sets)]).edge_force
        off = np.abs(engine.solve(bricks, sets, want).edge_force - exact).max(axis=1)
        return float((off / np.abs(exact).max(axis=1)).max())

    count = LOOKED_AT if len(network.inner) <= LARGE else OF_LARGE
    picked = np.unique(np.linspace(0, len(steps) - 1, count).astype(int))
    of_plan = [
        largest(steps[i].bricks, np.array([steps[i].held], dtype=int), Want.EDGES) for i in picked
    ]
    counts = np.unique(np.linspace(3, len(network.inner), count).astype(int))
    of_screens = []
    for bricks in counts:
        nodes = np.array([brick.nodes for brick in network.scene.placed[:bricks]]).ravel()
        free = np.setdiff1d(nodes, network.scene.blocked_nodes)
        sets = np.array([random.choice(free, 3, replace=False) for _ in range(SETS)])
        of_screens.append(largest(int(bricks), sets, Want.EDGES | Want.SCREEN))
    return {"error": max(of_plan), "screen_error": max(of_screens)}


def run(task: str, name: str) -> dict[str, object]:
    scene = scene_named(name) if name.startswith("chain") else seqopt.load_scene(name)
    start, clock = time.process_time(), time.perf_counter()
    engine, steps, models = TASKS[task](seqopt.build_network(scene))
    row = {
        "task": task,
        "scene": name,
        "bricks": len(scene.bricks),
        "models": models,
        "seconds": time.process_time() - start,
        "clock_s": time.perf_counter() - clock,
        "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    return row | errors(engine, steps)


SHORT = ["chain25", "chain50", "chain100"]
LONG = [*SHORT, "chain200", "chain338", "vault338"]
VAULTS = [f"vault:span={2 * rise:g},rise={rise:g},columns=35" for rise in (0.75, 1.5, 3.0)]
LARGE = 1000  # bricks
SCENES = {
    "analyze": [*LONG, "chain1000", *VAULTS],
    "factors": VAULTS,
    "no proof": LONG,
    "no proof, two processes": LONG,
    "proof": SHORT,
}
QUICK = {"analyze": ["chain13"], "proof": ["chain13"]}
FROM = 100  # bricks from which on exponents are fitted
MOST_MEMORY = 2.1  # exponents that are claimed
MOST_TIME = {"analyze": 2.5, "no proof": 3.0}
MOST_OF_VAULTS = {"analyze": (2.0, 1.2), "factors": (1.5, 1.5)}  # of time and memory
MOST_ERROR, MOST_SCREEN_ERROR = 1e-9, 1e-6  # of the largest edge force of a set
STYLES = {
    "analyze": "analysis of a sequence",
    "factors": "growth of its factors alone",
    "no proof": "search without proof",
    "no proof, two processes": "search without proof, two processes",
    "proof": "proof over all pairs",
}  # in words


def exponents(
    table: pd.DataFrame, column: str, least: float = 0.0, kind: str = "chain"
) -> dict[str, float]:
    """Return the slopes over the brick counts of chains, by task; what is least is taken off."""
    mine = table[table["scene"].str.startswith(kind) & (table["bricks"] >= FROM)]
    return exponents_by("task", mine, mine[column] - least)


def taken(rows: pd.DataFrame) -> pd.Series:
    """Return the seconds of the core, or by the clock where two processes work."""
    return rows["seconds"].where(~rows["task"].str.contains("two"), rows["clock_s"])


@styled
def growth_chart(table: pd.DataFrame) -> Figure:
    figure, panels = subplots(4.2, 1, 2)
    columns = {"time of a processor [s]": taken(table), "peak memory [MB]": table["memory_MB"]}
    for axes, (label, values) in zip(panels, columns.items(), strict=True):
        for task, style in looks(STYLES).items():
            mine, vaults = table["task"] == task, table["scene"].str.startswith("vault")
            own, vault = mine & ~vaults, mine & vaults
            axes.plot(table["bricks"][own], values[own], label=STYLES[task], **style.line())
            axes.plot(table["bricks"][vault], values[vault], "*", color=style.color, ms=9)
        axes.set(xscale="log", yscale="log", xlabel="bricks in the chain", ylabel=label)
        plain(axes.xaxis, axes.yaxis)
        dress(axes)
    panels[0].plot([], [], "*", color=GRAY, ms=9, label="vaults, by color")
    figure.legend(*panels[0].get_legend_handles_labels(), ncols=2, loc="outside lower center")
    return figure


def holds(table: pd.DataFrame) -> bool:
    memory = exponents(table, "memory_MB", float(table["memory_MB"].min()))
    seconds = exponents(table, "seconds")
    small = all(memory.get(task, 0.0) <= MOST_MEMORY for task in MOST_TIME)
    fast = all(seconds.get(task, 0.0) <= most for task, most in MOST_TIME.items())
    least = {"seconds": 0.0, "memory_MB": float(table["memory_MB"].min())}
    fast &= all(
        exponents(table, column, least[column], "vault:").get(task, 0.0) <= most
        for task, both in MOST_OF_VAULTS.items()
        for column, most in zip(least, both, strict=True)
    )
    exact = table["error"].max() <= MOST_ERROR and table["screen_error"].max() <= MOST_SCREEN_ERROR
    return bool(table["seconds"].notna().all() and small and fast and exact)


def experiment(options: Options) -> Finding:
    module, scenes = "experiments.engines.engine_growth", QUICK if options.quick else SCENES
    runs = ((task, name) for task, names in scenes.items() for name in names)
    table = pd.DataFrame(apart(module, *run) for run in runs)
    print(table.to_string(index=False, float_format="%.3g"))
    print("exponents of time", exponents(table, "seconds"))
    print("of memory", exponents(table, "memory_MB", table["memory_MB"].min()))
    print("of vaults", exponents(table, "seconds", kind="vault:"))
    return Finding(holds(table), tables={"engine_growth_runs": table})


CLAIM = Claim(
    experiment,
    digits=4,
    quick="small sizes",
    timed=True,
    pictures={"growth.png": drawn(growth_chart, "engine_growth_runs")},
)

if __name__ == "__main__":
    print(json.dumps(run(*sys.argv[1:3])))
