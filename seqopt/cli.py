"""The command line: ``seqopt compare | analyze | scene``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from seqopt.compare import compare, format_comparison, is_reference_arch
from seqopt.engines import ENGINES
from seqopt.errors import SceneError, SeqoptError, SolverError, StepError
from seqopt.files import write_bytes, write_text
from seqopt.methods import METHODS
from seqopt.network import network
from seqopt.plan_file import published_plan, read_plan
from seqopt.responses import analyze, fields_archive
from seqopt.scene import Scene
from seqopt.scene_file import builtin_scenes, dump_scene, load_scene
from seqopt.steps import Step

PLANNED = "three-robot"
USAGE, FAILED = 2, 3  # exit statuses: the user must act; a solver failed


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(USAGE, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit status."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except SolverError as error:
        print(f"seqopt: solver failed: {error}", file=sys.stderr)
        return FAILED
    except SeqoptError as error:
        print(f"seqopt: error: {error}", file=sys.stderr)
        return USAGE
    except BrokenPipeError:  # the reader of our output has gone: not an error of ours
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="seqopt",
        description="Where should each robot hold a half-built structure, over the whole build?",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    scene, engine = _shared_arguments()
    command = commands.add_parser(
        "compare",
        parents=[scene, engine],
        help="all methods side by side",
        description="Analyze every method on a scene; show the largest responses side by side, for "
        "the reference arch beside those the study printed, and name what does not add up.",
    )
    command.set_defaults(run=_compare)
    command = commands.add_parser(
        "analyze",
        parents=[scene, engine],
        help="responses of every step of one method",
        description="Analyze every step of a method and write a table with the columns of Table "
        "A.1 of the study: forces in N, moments in N m, displacements in 1e-3 mm.",
        epilog="example: seqopt analyze arch25 --method cantilever --out cantilever.csv",
    )
    _analyze_arguments(command)
    command.set_defaults(run=_analyze)
    command = commands.add_parser(
        "scene",
        parents=[scene],
        help="check, describe and export a scene",
        description="Check a scene, say what is in it, and write it as JSON if asked.",
    )
    command.add_argument("--export", type=Path, metavar="FILE", help="JSON file to write")
    command.set_defaults(run=_scene)
    return parser


def _shared_arguments() -> tuple[_Parser, _Parser]:
    """Return parsers of the arguments that commands share: the scene, the engine."""
    scene = _Parser(add_help=False)
    scene.add_argument(
        "scene",
        nargs="?",
        default="arch25",
        metavar="SCENE",
        help=f"a built-in scene ({', '.join(builtin_scenes())}) or a JSON file; arch25 by default",
    )
    engine = _Parser(add_help=False)
    engine.add_argument(
        "--engine",
        choices=tuple(ENGINES),
        default="compliance",
        help="compliance: exactly rigid bricks, fast (default); frame: stiff bars, the slow check",
    )
    return scene, engine


def _analyze_arguments(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--method", choices=(*METHODS, PLANNED), required=True, help="how the build goes"
    )
    command.add_argument(
        "--plan", type=Path, metavar="FILE", help=f"CSV of the steps, with --method {PLANNED}"
    )
    command.add_argument(
        "--out", type=Path, metavar="FILE", help="CSV to write; standard output if not given"
    )
    command.add_argument(
        "--fields",
        type=Path,
        metavar="FILE",
        help="NumPy archive (.npz) to write: every edge force, node displacement and reaction",
    )


def _compare(options: argparse.Namespace) -> None:
    scene = load_scene(options.scene)
    print(format_comparison(compare(ENGINES[options.engine](network(scene))), scene))


def _analyze(options: argparse.Namespace) -> None:
    scene = load_scene(options.scene)
    engine = ENGINES[options.engine](network(scene))
    steps = _steps(scene, options)
    table = analyze(engine, steps)
    text = table.to_csv(index=False, float_format="%.6g", lineterminator="\n")
    if options.fields is not None:
        write_bytes(options.fields, fields_archive(engine, steps))
    if options.out is None:
        sys.stdout.write(text)
    else:
        write_text(options.out, text)
        print(f"{len(table)} steps written to {options.out}")


def _steps(scene: Scene, options: argparse.Namespace) -> tuple[Step, ...]:
    if options.method != PLANNED:
        if options.plan is not None:
            raise StepError(
                f"--plan {options.plan}: --method {options.method} makes its own steps; "
                f"use --method {PLANNED}"
            )
        return METHODS[options.method](network(scene))
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
    parts = network(scene)
    count = len(scene.bricks)
    parts_of = f"{count} bricks, {len(scene.joints)} joints, {len(scene.grounds)} ground ends"
    print(f"{scene.name}: {parts_of}")
    print(f"network: {parts.count_nodes(count)} nodes, {parts.count_edges(count)} edges")
    for robot in scene.robots:
        print(
            f"{robot.name}: payload {robot.payload:g} N, reach {type(robot.reach).__name__.lower()}"
        )
    print(f"weight: {sum(brick.mass for brick in scene.bricks) * 9.81:.1f} N")
    if scene.provenance:
        print(f"provenance: {scene.provenance}")
    if options.export is not None:
        write_text(options.export, dump_scene(scene))
        print(f"written to {options.export}")
