"""One scene, engine and criterion: a row per formulation, with time by stage and what it is worth.

A choice is judged by the reference: the responses of exactly rigid bricks, and dynamic programming
over them. ``gap`` is how far the choice lies above the reference's optimum of the same aim;
``error`` is the largest difference of the engine's responses from the reference's, over the largest
of each kind in its state. Times are medians of repeats, one run before several does not count.
Stages before the choice are shared by all formulations. One more row is the search that solves only
the models it meets and proves nothing (`seqopt.graph._windows`).

Command: ``python -m experiments.harness.runs SCENE ENGINE CRITERION REPEATS`` prints rows as JSON.
"""

import json
import resource
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from experiments.harness.scenes import longer
from seqopt import CRITERIA, Engine, Network, Plan, Scene, build_network, load_scene, solve
from seqopt.engines._auto import AutoEngine
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.graph.formulation import Formulation, formulations
from seqopt.graph.layers.compiled import best_in_order
from seqopt.graph.layers.layers import Layers, candidate_layers
from seqopt.problem.problem import Aim
from seqopt.sequence.three_robots import three_robot_loop

Row = dict[str, object]
Times = dict[str, float]
Result = TypeVar("Result")
ENGINES: dict[str, Callable[[Network], Engine]] = {
    "rigid bricks": ComplianceEngine,
    "frame 1e7": FrameEngine,
    "frame 1e3": lambda net: FrameEngine(net, 1e3),
    "auto": AutoEngine,
    "discrete": DiscreteEngine,
}
REFERENCE = "rigid bricks"
NO_PROOF = "rank_search, no proof"


def scene_named(name: str) -> Scene:
    """Return ``arch25``, or an arch of the same shape by its brick count, as ``chain13``."""
    reference = load_scene("arch25")
    if name == "arch25":
        return reference
    return longer(reference, (int(name.removeprefix("chain")) - 1) / 24)


def rows(scene: str, engine: str, criterion: str, repeats: int) -> list[Row]:
    built = scene_named(scene)
    reference, _ = _pose(built, REFERENCE, criterion)
    ready = _repeated(repeats, lambda: _responded(*_pose(built, engine, criterion)))
    problem = ready[-1][0]
    shared = {
        stage: statistics.median(seconds[stage] for _, seconds in ready) for stage in ready[-1][1]
    }
    base: Row = {"scene": scene, "bricks": len(problem.schedule.scene.bricks)}
    base |= {"moves": len(problem.schedule.moves), "engine": engine, "criterion": criterion}
    base |= {"error": error(problem, reference)}
    every = formulations("costs").values()
    found = [_row(problem, formulation, reference, shared, repeats) for formulation in every]
    found.append(_search_row(built, engine, criterion, reference, repeats))
    return [base | row for row in found]


def _repeated(repeats: int, call: Callable[[], Result]) -> list[Result]:
    """Return what repeated calls return, without the first if there are several."""
    warm_up = int(repeats > 1)
    return [call() for _ in range(repeats + warm_up)][warm_up:]


def contenders() -> dict[str, Aim]:
    """Return the names of what chooses, and what each makes least, in the order of the rows."""
    return {f.name: f.aim for f in formulations("costs").values()} | {NO_PROOF: Aim.SUM}


def _pose(scene: Scene, engine: str, criterion: str) -> tuple[Layers, Times]:
    """Return the loop's problem, nothing of it computed, and the time that took."""
    start = time.perf_counter()
    net = build_network(scene)
    problem = candidate_layers(ENGINES[engine](net), three_robot_loop(net), CRITERIA[criterion])
    return problem, {"assemble": time.perf_counter() - start}


def _responded(problem: Layers, seconds: Times) -> tuple[Layers, Times]:
    """Compute the costs of both aims; add the time that took."""
    stages = [problem.seconds(aim) for aim in Aim]
    ranked = sum(stage["rank"] for stage in stages)
    return problem, seconds | {"respond": stages[0]["respond"], "rank": ranked}


def _row(
    problem: Layers, formulation: Formulation, reference: Layers, shared: Times, repeats: int
) -> Row:
    plans = _repeated(repeats, lambda: solve(problem, formulation))
    seconds = shared | _medians(plans, ("compile", "solve", "verify"))
    judged = _judged(reference, formulation.aim, plans[-1].choice, seconds)
    return {"formulation": formulation.name, **judged, "models": plans[-1].models_needed}


def _search_row(scene: Scene, engine: str, criterion: str, reference: Layers, repeats: int) -> Row:
    def search() -> tuple[Plan, Times]:
        problem, seconds = _pose(scene, engine, criterion)
        return solve(problem, "rank_search", proof=False), seconds

    found = _repeated(repeats, search)
    stages = {"assemble": statistics.median(seconds["assemble"] for _, seconds in found)}
    stages |= {"compile": 0.0, "solve": 0.0}  # choosing is part of the search
    plans = [plan for plan, _ in found]
    stages |= _medians(plans, ("respond", "rank", "verify"))
    judged = _judged(reference, Aim.SUM, plans[-1].choice, stages)
    return {"formulation": NO_PROOF, **judged, "models": plans[-1].models}


def _medians(plans: Sequence[Plan], stages: Sequence[str]) -> Times:
    return {stage: statistics.median(plan.seconds[stage] for plan in plans) for stage in stages}


def _judged(reference: Layers, aim: Aim, choice: tuple[int, ...], seconds: Times) -> Row:
    objective, gap = worth(reference, aim, choice)
    row = {"aim": aim.value, "status": "optimal" if gap <= 1e-6 else "feasible", **seconds}
    row |= {"total": sum(seconds.values()), "objective": objective, "gap": gap}
    return row | {"memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


def worth(reference: Layers, aim: Aim, choice: tuple[int, ...]) -> tuple[float, float]:
    """Return the value of a choice by the reference's data, and its gap to the optimum there."""
    costs = aim.costs(reference)
    best = best_in_order([(costs, aim)])
    value, bound = (float(aim.value_of(costs, each)) for each in (choice, best))
    return value, max(0.0, value - bound) / max(abs(bound), np.finfo(float).tiny)


def error(problem: Layers, reference: Layers) -> float:
    """Return the largest difference of responses over the largest of each kind in its step."""
    worst = 0.0
    for own, exact in zip(problem.evaluation.steps, reference.evaluation.steps, strict=True):
        for name, values in exact.responses.items():
            known = np.isfinite(values)
            if known.any():
                size = np.abs(values[known]).max() or 1.0
                worst = max(worst, np.abs(own.responses[name] - values)[known].max() / size)
    return float(worst)


if __name__ == "__main__":
    print(json.dumps(rows(*sys.argv[1:4], repeats=int(sys.argv[4]))))
