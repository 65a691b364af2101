"""What several commands are asked for, and what they say of it."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from seqopt.cli.saying.answer import Answer
from seqopt.cli.saying.terminal import wrapped
from seqopt.cli.status import Status
from seqopt.contact.mortar import MORTARS
from seqopt.engines.auto import AutoEngine
from seqopt.engines.interface import Engine, Fields
from seqopt.engines.registry import make_engine
from seqopt.errors import ProblemError, SceneError
from seqopt.interrupts import ending
from seqopt.network.network import Network
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import OWN, overloads
from seqopt.responses.staged import staged_fields
from seqopt.responses.table import OUTSIDE, REMEDY, step_fields
from seqopt.scene.scene import Scene, in_order
from seqopt.scene.scene_file import dump_scene, load_scene
from seqopt.sequence.steps import AnyStep, Step, idle_robots
from seqopt.work.progress import told


def scene_facts(scene: Scene) -> dict[str, object]:
    """Return what a scene is called, and how large it is.

    Result: ``name``, ``bricks``, ``joints``, ``ground_ends`` and the names of ``robots``.
    """
    return {
        "name": scene.name,
        "bricks": len(scene.bricks),
        "joints": len(scene.joints),
        "ground_ends": len(scene.grounds),
        "robots": [robot.name for robot in scene.robots],
    }


def network_facts(network: Network) -> dict[str, object]:
    """Return how large the network of a scene is, what it weighs, and what its robots can do.

    Result: ``nodes`` and ``edges`` of the whole structure, ``weight_N``, ``payloads_N`` and
    ``reaches`` by robot, ``provenance``.
    """
    scene = network.scene
    count = len(scene.bricks)
    return {
        "nodes": network.count_nodes(count),
        "edges": network.count_edges(count),
        "weight_N": float(np.linalg.norm(network.weight.sum(axis=0))),
        "payloads_N": {robot.name: robot.payload for robot in scene.robots},
        "reaches": {robot.name: type(robot.reach).__name__.lower() for robot in scene.robots},
        "provenance": scene.provenance,
    }


def asked_scene(options: argparse.Namespace) -> Scene:
    """Return the scene that a command is asked for, in the order that it is asked for.

    ``options``: with ``scene`` and ``order``.
    """
    if options.order == "search":
        raise ProblemError(
            "--order search: only the free schedule has it; give optimize --schedule free"
        )
    return in_order(load_scene(options.scene), options.order)


def scene_file(scene: Scene) -> dict[str, bytes | str]:
    """Return the scene that a plan is for, by file name: plans name bricks by how many stand.

    ``scene``: in the order in which it is built. Result (dict of str to (bytes or str)).
    """
    return {"scene.json": dump_scene(scene)}


def asked_engine(options: argparse.Namespace, network: Network) -> Engine:
    """Return the engine that a command is asked for.

    ``options``: with ``engine`` and ``mortar``. Raises `SceneError` if the scene is not for it.
    """
    mortar = None if options.mortar is None else MORTARS[options.mortar]
    try:
        return make_engine(options.engine, network, mortar)
    except SceneError as error:
        raise SceneError(f"--engine {options.engine}: {error}") from error


def level_notes(engine: Engine) -> tuple[str, ...]:
    """Return which levels an engine that picks them took, and why.

    Result: None of other engines.
    """
    if not isinstance(engine, AutoEngine):
        return ()
    said = [
        f"engine: {choice.level.value} for {sets} grip sets: {choice.reason}"
        for choice, sets in engine.tally.items()
    ]
    return (*said, *([f"engine: {engine.unchecked}"] if engine.unchecked else []))


def posed_notes(problem: Problem) -> tuple[str, ...]:
    """Return which levels the engine took, and whether scales are not those of fixed methods."""
    said, name = level_notes(problem.engine), problem.criterion.name
    if not name.endswith(OWN):
        return said
    return (*said, f"criterion: {name}: no fixed method builds this scene to take scales from")


def idle_notes(scene: Scene, steps: Sequence[AnyStep]) -> tuple[str, ...]:
    """Return the robots that never grip, in words.

    Result: of one note, or none.
    """
    idle = idle_robots(scene, steps)
    return (f"robots: {', '.join(idle)} never grip{'s' * (len(idle) == 1)}",) if idle else ()


def exceeded(scene: Scene, *tables: pd.DataFrame) -> tuple[str, ...]:
    """Return the payloads that are exceeded, in words.

    ``*tables``: responses of steps.
    """
    return tuple(str(excess) for table in tables for excess in overloads(scene, table))


def marked(answer: Answer, outside: Sequence[object]) -> Answer:
    """Return an answer that begins with how results leave the linear range, and what to do."""
    left = [str(departure) for departure in outside]
    answer = replace(answer, facts={**answer.facts, "outside_linear_range": left})
    if not left:
        return answer
    lines = (*(f"{OUTSIDE}: {each}" for each in left), REMEDY)
    if not answer.text:
        return replace(answer, notes=(*lines, *answer.notes))
    return replace(answer, text="\n".join([*map(wrapped, lines), answer.text]))


def strictly(
    answer: Answer, options: argparse.Namespace, over: Sequence[str], outside: Sequence[object] = ()
) -> Answer:
    """Return an answer with the payloads that are exceeded, and the status of ``--strict``.

    ``options``: with ``strict``; ``over``: from `exceeded`; ``outside``: how results leave the
    linear range.
    """
    answer = marked(answer, outside)
    answer = replace(answer, facts={**answer.facts, "payloads_exceeded": list(over)})
    wrong = {"payload exceeded": over, OUTSIDE: [*map(str, outside)]}
    said = [f"seqopt: {name}: {'; '.join(each)}" for name, each in wrong.items() if each]
    if not options.strict or not said or answer.status is not Status.DONE:
        return answer
    return replace(answer, failures=(*answer.failures, *said), status=Status.DOES_NOT_HOLD)


def step_answers(
    options: argparse.Namespace, engine: Engine, steps: Sequence[Step]
) -> Iterator[tuple[Step, Fields]]:
    """Return steps with their fields, each from scratch or with what earlier ones lock in.

    ``options``: with ``staged``, where bricks are set down or None, ``engine``, and ``tell``, which
    is told how far it is. Result (iterator of (Step, Fields)). Raises `SceneError` if a staged
    analysis is asked of another engine than the one of rigid bricks.
    """
    if options.staged is None:
        return ((step, step_fields(engine, step)) for step in told("steps", steps, options.tell))
    if options.engine != "compliance":
        raise SceneError(
            f"--engine {options.engine}: --staged goes with exactly rigid bricks alone; "
            "give --engine compliance"
        )
    fields = staged_fields(engine.network, steps, options.staged)
    return zip(told("steps", steps, options.tell), fields, strict=True)


def timely(answers: Iterator[tuple[Step, Fields]], seconds: float) -> Iterator[tuple[Step, Fields]]:
    """Yield the answers that come in time.

    ``answers`` (iterator of (Step, Fields)): from `step_answers`; ``seconds``: from the first one
    that is asked for. Yield (Step, Fields).
    """
    end = time.perf_counter() + seconds
    while True:
        try:
            with ending(end - time.perf_counter()):
                answer = next(answers, None)
        except TimeoutError:
            return
        if answer is None:
            return
        yield answer
