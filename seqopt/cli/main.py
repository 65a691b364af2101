"""The command line: ``seqopt compare | optimize | analyze | assess | scene``."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
import pandas as pd

from seqopt.cli.arguments import parser
from seqopt.cli.outputs import (
    comparison_files,
    keep_apart,
    require_matplotlib,
    worth,
    write_outputs,
)
from seqopt.cli.status import Status, status_of
from seqopt.cli.terminal import complain, flush, progress, quiet_numbers, say, show, silence
from seqopt.cli.values import (
    parse_criterion,
    parse_limits,
    parse_mortar,
    parse_options,
    parse_resources,
    parse_robots,
)
from seqopt.contact.mortar import MORTARS
from seqopt.engines.auto import AutoEngine
from seqopt.engines.interface import Engine
from seqopt.engines.registry import make_engine
from seqopt.errors import SceneError, SeqoptError, SolverError, StepError
from seqopt.files import (
    csv_text,
    require_folder,
    write_bytes,
    write_csv,
    write_text,
)
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.placement.formulation import find_formulation
from seqopt.placement.problem import pose
from seqopt.placement.promises import overloads
from seqopt.placement.solving import solve
from seqopt.report.comparison import compare
from seqopt.report.text import format_comparison
from seqopt.responses.table import analyze, fields_archive
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import about, builtin_scenes, dump_scene, load_scene
from seqopt.sequence.plan_file import read_plan
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.schedule_file import find_schedule
from seqopt.sequence.steps import AnyStep, Step, idle_robots
from seqopt.sequence.thinning import thin
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import Verdict
from seqopt.stability.steps import assess_steps, format_verdicts, stability_table
from seqopt.study.published import PUBLISHED, is_reference_arch, paper_models, published_plan


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    arguments : sequence of str, optional
        The words after ``seqopt``; by default those of the shell.

    Returns
    -------
    int
        The exit status, a `seqopt.cli.status.Status`. An error is one line on standard error.
    """
    try:
        status = _run(arguments)
        flush()
    except BrokenPipeError:  # the reader of our output has gone: not an error of ours
        silence(sys.stdout)
        return Status.DONE
    except (SeqoptError, KeyboardInterrupt, MemoryError, OSError) as error:
        status = status_of(error)
        with suppress(OSError):
            flush()
    return status


def _run(arguments: Sequence[str] | None) -> int:
    try:
        options = parser().parse_args(arguments)
    except SystemExit as stop:  # the parser has said why, or printed its help
        return int(stop.code or 0)
    with quiet_numbers():
        return COMMANDS[options.command](options) or Status.DONE


def _compare(options: argparse.Namespace) -> Status:
    scene = load_scene(options.scene)
    engine = _engine(options, build_network(scene))
    criterion = parse_criterion(options.criteria, options.crown)
    if options.out is not None:
        require_matplotlib(options.out)
        require_folder(options.out)
    result = compare(engine, criterion, progress, parse_robots(options.robots))
    _say_levels(engine)
    show(format_comparison(result, scene, criterion) + "\n")
    if options.out is not None and result.loop is not None:
        write_outputs(options, comparison_files(result))
        say(f"tables and figures written to {options.out}")
    return _payloads_hold(options, scene, *result.tables.values())


def _engine(options: argparse.Namespace, network: Network) -> Engine:
    mortar = None if options.mortar is None else MORTARS[options.mortar]
    try:
        return make_engine(options.engine, network, mortar)
    except SceneError as error:
        raise SceneError(f"--engine {options.engine}: {error}") from error


def _say_levels(engine: Engine) -> None:
    """Say which levels an engine that picks them took, and why."""
    if not isinstance(engine, AutoEngine):
        return
    for choice, sets in engine.tally.items():
        complain(f"engine: {choice.level.value} for {sets} grip sets: {choice.reason}")
    if engine.unchecked:
        complain(f"engine: {engine.unchecked}")


def _paper_count(schedule: Schedule) -> dict[str, int] | None:
    """Return how many models the paper counts for the loop of three robots; none for others."""
    if schedule.method != "three-robot":
        return None
    return dict(zip(("cascading", "overlap"), paper_models(schedule), strict=True))


def _say_idle(scene: Scene, steps: Sequence[AnyStep]) -> None:
    """Name the robots that never grip."""
    if idle := idle_robots(scene, steps):
        complain(f"robots: {', '.join(idle)} never grip{'s' * (len(idle) == 1)}")


def _optimize(options: argparse.Namespace) -> Status:
    formulation = find_formulation(options.formulation)
    chosen = parse_options(formulation, options.option)
    criterion = parse_criterion(options.criteria, options.crown)
    scene = load_scene(options.scene)
    limits = parse_limits(options.limit, scene)
    resources = parse_resources(options, progress)
    require_folder(options.out)
    start = time.perf_counter()
    network = build_network(scene)
    engine, schedule = (
        _engine(options, network),
        find_schedule(network, options.schedule, parse_robots(options.robots)),
    )
    if options.candidates is not None:
        schedule = thin(schedule, options.candidates)
    assemble = time.perf_counter() - start
    problem = pose(engine, schedule, criterion, limits, (), resources)
    plan = solve(problem, formulation, proof=not options.no_proof, **chosen)
    progress("")
    _say_levels(engine)
    report = plan.summary() | {
        "models_paper_count": _paper_count(schedule),
        "seconds": {"assemble": assemble, **plan.seconds},
    }
    table = plan.responses()
    files = {
        "plan.csv": csv_text(table),
        "selection.csv": csv_text(plan.table()),
        "responses.csv": csv_text(plan.alternatives()),
        "summary.json": json.dumps(report, indent=2) + "\n",
    }
    write_outputs(options, files)
    say(
        f"{formulation.name} ({formulation.kind.value}): {worth(plan)}, "
        f"{plan.models} models; written to {options.out}"
    )
    for excess in plan.overloads:
        say(f"payload exceeded: {excess}")
    _say_idle(scene, plan.steps)
    return _payloads_hold(options, scene, table)


def _payloads_hold(options: argparse.Namespace, scene: Scene, *tables: pd.DataFrame) -> Status:
    """Return the status that ``--strict`` asks for."""
    over = [str(excess) for table in tables for excess in overloads(scene, table)]
    if not options.strict or not over:
        return Status.DONE
    complain(f"seqopt: payload exceeded: {'; '.join(over)}")
    return Status.DOES_NOT_HOLD


def _analyze(options: argparse.Namespace) -> Status:
    keep_apart(options, options.out, options.fields)
    scene = load_scene(options.scene)
    engine = _engine(options, build_network(scene))
    steps = _steps(scene, options)
    table = analyze(engine, steps)
    _say_levels(engine)
    if options.fields is not None:
        write_bytes(options.fields, fields_archive(engine, steps))
    if options.out is None:
        show(csv_text(table))
    else:
        write_csv(options.out, table)
        say(f"{len(table)} steps written to {options.out}")
    _say_idle(scene, steps)
    return _payloads_hold(options, scene, table)


def _assess(options: argparse.Namespace) -> Status:
    keep_apart(options, options.out)
    scene = load_scene(options.scene)
    mortar = parse_mortar(options)
    network = build_network(scene)
    steps = _steps(scene, options)
    results = assess_steps(network, steps, mortar, progress)
    table = stability_table(steps, results)
    if options.out is None:
        show(csv_text(table))
    else:
        write_csv(options.out, table)
        say(f"{format_verdicts(results)}; written to {options.out}")
    undecided = [
        s.number for s, r in zip(steps, results, strict=True) if r.verdict is Verdict.UNDECIDED
    ]
    if undecided:
        raise SolverError(
            f"steps {', '.join(map(str, undecided))} are undecided; this says nothing about them"
        )
    falls = any(result.verdict is Verdict.FALLS for result in results)
    return Status.DOES_NOT_HOLD if falls else Status.DONE


def _steps(scene: Scene, options: argparse.Namespace) -> tuple[Step, ...]:
    """Return the closed sequence that the options name."""
    robots = parse_robots(options.robots)
    if robots and options.method not in METHODS:
        raise StepError(
            f"--robots {options.robots}: a plan says itself who holds; leave it out, or give "
            f"--method {' or '.join(METHODS)}"
        )
    if options.plan is not None:
        return read_plan(scene, options.plan)
    if options.method != PUBLISHED:
        return METHODS[options.method](build_network(scene), robots)
    if not is_reference_arch(scene):
        raise SceneError(
            f"scene {scene.name}: --method {PUBLISHED} is the printed plan for arch25; "
            "give --plan FILE for another scene"
        )
    return published_plan(scene)


def _scene(options: argparse.Namespace) -> None:
    if options.list:
        for name in builtin_scenes():
            scene = load_scene(name)
            _line(f"{name}: {len(scene.bricks)} bricks, {len(scene.joints)} joints; {about(name)}")
        return
    keep_apart(options, options.export)
    scene = load_scene(options.scene)
    parts = build_network(scene)
    count = len(scene.bricks)
    parts_of = f"{count} bricks, {len(scene.joints)} joints, {len(scene.grounds)} ground ends"
    _line(f"{scene.name}: {parts_of}")
    _line(f"network: {parts.count_nodes(count)} nodes, {parts.count_edges(count)} edges")
    for robot in scene.robots:
        _line(
            f"{robot.name}: payload {robot.payload:g} N, reach {type(robot.reach).__name__.lower()}"
        )
    _line(f"weight: {np.linalg.norm(parts.weight.sum(axis=0)):.1f} N")
    if scene.provenance:
        _line(f"provenance: {scene.provenance}")
    if options.export is not None:
        write_text(options.export, dump_scene(scene))
        say(f"written to {options.export}")


def _line(text: str) -> None:
    """Show a line whatever is in it: a provenance may have several."""
    show(text + "\n")


COMMANDS: dict[str, Callable[[argparse.Namespace], int | None]] = {
    "compare": _compare,
    "analyze": _analyze,
    "optimize": _optimize,
    "assess": _assess,
    "scene": _scene,
}
