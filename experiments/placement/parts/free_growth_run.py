"""One free schedule in a process of its own: how many states, seconds of one core, peak memory.

Command: ``python -m experiments.placement.parts.free_growth_run BRICKS ROBOTS`` prints a row as
JSON.
"""

import json
import resource
import sys
import time

import seqopt
from experiments.harness.scenes import scene_named
from seqopt.sequence.rules import with_robots

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


if __name__ == "__main__":
    print(json.dumps(run(*map(int, sys.argv[1:]))))
