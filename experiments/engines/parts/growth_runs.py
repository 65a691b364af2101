"""One run of a growing structure in a process of its own: seconds of one core, and peak memory.

Command: ``python -m experiments.engines.parts.growth_runs TASK SCENE`` prints a row as JSON.
"""

import json
import resource
import sys
import time
from collections.abc import Sequence

import numpy as np

import seqopt
from experiments.harness.scenes import scene_named
from seqopt.engines.interface import Engine, Want
from seqopt.engines.rigid._mixed import solve_mixed
from seqopt.responses.resources import Resources
from seqopt.sequence.steps import Step
from seqopt.study.published import EQUATIONS, WORST_RATIO

Done = tuple[Engine, Sequence[Step], int]
LOOKED_AT = 40  # steps of a run, and brick counts, whose errors are looked at
SETS = 5  # random grip sets at each of these


def analyzed(network: seqopt.Network) -> Done:
    """Analyze the steps of the sequential method; a model each."""
    engine, steps = seqopt.make_engine("compliance", network), seqopt.sequential(network)
    return engine, steps, len(seqopt.analyze(engine, steps))


def searched(network: seqopt.Network, **more: object) -> Done:
    engine, schedule = seqopt.make_engine("compliance", network), seqopt.three_robot_loop(network)
    plan = seqopt.solve(seqopt.pose(engine, schedule, EQUATIONS, **more), "cascade", proof=False)
    return engine, plan.steps, plan.models


def shared(network: seqopt.Network) -> Done:
    """Do the same with two processes."""
    return searched(network, resources=Resources(workers=2))


def proven(network: seqopt.Network) -> Done:
    """Choose the grips of the three-robot loop with proof, all pairs being solved."""
    engine, schedule = seqopt.make_engine("compliance", network), seqopt.three_robot_loop(network)
    plan = seqopt.solve(seqopt.pose(engine, schedule, EQUATIONS), "overlap_dp")
    return engine, plan.steps, plan.models


def proven_lazily(network: seqopt.Network) -> Done:
    """Find the least worst ratio of the three-robot loop, by the pairs that its proof needs."""
    engine, schedule = seqopt.make_engine("compliance", network), seqopt.three_robot_loop(network)
    plan = seqopt.solve(seqopt.pose(engine, schedule, WORST_RATIO), "minimax", lazy=True)
    return engine, plan.steps, plan.models


TASKS = {
    "analyze": analyzed,
    "no proof": searched,
    "no proof, two processes": shared,
    "proof": proven,
    "lazy proof": proven_lazily,
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

    picked = np.unique(np.linspace(0, len(steps) - 1, LOOKED_AT).astype(int))
    of_plan = [
        largest(steps[i].bricks, np.array([steps[i].held], dtype=int), Want.EDGES) for i in picked
    ]
    counts = np.unique(np.linspace(3, len(network.inner), LOOKED_AT).astype(int))
    of_screens = []
    for bricks in counts:
        nodes = np.array([brick.nodes for brick in network.scene.placed[:bricks]]).ravel()
        free = np.setdiff1d(nodes, network.scene.blocked_nodes)
        sets = np.array([random.choice(free, 3, replace=False) for _ in range(SETS)])
        of_screens.append(largest(int(bricks), sets, Want.EDGES | Want.SCREEN))
    return {"error": max(of_plan), "screen_error": max(of_screens)}


def run(task: str, name: str) -> dict[str, object]:
    own = name.startswith("chain") or name == "arch25"
    scene = scene_named(name) if own else seqopt.load_scene(name)
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


if __name__ == "__main__":
    print(json.dumps(run(*sys.argv[1:3])))
