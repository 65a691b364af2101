"""The command line: ``seqopt compare | optimize | analyze | assess | scene``."""

from __future__ import annotations

import argparse
import io
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from seqopt.cli.arguments import USAGE, parser
from seqopt.cli.values import parse_criterion, parse_limits, parse_mortar, parse_options
from seqopt.contact.mortar import MORTARS
from seqopt.engines.auto import AutoEngine
from seqopt.engines.interface import Engine
from seqopt.engines.registry import make_engine
from seqopt.errors import FileError, SceneError, SeqoptError, SolverError
from seqopt.files import csv_text, make_folder, write_bytes, write_csv, write_text
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.placement.formulation import find_formulation
from seqopt.placement.plan import Plan
from seqopt.placement.problem import pose
from seqopt.placement.solving import solve
from seqopt.report.comparison import Comparison, compare
from seqopt.report.text import format_comparison
from seqopt.responses.table import analyze, fields_archive
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import dump_scene, load_scene
from seqopt.sequence.plan_file import read_plan
from seqopt.sequence.steps import Step
from seqopt.sequence.three_robots import make_schedule
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import Verdict
from seqopt.stability.steps import assess_steps, format_verdicts, stability_table
from seqopt.study.published import PUBLISHED, is_reference_arch, paper_models, published_plan

FAILED = 3  # exit status where a solver failed; USAGE where the user must act


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    arguments : sequence of str, optional
        The words after ``seqopt``; by default those of the shell.

    Returns
    -------
    int
        The exit status: 0, `USAGE` where the user must act, `FAILED` where a solver failed. An
        error is one line on standard error.
    """
    options = parser().parse_args(arguments)
    try:
        COMMANDS[options.command](options)
    except SolverError as error:
        print(f"seqopt: solver failed: {error}", file=sys.stderr)
        return FAILED
    except SeqoptError as error:
        print(f"seqopt: error: {error}", file=sys.stderr)
        return USAGE
    except BrokenPipeError:  # the reader of our output has gone: not an error of ours
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _compare(options: argparse.Namespace) -> None:
    scene = load_scene(options.scene)
    engine = _engine(options, build_network(scene))
    criterion = parse_criterion(options.criteria, options.crown)
    if options.out is not None:
        _require_matplotlib(options.out)
        make_folder(options.out)
    result = compare(engine, criterion, _progress)
    _say_levels(engine)
    print(format_comparison(result, scene, criterion))
    if options.out is not None and not result.refusal:
        _write_comparison(options.out, result)


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
        print(
            f"engine: {choice.level.value} for {sets} grip sets: {choice.reason}", file=sys.stderr
        )
    if engine.unchecked:
        print(f"engine: {engine.unchecked}", file=sys.stderr)


def _progress(stage: str) -> None:
    """Say what is being done where a person watches."""
    if sys.stderr.isatty():
        print(f"\r\033[K{stage} …", end="\r", file=sys.stderr, flush=True)


def _require_matplotlib(folder: Path) -> None:
    if find_spec("matplotlib") is None:
        raise FileError(f"figures for {folder} need matplotlib: pip install matplotlib")


def _write_comparison(folder: Path, result: Comparison) -> None:
    from seqopt.report.charts import comparison_figures  # noqa: PLC0415  # matplotlib is an extra

    write_text(folder / "comparison.csv", result.table.to_csv(float_format="%.6g"))
    if result.ranks is not None:
        write_text(folder / "published_ranks.csv", result.ranks.to_csv(index=False))
    for name, table in result.tables.items():
        write_csv(folder / f"steps_{name}.csv", table)
    for name, figure in comparison_figures(result).items():
        buffer = io.BytesIO()
        figure.savefig(buffer, dpi=130)
        write_bytes(folder / name, buffer.getvalue())
    print(f"tables and figures written to {folder}")


def _optimize(options: argparse.Namespace) -> None:
    formulation = find_formulation(options.formulation)
    chosen = parse_options(formulation, options.option)
    criterion = parse_criterion(options.criteria, options.crown)
    scene = load_scene(options.scene)
    limits = parse_limits(options.limit, scene)
    make_folder(options.out)
    start = time.perf_counter()
    network = build_network(scene)
    engine, schedule = _engine(options, network), make_schedule(options.schedule, network)
    assemble = time.perf_counter() - start
    problem = pose(engine, schedule, criterion, limits)
    plan = solve(problem, formulation, proof=not options.no_proof, **chosen)
    _say_levels(engine)
    cascading, overlap = paper_models(schedule)
    report = plan.summary() | {
        "models_paper_count": {"cascading": cascading, "overlap": overlap},
        "seconds": {"assemble": assemble, **plan.seconds},
    }
    write_csv(options.out / "plan.csv", plan.responses())
    write_csv(options.out / "selection.csv", plan.table())
    write_csv(options.out / "responses.csv", plan.alternatives())
    write_text(options.out / "summary.json", json.dumps(report, indent=2) + "\n")
    print(
        f"{formulation.name} ({formulation.kind.value}): {_worth(plan)}, "
        f"{plan.models} models; written to {options.out}"
    )
    for excess in plan.overloads:
        print(f"payload exceeded: {excess}")


def _worth(plan: Plan) -> str:
    if plan.certificate is None:
        return "not compared with the optimum"
    return f"objective {plan.certificate.objective:.6g}, gap {100 * plan.certificate.gap:.3g} %"


def _analyze(options: argparse.Namespace) -> None:
    scene = load_scene(options.scene)
    engine = _engine(options, build_network(scene))
    steps = _steps(scene, options)
    table = analyze(engine, steps)
    _say_levels(engine)
    if options.fields is not None:
        write_bytes(options.fields, fields_archive(engine, steps))
    if options.out is None:
        sys.stdout.write(csv_text(table))
    else:
        write_csv(options.out, table)
        print(f"{len(table)} steps written to {options.out}")


def _assess(options: argparse.Namespace) -> None:
    scene = load_scene(options.scene)
    mortar = parse_mortar(options)
    network = build_network(scene)
    steps = _steps(scene, options)
    results = assess_steps(network, steps, mortar, _progress)
    table = stability_table(steps, results)
    if options.out is None:
        sys.stdout.write(csv_text(table))
    else:
        write_csv(options.out, table)
        print(f"{format_verdicts(results)}; written to {options.out}")
    undecided = [
        s.number for s, r in zip(steps, results, strict=True) if r.verdict is Verdict.UNDECIDED
    ]
    if undecided:
        raise SolverError(
            f"steps {', '.join(map(str, undecided))} are undecided; this says nothing about them"
        )


def _steps(scene: Scene, options: argparse.Namespace) -> tuple[Step, ...]:
    """Return the closed sequence that the options name."""
    if options.plan is not None:
        return read_plan(scene, options.plan)
    if options.method != PUBLISHED:
        return METHODS[options.method](build_network(scene))
    if not is_reference_arch(scene):
        raise SceneError(
            f"scene {scene.name}: --method {PUBLISHED} is the printed plan for arch25; "
            "give --plan FILE for another scene"
        )
    return published_plan(scene)


def _scene(options: argparse.Namespace) -> None:
    scene = load_scene(options.scene)
    parts = build_network(scene)
    count = len(scene.bricks)
    parts_of = f"{count} bricks, {len(scene.joints)} joints, {len(scene.grounds)} ground ends"
    print(f"{scene.name}: {parts_of}")
    print(f"network: {parts.count_nodes(count)} nodes, {parts.count_edges(count)} edges")
    for robot in scene.robots:
        print(
            f"{robot.name}: payload {robot.payload:g} N, reach {type(robot.reach).__name__.lower()}"
        )
    print(f"weight: {np.linalg.norm(parts.weight.sum(axis=0)):.1f} N")
    if scene.provenance:
        print(f"provenance: {scene.provenance}")
    if options.export is not None:
        write_text(options.export, dump_scene(scene))
        print(f"written to {options.export}")


COMMANDS: dict[str, Callable[[argparse.Namespace], None]] = {
    "compare": _compare,
    "analyze": _analyze,
    "optimize": _optimize,
    "assess": _assess,
    "scene": _scene,
}
