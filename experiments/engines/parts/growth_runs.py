"""One run of a growing structure in a process of its own: seconds of one core, and peak memory.

Run as a file, it measures whatever version of seqopt the process finds first, so that an older one
can stand beside: ``PYTHONPATH=OLDER python experiments/engines/parts/growth_runs.py TASK SCENE``.
"""

from __future__ import annotations

import json
import resource
import sys
import time

import seqopt
from experiments.harness.runs import scene_named
from seqopt.study.presets import EQUATIONS

Row = dict[str, object]


def analyzed(network: seqopt.Network) -> int:
    """Return how many steps of the sequential method were analyzed."""
    steps = seqopt.sequential(network)
    return len(seqopt.analyze(seqopt.make_engine("compliance", network), steps))


def searched(network: seqopt.Network) -> int:
    """Return how many models the three-robot loop met without proof."""
    engine, schedule = seqopt.make_engine("compliance", network), seqopt.three_robot_loop(network)
    return seqopt.solve(seqopt.pose(engine, schedule, EQUATIONS), "cascade", proof=False).models


TASKS = {"analyze": analyzed, "no proof": searched}


def run(task: str, name: str) -> Row:
    """Return what a task took, of a built-in scene or a chain by its brick count."""
    own = name.startswith("chain") or name == "arch25"
    scene = scene_named(name) if own else seqopt.load_scene(name)
    start = time.process_time()
    models = TASKS[task](seqopt.build_network(scene))
    return {
        "task": task,
        "scene": name,
        "bricks": len(scene.bricks),
        "models": models,
        "seconds": time.process_time() - start,
        "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


if __name__ == "__main__":
    print(json.dumps(run(*sys.argv[1:])))
