"""Claim: how long an arch of 25 bricks takes four robots, equal or not, is found and proven.

Labels of time and readiness, bounded by prices of the robots' time, prove the least makespan at the
least worst ratio. Constraint programming (CP-SAT) and a whole flow leave a gap from seven bricks on
where a fourth robot prepares 2.5 times as long; the same grips by other robots are no slower than
the plan with the fewest steps, and no build is faster than is proven.

Method: arches in the shape of ``chain:bricks=N`` by four robots. All prepare a brick in 30 s and
place it in 10 s, come to one that stands in 10 s and grip it in 5 s, let go in 5 s; unequal means
that the fourth takes 2.5 times as long to prepare. Aims are the worst ratio, then the makespan; all
let go at the end. Every run has a process of its own on one core, labels with
200 s at most, others with 30 s on arches of up to 15 bricks; seconds of that core are counted,
proof included.

Inputs: the shipped scenes. Command: ``python -m experiments.times.makespan [--quick]``.
"""

import pandas as pd

from experiments.harness.claim import Claim, Finding, Options, Times, on_this_run
from experiments.harness.results import apart
from experiments.times.parts.makespan_run import run

SIZES = {
    "makespan_cp": (7, 11, 15),
    "makespan_flow": (7, 11, 15),
    "makespan_labels": (7, 11, 15, 19, 25, 31),
}
SECONDS = {"makespan_labels": 200.0, "makespan_cp": 30.0, "makespan_flow": 30.0}
QUICK = {"makespan_labels": (7,), "makespan_flow": (7,)}
PROVEN = 25  # bricks up to which labels prove the least
CLOSE = 1e-6


def holds(table: pd.DataFrame) -> bool:
    """Return whether labels prove the least, nothing contradicts it, and others leave gaps."""
    labels = table[table["formulation"] == "makespan_labels"]
    small = labels[labels["bricks"] <= PROVEN]
    proven = bool((small["status"] == "optimal").all())
    least = small.set_index(["bricks", "robots"])["makespan"].rename("least")
    every = table.join(least, on=["bricks", "robots"], how="inner")
    none_better = bool((every["makespan"] >= every["least"] * (1 - CLOSE)).all())
    bounds = bool((every["proven"] <= every["least"] * (1 + CLOSE)).all())
    reassigned = bool((table["reassigned"] <= table["planned"] * (1 + CLOSE)).all())
    others = every[every["formulation"] != "makespan_labels"]
    gaps = bool((others["claimed"] < others["least"] * (1 - CLOSE)).all())
    return proven and none_better and bounds and reassigned and gaps


def experiment(options: Options) -> Finding:
    sizes, rows = QUICK if options.quick else SIZES, []
    for name, counts in sizes.items():
        for bricks in counts:
            for robots in ("equal", "unequal"):
                case = bricks, robots, name, SECONDS[name]
                module = "experiments.times.parts.makespan_run"
                rows.append(run(*case) if options.quick else apart(module, *case))
                print(*rows[-1].values(), flush=True)
    table = pd.DataFrame(rows)
    return on_this_run(holds=holds(table), makespan=table)


CLAIM = Claim(experiment, quick="seven bricks, nothing written", times=Times.SHOWN, digits=6)

if __name__ == "__main__":
    CLAIM.main()
