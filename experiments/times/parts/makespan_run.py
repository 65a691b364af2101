"""One build in time in a process of its own: how long it takes, what is proven, and what that took.

Command: ``python -m experiments.times.parts.makespan_run BRICKS ROBOTS FORMULATION SECONDS`` prints
a row as JSON; ``ROBOTS`` is equal or unequal.
"""

import json
import math
import resource
import sys
import time

import seqopt
from seqopt.sequence.rules import with_robots

DURATIONS = "fetch=30,place=10,approach=10,grip=5,release=5"
SLOWER = "rob4:fetch=75,approach=25"  # the fourth robot prepares 2.5 times as long
CRITERION = "worst-ratio-published"
ROOM = 3e9  # bytes, of states and moves


def run(bricks: int, robots: str, formulation: str, seconds: float) -> dict[str, object]:
    words = (DURATIONS, SLOWER) if robots == "unequal" else (DURATIONS,)
    scene = with_robots(seqopt.load_scene(f"chain:bricks={bricks}"), 4).with_durations(*words)
    plain = seqopt.optimize(scene, "free", CRITERION, aim="minmax,steps")
    start = time.process_time()
    plan = seqopt.optimize(
        scene,
        "free",
        CRITERION,
        formulation,
        aim="minmax,makespan",
        search=seqopt.Search(time_limit=seconds, max_memory=ROOM),
    )
    spent = time.process_time() - start
    proof = plan.certificate
    proven = proof.bounds[1] if proof is not None else -math.inf
    claimed = max(plan.selection.bound[1], proven)
    reassigned = seqopt.GivenSequence(plain.engine, plain.reassigned()).makespan
    row = {"bricks": bricks, "robots": robots, "formulation": formulation}
    row |= {"kind": plan.formulation.kind.value, "planned": plain.makespan}
    row |= {"reassigned": reassigned, "makespan": plan.makespan, "claimed": claimed}
    row |= {"proven": proven, "status": str(plan.status), "stopped": plan.stopped}
    row |= {"states": 0 if proof is None else proof.states, "seconds": spent}
    row |= {"verify": plan.seconds["verify"]}
    return row | {"memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


if __name__ == "__main__":
    bricks, robots, formulation, seconds = sys.argv[1:]
    print(json.dumps(run(int(bricks), robots, formulation, float(seconds))))
