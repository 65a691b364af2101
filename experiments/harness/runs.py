"""One scene, engine and criterion: a row per formulation, with time by stage and what it is worth.

A choice is judged by the reference: the responses of exactly rigid bricks, and dynamic programming
over them. ``gap`` is how far the choice lies above the reference's optimum of the same aim,
whatever engine it was made with; ``error`` is the largest difference of the engine's responses from
the reference's, over the largest of each kind in its state. Times are medians of repeats; where
there are several, one run before them does not count. Stages before the choice are shared by all
formulations. One more row is the search that solves only the models it meets and proves nothing
(`seqopt.placement.window_search`).

Command: ``python -m experiments.harness.runs SCENE ENGINE CRITERION REPEATS`` prints rows as JSON.
"""

from __future__ import annotations

import json
import resource
import statistics
import sys
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from experiments.harness.arches import longer
from seqopt.engines.auto import AutoEngine
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Engine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.placement.certificate import least_peak, least_sum
from seqopt.placement.formulation import Aim, Formulation, Reads, formulations
from seqopt.placement.plan import Outcome, Posed, optimize, prepare
from seqopt.placement.problem import Problem
from seqopt.placement.window_search import Search, search_windows
from seqopt.responses.choices import window_models
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.presets import CRITERIA

Row = dict[str, object]
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
    """Return a row per formulation."""
    built = scene_named(scene)
    reference = _pose(built, REFERENCE, criterion).problem
    ready = _repeated(repeats, lambda: _pose(built, engine, criterion))
    posed = ready[-1]
    shared = {
        stage: statistics.median(one.seconds[stage] for one in ready) for stage in posed.seconds
    }
    base: Row = {
        "scene": scene,
        "bricks": len(posed.problem.schedule.scene.bricks),
        "moves": len(posed.problem.schedule.moves),
        "engine": engine,
        "criterion": criterion,
        "error": error(posed.problem, reference),
    }
    return [
        *(
            base | _row(posed, which, reference, shared, repeats)
            for which in formulations().values()
        ),
        base | _search_row(built, engine, criterion, reference, repeats),
    ]


def _repeated(repeats: int, call: Callable[[], Result]) -> list[Result]:
    """Return what repeated calls return, without the first if there are several."""
    warm_up = int(repeats > 1)
    return [call() for _ in range(repeats + warm_up)][warm_up:]


def contenders() -> dict[str, Aim]:
    """Return the names of what chooses, and what each makes least, in the order of the rows."""
    return {f.name: f.aim for f in formulations().values()} | {NO_PROOF: Aim.SUM}


def _assemble(scene: Scene, engine: str) -> tuple[Engine, Schedule, dict[str, float]]:
    """Return an engine, the loop, and the time that took."""
    start = time.perf_counter()
    net = build_network(scene)
    solver, schedule = ENGINES[engine](net), three_robot_loop(net)
    return solver, schedule, {"assemble": time.perf_counter() - start}


def _pose(scene: Scene, engine: str, criterion: str) -> Posed:
    solver, schedule, seconds = _assemble(scene, engine)
    posed = prepare(solver, schedule, CRITERIA[criterion])
    return Posed(posed.problem, seconds | dict(posed.seconds))


def _row(
    posed: Posed, which: Formulation, reference: Problem, shared: dict[str, float], repeats: int
) -> Row:
    outcomes = _repeated(repeats, lambda: optimize(posed, which))
    last = outcomes[-1]
    seconds = shared | {
        stage: statistics.median(outcome.seconds[stage] for outcome in outcomes)
        for stage in ("compile", "solve", "verify")
    }
    judged = _judged(reference, which.aim, last.selection.choice, seconds)
    return {"formulation": which.name, **judged, "models": _models(last)}


def _search_row(scene: Scene, engine: str, criterion: str, reference: Problem, repeats: int) -> Row:
    found = _repeated(repeats, lambda: _search(scene, engine, criterion))
    stages = {"compile": 0.0, "solve": 0.0}  # choosing is part of the search
    stages |= {name: statistics.median(one[0][name] for one in found) for name in found[0][0]}
    last = found[-1][1]
    judged = _judged(reference, Aim.SUM, last.choice, stages)
    return {"formulation": NO_PROOF, **judged, "models": last.models}


def _search(scene: Scene, engine: str, criterion: str) -> tuple[dict[str, float], Search]:
    solver, schedule, seconds = _assemble(scene, engine)
    found = search_windows(solver, schedule, CRITERIA[criterion])
    return seconds | dict(found.seconds), found


def _judged(
    reference: Problem, aim: Aim, choice: tuple[int, ...], seconds: dict[str, float]
) -> Row:
    objective, gap = worth(reference, aim, choice)
    return {
        "aim": aim.value,
        "status": "optimal" if gap <= 1e-6 else "feasible",
        **seconds,
        "total": sum(seconds.values()),
        "objective": objective,
        "gap": gap,
        "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def _models(outcome: Outcome) -> int:
    if outcome.which.reads is Reads.WINDOW:
        return window_models(outcome.problem.schedule, outcome.selection.choice)
    return outcome.problem.evaluation.models


def worth(reference: Problem, aim: Aim, choice: tuple[int, ...]) -> tuple[float, float]:
    """Return the value of a choice by the reference's data, and its gap to the optimum there."""
    placement = reference.sums if aim is Aim.SUM else reference.peaks
    parts = placement.parts(choice)
    value = float(sum(parts) if aim is Aim.SUM else max(parts))
    least = least_sum(placement) if aim is Aim.SUM else least_peak(placement)
    return value, max(0.0, value - least) / max(abs(least), np.finfo(float).tiny)


def error(problem: Problem, reference: Problem) -> float:
    """Return the largest difference of responses over the largest of each kind in its state."""
    worst = 0.0
    for own, exact in zip(problem.evaluation.states, reference.evaluation.states, strict=True):
        for name, values in exact.responses.items():
            known = np.isfinite(values)
            if known.any():
                size = np.abs(values[known]).max() or 1.0
                worst = max(worst, np.abs(own.responses[name] - values)[known].max() / size)
    return float(worst)


if __name__ == "__main__":
    print(json.dumps(rows(*sys.argv[1:4], repeats=int(sys.argv[4]))))
