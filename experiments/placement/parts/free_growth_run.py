"""One free schedule in a process of its own: how many states, seconds of one core, peak memory.

Command: ``python -m experiments.placement.parts.free_growth_run BRICKS ROBOTS`` prints a row as
JSON.
"""

from __future__ import annotations

import json
import resource
import sys
import time

import seqopt
from experiments.harness.runs import scene_named
from seqopt.sequence.rules import with_robots

ROOM = 1.7e9  # bytes


def run(bricks: int, robots: int) -> dict[str, object]:
    """Return what the free schedule of an arch takes, and what it is worth."""
    scene = with_robots(scene_named(f"chain{bricks}"), robots)
    start = time.process_time()
    plan = seqopt.optimize(scene, "free", engine="compliance", max_memory=ROOM)
    certificate = plan.certificate
    return {
        "bricks": bricks,
        "robots": robots,
        "status": plan.status,
        "worst": plan.selection.objective[0],
        "bound": plan.selection.bound[0],
        "steps": len(plan.steps),
        "models": plan.models,
        "states": 0 if certificate is None else certificate.states,
        "seconds": time.process_time() - start,
        "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


if __name__ == "__main__":
    print(json.dumps(run(*map(int, sys.argv[1:]))))
