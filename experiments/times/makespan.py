"""Claim: how long arches of up to 15 bricks take four robots, equal or not, is proven by labels.

Labels of time and readiness, bounded by prices of the robots' time, prove the least makespan at the
least worst ratio. A whole flow leaves a gap from seven bricks on; the same grips by other robots
are no slower than the plan with the fewest steps, and no build is faster than is proven.
``--large`` goes on to 31 bricks with labels alone, which prove 25 bricks by equal and by unequal
robots; where the states of 31 exceed time or memory, counts of grips prove a bound. It takes half
an hour and 10 GB.

Method: arches in the shape of ``chain:bricks=N`` by four robots. All prepare a brick in 30 s and
place it in 10 s, come to one that stands in 10 s and grip it in 5 s, let go in 5 s; unequal means
that the fourth takes 2.5 times as long to prepare. Aims are the worst ratio, then the makespan; all
let go at the end. Every run has a process of its own on one core, labels with 200 s at most (400 s
with 19 bricks, 600 s with 25) and 3 GB of states, others with 30 s; seconds of that core are
counted, proof included.

Inputs: the shipped scenes. Command: ``python -m experiments makespan [--quick] [--large]``.
"""

import pandas as pd

from experiments.harness.claim import Claim, Finding, Option, Options
from experiments.harness.results import apart
from experiments.times.parts.makespan_run import run

SIZES = {"makespan_flow": (7, 11), "makespan_labels": (7, 11, 15)}
LARGE = {"makespan_labels": (19, 25, 31)}
SECONDS = {"makespan_labels": 200.0, "makespan_flow": 30.0}
LONGER = {19: 400.0, 25: 600.0}  # s for labels, by bricks
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
    bounds &= bool(table["proven"].between(1.0, table["makespan"] * (1 + CLOSE)).all())
    reassigned = bool((table["reassigned"] <= table["planned"] * (1 + CLOSE)).all())
    others = every[every["formulation"] != "makespan_labels"]
    gaps = bool((others["claimed"] < others["least"] * (1 - CLOSE)).all())
    return proven and none_better and bounds and reassigned and gaps


def experiment(options: Options) -> Finding:
    sizes, rows = QUICK if options.quick else LARGE if options.large else SIZES, []
    for name, counts in sizes.items():
        for bricks in counts:
            for robots in ("equal", "unequal"):
                case = bricks, robots, name, LONGER.get(bricks, SECONDS[name])
                module = "experiments.times.parts.makespan_run"
                rows.append(run(*case) if options.quick else apart(module, *case))
                print(*rows[-1].values(), flush=True)
    table = pd.DataFrame(rows)
    name = "makespan_large" if options.large else "makespan"
    return Finding(holds(table), tables={name: table})


CLAIM = Claim(
    experiment,
    quick="seven bricks",
    options=(Option("--large", "arches of 19 to 31 bricks, labels alone"),),
    digits=6,
)
