"""Claim: the free schedule is proven best within 2 GB for 145 bricks by three robots, 49 by more.

Where the finished structure is the worst step, which a first plan meets, a proof takes a second or
two. With three robots time grows at most with the power 2.5 of the brick count. Where memory ends a
plan is left, and a bound of at least half of its worst step.

Method: the smallest worst step over what the scene's own fixed methods reach, then its proof, on
arches in the shape of `arch25` with 7 to 145 bricks (twice the bricks, twice the payload), by its
three robots and further mobile ones. Every run has a process of its own on one core, and may take
1.7 GB for states, moves and responses beside what the program takes without any; seconds of that
core are counted, and the largest memory of the process. Exponents are fitted over 25 bricks and
more, where a plan is proven.
"""

import json
import resource
import sys
import time

import pandas as pd
from matplotlib.figure import Figure

import seqopt
from experiments.harness.charts import note, subplots, ticks
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import apart, drawn, exponents_by
from experiments.harness.scenes import scene_named
from seqopt.report._style import GRAY, dress, look, plain, styled
from seqopt.scene.scene import with_robots

ROOM = 1.7e9  # bytes


def run(bricks: int, robots: int) -> dict[str, object]:
    scene = with_robots(scene_named(f"chain{bricks}"), robots)
    start = time.process_time()
    search = seqopt.Search(max_memory=ROOM)
    plan = seqopt.optimize(scene, "free", engine="compliance", search=search)
    certificate = plan.certificate
    row = {"bricks": bricks, "robots": robots, "status": plan.status}
    row |= {"worst": plan.selection.objective[0], "bound": plan.selection.bound[0]}
    row |= {"steps": len(plan.steps), "models": plan.models}
    row |= {"states": 0 if certificate is None else certificate.states}
    row |= {"seconds": time.process_time() - start}
    return row | {"memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


SOME = (7, 13, 25, 37, 49, 73)
SIZES = {3: (7, 13, 25, 49, 73, 97, 145), 4: SOME, 5: (7, 13, 19, *SOME[2:])}
QUICK = {3: (7,), 4: (7,)}
SOLVED = {3: 145, 4: 49, 5: 49}  # bricks up to which a plan is proven, by robots
STEEPEST = {3: 2.5}  # exponents of time that are claimed
FROM = 25  # bricks from which on exponents are fitted
MOST = 2048.0  # MB


def exponents(table: pd.DataFrame, column: str) -> dict[int, float]:
    """Return the slopes over the brick count, by how many robots there are."""
    mine = table[(table["status"] == "optimal") & (table["bricks"] >= FROM)]
    return exponents_by("robots", mine, mine[column])


def holds(table: pd.DataFrame) -> bool:
    small = table[table["bricks"] <= table["robots"].map(SOLVED)]
    solved = bool((small["status"] == "optimal").all())
    ended = table[table["status"] != "optimal"]
    bounded = bool((ended["bound"] >= ended["worst"] / 2).all())
    steep = exponents(table, "seconds")
    slow = any(steep[robots] > most for robots, most in STEEPEST.items() if robots in steep)
    return solved and bounded and not slow and bool((table["memory_MB"] <= MOST).all())


LABELS = {
    "states": "states in the proof",
    "seconds": "time of one core [s]",
    "memory_MB": "peak memory [MB]",
}


@styled
def chart(table: pd.DataFrame) -> Figure:
    figure, parts = subplots(3.0, 1, 3)
    table = table.assign(states=table["states"].where(table["status"] == "optimal"))
    for axes, (column, label) in zip(parts, LABELS.items(), strict=True):
        for number, (robots, rows) in enumerate(table.groupby("robots")):
            style = look(number)
            axes.plot(rows["bricks"], rows[column], label=f"{robots} robots", **style.line())
            ended = rows[rows["status"] != "optimal"]
            axes.plot(ended["bricks"], ended[column], zorder=3, **style.mark(filled=False))
        axes.set(xscale="log", yscale="log", xlabel="bricks", ylabel=label)
        plain(axes.yaxis)
        ticks([7, 13, 25, 49, 145], axes.xaxis)
        dress(axes)
    parts[2].axhline(MOST, color=GRAY, lw=0.8)
    note(parts[2], "2 GB", (7, MOST), (0, -9))
    parts[0].plot([], [], "^", color=GRAY, mfc="white", label="memory ended before the proof")
    figure.legend(*parts[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def experiment(options: Options) -> Finding:
    sizes = QUICK if options.quick else SIZES
    module = "experiments.placement.free_growth"
    runs = ((bricks, robots) for robots, counts in sizes.items() for bricks in counts)
    table = pd.DataFrame(apart(module, *run) for run in runs)
    print(table.to_string(index=False, float_format="%.4g"))
    for column in ("states", "models", "seconds"):
        print("exponents of", column, exponents(table, column))
    return Finding(holds(table), tables={"free_growth": table})


CLAIM = Claim(
    experiment,
    digits=4,
    quick="small arches",
    pictures={"free_growth.png": drawn(chart, "free_growth")},
)

if __name__ == "__main__":
    print(json.dumps(run(*map(int, sys.argv[1:]))))
