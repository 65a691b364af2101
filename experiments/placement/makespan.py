"""Claim: how long arches of up to 15 bricks take four robots, equal or not, is proven by labels.

Labels of time and readiness, bounded by multipliers of the robots' time, prove the least makespan
at the least worst ratio; the same grips by other robots are no slower than the plan with the fewest
steps. ``--large`` goes on to 25 bricks by equal and by unequal robots, in half an hour and 7 GB.

Method: arches in the shape of ``chain:bricks=N`` by four robots. All prepare a brick in 30 s and
place it in 10 s, come to one that stands in 10 s and grip it in 5 s, let go in 5 s; unequal means
that the fourth takes 2.5 times as long to prepare. Aims are the worst ratio, then the makespan; all
let go at the end. Every run has a process of its own on one core, with 200 s at most (400 s with 19
bricks, 600 s with 25) and 3 GB of states; seconds of that core are counted, proof included.

Inputs: the shipped scenes. Command: ``python -m experiments makespan [--quick] [--large]``.
"""

import json
import math
import resource
import sys
import time

import pandas as pd

import seqopt
from experiments.harness.claim import Claim, Finding, Option, Options
from experiments.harness.results import apart
from seqopt.scene.scene import with_robots

DURATIONS = "fetch=30,place=10,approach=10,grip=5,release=5"
SLOWER = "rob4:fetch=75,approach=25"  # the fourth robot prepares 2.5 times as long
CRITERION = "worst-ratio-published"
ROOM = 3e9  # bytes, of states and moves


def run(bricks: int, robots: str, seconds: float) -> dict[str, object]:
    words = (DURATIONS, SLOWER) if robots == "unequal" else (DURATIONS,)
    scene = with_robots(seqopt.load_scene(f"chain:bricks={bricks}"), 4).with_durations(*words)
    plain = seqopt.optimize(scene, "free", CRITERION, aim="minmax,steps")
    start = time.process_time()
    plan = seqopt.optimize(
        scene,
        "free",
        CRITERION,
        aim="minmax,makespan",
        search=seqopt.Search(time_limit=seconds, max_memory=ROOM),
    )
    spent = time.process_time() - start
    proof = plan.certificate
    proven = proof.bounds[1] if proof is not None else -math.inf
    claimed = max(plan.selection.bound[1], proven)
    reassigned = seqopt.GivenSequence(plain.engine, plain.reassigned()).makespan
    row = {"bricks": bricks, "robots": robots, "planned": plain.makespan}
    row |= {"reassigned": reassigned, "makespan": plan.makespan, "claimed": claimed}
    row |= {"proven": proven, "status": str(plan.status), "stopped": plan.stopped}
    row |= {"states": 0 if proof is None else proof.states, "seconds": spent}
    row |= {"verify": plan.seconds["verify"]}
    return row | {"memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


SIZES, LARGE, QUICK = (7, 11, 15), (19, 25), (7,)
SECONDS = {19: 400.0, 25: 600.0}  # by bricks
CLOSE = 1e-6


def holds(table: pd.DataFrame) -> bool:
    """Return whether all are proven, as the least, and no slower than the plans of fewest steps."""
    proven = (table["status"] == "optimal") & (table["proven"] >= table["makespan"] * (1 - CLOSE))
    sooner = table["makespan"] <= table["reassigned"] * (1 + CLOSE)
    reassigned = table["reassigned"] <= table["planned"] * (1 + CLOSE)
    return bool((proven & sooner & reassigned).all())


def experiment(options: Options) -> Finding:
    sizes, rows = QUICK if options.quick else LARGE if options.large else SIZES, []
    for bricks in sizes:
        for robots in ("equal", "unequal"):
            case = bricks, robots, SECONDS.get(bricks, 200.0)
            module = "experiments.placement.makespan"
            rows.append(run(*case) if options.quick else apart(module, *case))
            print(*rows[-1].values(), flush=True)
    table = pd.DataFrame(rows)
    name = "makespan_large" if options.large else "makespan"
    return Finding(holds(table), tables={name: table})


CLAIM = Claim(
    experiment,
    quick="seven bricks",
    options=(Option("--large", "arches of 19 and 25 bricks"),),
    digits=6,
)

if __name__ == "__main__":
    bricks, robots, seconds = sys.argv[1:]
    print(json.dumps(run(int(bricks), robots, float(seconds))))
