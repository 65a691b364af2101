"""The command line: ``seqopt compare | analyze | optimize | certify | scene``."""

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

from seqopt.cli.arguments import (
    PLANNED,
    USAGE,
    parse_criterion,
    parse_limits,
    parse_mortar,
    parse_options,
    parser,
)
from seqopt.contact.mortar import MORTARS
from seqopt.engines.auto import AutoEngine
from seqopt.engines.interface import Engine
from seqopt.engines.registry import make_engine
from seqopt.errors import FileError, ProblemError, SceneError, SeqoptError, SolverError, StepError
from seqopt.files import make_folder, write_bytes, write_text
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.placement.formulation import find_formulation
from seqopt.placement.plan import (
    optimize,
    plan_table,
    prepare,
    responses_table,
    selection_table,
    summary,
)
from seqopt.placement.window_search import (
    require_search,
    search_responses,
    search_summary,
    search_table,
    search_windows,
)
from seqopt.report.comparison import compare_methods, format_comparison
from seqopt.report.contest import Contest, contest, format_contest
from seqopt.responses.table import analyze, fields_archive
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import dump_scene, load_scene
from seqopt.sequence.plan_file import read_plan
from seqopt.sequence.steps import Step
from seqopt.sequence.three_robots import SCHEDULES
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import Verdict
from seqopt.stability.steps import assess_steps, format_verdicts, stability_table
from seqopt.study.published import is_reference_arch, published_plan

FAILED = 3  # exit status where a solver failed; USAGE where the user must act


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit status."""
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
    criterion = parse_criterion(options.criteria)
    if options.out is not None:
        _require_matplotlib(options.out)
        make_folder(options.out)
    methods = compare_methods(engine)
    print(format_comparison(methods, scene), end="\n\n")
    try:
        result = contest(engine, methods, criterion, _progress)
    except (StepError, ProblemError) as error:
        print(f"Three-robot loop: not possible here; {error}")
        return
    finally:
        _say_levels(engine)
    print(format_contest(result, criterion))
    if options.out is not None:
        _write_contest(options.out, result)


def _engine(options: argparse.Namespace, net: Network) -> Engine:
    mortar = None if options.mortar is None else MORTARS[options.mortar]
    return make_engine(options.engine, net, mortar)


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


def _write_contest(folder: Path, result: Contest) -> None:
    from seqopt.report.charts import contest_figures  # noqa: PLC0415  # matplotlib is an extra

    write_text(folder / "contest.csv", result.table.to_csv(float_format="%.6g"))
    if result.ranks is not None:
        write_text(folder / "published_ranks.csv", result.ranks.to_csv(index=False))
    for name, table in result.tables.items():
        text = table.to_csv(index=False, float_format="%.6g", lineterminator="\n")
        write_text(folder / f"steps_{name.replace(' ', '_')}.csv", text)
    for name, figure in contest_figures(result).items():
        buffer = io.BytesIO()
        figure.savefig(buffer, dpi=130)
        write_bytes(folder / name, buffer.getvalue())
    print(f"tables and figures written to {folder}")


def _optimize(options: argparse.Namespace) -> None:
    which = find_formulation(options.formulation)
    chosen = parse_options(which, options.option)
    if options.no_proof:
        require_search(which, chosen)
    criterion = parse_criterion(options.criteria)
    scene = load_scene(options.scene)
    limits = parse_limits(options.limit, scene)
    make_folder(options.out)
    start = time.perf_counter()
    net = build_network(scene)
    engine = _engine(options, net)
    schedule = SCHEDULES[options.method](net)
    assemble = time.perf_counter() - start
    if options.no_proof:
        found = search_windows(engine, schedule, criterion, limits)
        report, plan, seconds = search_summary(found, which), found.plan, found.seconds
        files = {"selection.csv": search_table(found), "responses.csv": search_responses(found)}
        worth = "not compared with the optimum"
    else:
        outcome = optimize(prepare(engine, schedule, criterion, limits), which, **chosen)
        report, plan, seconds = summary(outcome), outcome.plan, outcome.seconds
        files = {
            "selection.csv": selection_table(outcome),
            "responses.csv": responses_table(outcome.problem),
        }
        gap = 100 * outcome.certificate.gap
        worth = f"objective {report['objective']:.6g}, gap {gap:.3g} %"
    _say_levels(engine)
    report["seconds"] = {"assemble": assemble, **seconds}
    for name, table in {"plan.csv": plan_table(engine, schedule, plan), **files}.items():
        text = table.to_csv(index=False, float_format="%.6g", lineterminator="\n")
        write_text(options.out / name, text)
    write_text(options.out / "summary.json", json.dumps(report, indent=2) + "\n")
    print(
        f"{which.name} ({which.kind.value}): {worth}, "
        f"{report['models_evaluated']} models; written to {options.out}"
    )


def _analyze(options: argparse.Namespace) -> None:
    scene = load_scene(options.scene)
    engine = _engine(options, build_network(scene))
    steps = _steps(scene, options)
    table = analyze(engine, steps)
    _say_levels(engine)
    text = table.to_csv(index=False, float_format="%.6g", lineterminator="\n")
    if options.fields is not None:
        write_bytes(options.fields, fields_archive(engine, steps))
    if options.out is None:
        sys.stdout.write(text)
    else:
        write_text(options.out, text)
        print(f"{len(table)} steps written to {options.out}")


def _certify(options: argparse.Namespace) -> None:
    scene = load_scene(options.scene)
    mortar = parse_mortar(options)
    net = build_network(scene)
    steps = _steps(scene, options)
    results = assess_steps(net, steps, mortar, _progress)
    text = stability_table(steps, results).to_csv(
        index=False, float_format="%.6g", lineterminator="\n"
    )
    if options.out is None:
        sys.stdout.write(text)
    else:
        write_text(options.out, text)
        print(f"{format_verdicts(results)}; written to {options.out}")
    undecided = [
        s.number for s, r in zip(steps, results, strict=True) if r.verdict is Verdict.UNDECIDED
    ]
    if undecided:
        raise SolverError(
            f"steps {', '.join(map(str, undecided))} are undecided; this says nothing about them"
        )


def _steps(scene: Scene, options: argparse.Namespace) -> tuple[Step, ...]:
    if options.method is None:
        return read_plan(scene, options.plan)
    if options.method != PLANNED:
        if options.plan is not None:
            raise StepError(
                f"--plan {options.plan}: --method {options.method} makes its own steps; "
                f"use --method {PLANNED}"
            )
        return METHODS[options.method](build_network(scene))
    if options.plan is not None:
        return read_plan(scene, options.plan)
    if not is_reference_arch(scene):
        raise SceneError(
            f"scene {scene.name}: --method {PLANNED} needs --plan FILE; "
            "the published plan is for arch25"
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
    "certify": _certify,
    "scene": _scene,
}
