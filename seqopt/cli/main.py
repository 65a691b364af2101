"""The command line: ``seqopt import | scene | analyze | assess | optimize | report | …``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from seqopt.cli.arguments import parser
from seqopt.cli.asked import (
    asked_engine,
    asked_scene,
    payloads_hold,
    say_idle,
    say_levels,
    step_answers,
)
from seqopt.cli.criteria import asked_criterion
from seqopt.cli.exchange import export_folder, import_file
from seqopt.cli.free import pareto
from seqopt.cli.hints import EXAMPLES
from seqopt.cli.optimize import optimize
from seqopt.cli.outputs import (
    comparison_files,
    keep_apart,
    require_matplotlib,
    write_outputs,
)
from seqopt.cli.status import Status, status_of
from seqopt.cli.terminal import (
    flush,
    progress,
    quiet_numbers,
    say,
    show,
    silence,
)
from seqopt.cli.values import (
    parse_mortar,
    parse_robots,
)
from seqopt.errors import SceneError, SeqoptError, SolverError, StepError
from seqopt.files import (
    csv_text,
    require_folder,
    write_bytes,
    write_csv,
    write_text,
)
from seqopt.network.build import build_network
from seqopt.report.comparison import compare
from seqopt.report.plan_pages import PAGE, comparison_page, folder_page
from seqopt.report.text import format_comparison
from seqopt.responses.table import archive, response_table
from seqopt.scene.library.by_words import KINDS
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import about, builtin_scenes, dump_scene, load_scene
from seqopt.sequence.plan_file import read_plan
from seqopt.sequence.steps import Step
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import Verdict
from seqopt.stability.steps import assess_steps, format_verdicts, stability_table
from seqopt.study.published import PUBLISHED, is_reference_arch, published_plan


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
    if not (sys.argv[1:] if arguments is None else arguments):
        show(EXAMPLES)
        return Status.DONE
    try:
        options = parser().parse_args(arguments)
    except SystemExit as stop:  # the parser has said why, or printed its help
        return int(stop.code or 0)
    with quiet_numbers():
        return COMMANDS[options.command](options) or Status.DONE


def _compare(options: argparse.Namespace) -> Status:
    scene = asked_scene(options)
    engine = asked_engine(options, build_network(scene))
    criterion = asked_criterion(options)
    if options.out is not None:
        require_matplotlib(options.out)
        require_folder(options.out)
    result = compare(engine, criterion, progress, parse_robots(options.robots))
    say_levels(engine)
    show(format_comparison(result, scene, criterion) + "\n")
    if options.out is not None and result.loop is not None:
        files = comparison_files(result) | {PAGE: comparison_page(engine, result)}
        write_outputs(options, files)
        say(f"tables and figures written to {options.out}")
    return payloads_hold(options, scene, *result.tables.values())


def _analyze(options: argparse.Namespace) -> Status:
    keep_apart(options, options.out, options.fields)
    scene = asked_scene(options)
    network = build_network(scene)
    engine, steps = asked_engine(options, network), _steps(scene, options)
    table = response_table(network, step_answers(options, engine, steps))
    say_levels(engine)
    if options.fields is not None:
        write_bytes(options.fields, archive(network, step_answers(options, engine, steps)))
    if options.out is None:
        show(csv_text(table))
    else:
        write_csv(options.out, table)
        say(f"{len(table)} steps written to {options.out}")
    say_idle(scene, steps)
    return payloads_hold(options, scene, table)


def _assess(options: argparse.Namespace) -> Status:
    keep_apart(options, options.out)
    scene = asked_scene(options)
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


def _report(options: argparse.Namespace) -> None:
    own = options.folder / "scene.json"
    if own.is_file():  # plans go with the scene that stands beside them
        options.scene = str(own)
    engine = asked_engine(options, build_network(asked_scene(options)))
    path = options.folder / PAGE if options.out is None else options.out
    keep_apart(options, path)
    write_text(path, folder_page(engine, options.folder))
    say(f"written to {path}")


def _scene(options: argparse.Namespace) -> None:
    if options.list:
        for name in builtin_scenes():
            scene = load_scene(name)
            _line(f"{name}: {len(scene.bricks)} bricks, {len(scene.joints)} joints; {about(name)}")
        for kind in KINDS.values():
            _line(kind.about)
        return
    keep_apart(options, options.export)
    scene = asked_scene(options)
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
    "optimize": optimize,
    "pareto": pareto,
    "assess": _assess,
    "report": _report,
    "scene": _scene,
    "import": import_file,
    "export": export_folder,
}
