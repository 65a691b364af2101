"""The words of the command line: commands, their arguments, and the help that they print."""

from __future__ import annotations

import argparse
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn, TypeAlias

from seqopt.cli.common_arguments import (
    caps_arguments,
    criterion_arguments,
    limit_argument,
    proof_argument,
    resources_arguments,
    robots_argument,
    robust_arguments,
    strict_argument,
)
from seqopt.cli.exchange import add_export, add_import
from seqopt.cli.free_arguments import add_pareto, add_rules
from seqopt.cli.hints import nearest
from seqopt.cli.status import Status
from seqopt.cli.terminal import complain, show
from seqopt.contact.mortar import MORTARS
from seqopt.engines.registry import ENGINES
from seqopt.placement.formulation import formulation_names
from seqopt.responses.staged import Placing
from seqopt.scene.orders import ORDERS
from seqopt.scene.scene_file import builtin_scenes
from seqopt.sequence.free_rules import FREE
from seqopt.sequence.three_robots import SCHEDULES
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import PUBLISHED


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, and whose help is a result like others."""

    words: tuple[str, ...] = ()  # options of all commands, for whoever mistypes one

    def print_help(self, file: object = None) -> None:
        show(self.format_help())

    def error(self, message: str) -> NoReturn:
        hint = nearest(message, self.words or self._option_string_actions)
        complain(f"{self.prog}: error: {message}{hint} (see {self.prog} --help)")
        self.exit(Status.BAD_INPUT)


Commands: TypeAlias = "argparse._SubParsersAction[_Parser]"


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line.

    Returns
    -------
    argparse.ArgumentParser
        ``command`` names what is to be run. A wrong word ends the program with status
        `seqopt.cli.status.Status.BAD_INPUT`.
    """
    whole = _Parser(
        prog="seqopt",
        description="Where should each robot hold a half-built structure, over the whole build?",
    )
    whole.add_argument("--version", action="version", version=f"seqopt {version('seqopt')}")
    commands = whole.add_subparsers(required=True, metavar="COMMAND", dest="command")
    scene, engine = _scene_argument(), _engine_arguments()
    _add_compare(commands, [scene, engine])
    _add_analyze(commands, [scene, engine])
    _add_optimize(commands, [scene, engine])
    add_pareto(commands, [scene, engine], limit_argument)
    _add_assess(commands, [scene])
    _add_report(commands, [scene, engine])
    _add_scene(commands, [scene])
    add_import(commands)
    add_export(commands)
    whole.words = tuple(
        word for command in commands.choices.values() for word in command._option_string_actions
    )
    return whole


def _scene_argument() -> _Parser:
    """Return a parser of the argument that all commands share."""
    scene = _Parser(add_help=False)
    scene.add_argument(
        "scene",
        nargs="?",
        default="arch25",
        metavar="SCENE",
        help=f"a built-in scene ({', '.join(builtin_scenes())}) or a JSON file; arch25 by default",
    )
    scene.add_argument(
        "--order",
        metavar="ORDER",
        help=f"in which bricks are placed, in the place of the scene's own: {', '.join(ORDERS)} "
        "(all ground ends at once), or their names, as 1..12,25..13; "
        "with a free schedule: search, for the best",
    )
    return scene


def _engine_arguments() -> _Parser:
    """Return a parser of the arguments that say what computes responses."""
    engine = _Parser(add_help=False)
    engine.add_argument(
        "--engine",
        choices=tuple(ENGINES),
        default="compliance",
        help="compliance: exactly rigid bricks, fast (default); frame: stiff bars, the slow check; "
        "planar: three unknowns per brick where all lies in a plane; discrete: joints that "
        "part and slip; auto: the cheapest of planar, compliance and discrete that is enough",
    )
    engine.add_argument(
        "--mortar",
        choices=tuple(MORTARS),
        help="what holds the joints of the engines auto and discrete: the epoxy of Bruun et al. or "
        "nothing (default: epoxy)",
    )
    return engine


def _add_compare(commands: Commands, parents: list[_Parser]) -> None:
    command = commands.add_parser(
        "compare",
        parents=parents,
        help="all methods side by side",
        description="Analyze every method on a scene; show the largest responses side by side, for "
        "the reference arch beside the printed ones, and list the inconsistencies in print.",
    )
    robots_argument(command, "all methods, which take as many as they need: the")
    criterion_arguments(command)
    command.add_argument("--out", type=Path, metavar="DIR", help="write tables and figures there")
    strict_argument(command)


def _add_analyze(commands: Commands, parents: list[_Parser]) -> None:
    command = commands.add_parser(
        "analyze",
        parents=parents,
        help="responses of every step of one method",
        description="Analyze every step of a method and write a table with the columns of Table "
        "A.1 of Bruun et al.: forces in N, moments in N m, displacements in 1e-3 mm.",
        epilog="example: seqopt analyze arch25 --method cantilever --out cantilever.csv",
    )
    _steps_arguments(command)
    command.add_argument(
        "--out", type=Path, metavar="FILE", help="CSV to write; standard output if not given"
    )
    command.add_argument(
        "--fields",
        type=Path,
        metavar="FILE",
        help="NumPy archive (.npz) to write: every edge force, node displacement and reaction",
    )
    command.add_argument(
        "--staged",
        choices=tuple(way.value for way in Placing),
        help="staged construction analysis instead of every step from scratch: bricks come without "
        "stress, set down fitted to the deformed structure or where they are planned, and grips "
        "close where they find their nodes",
    )
    strict_argument(command)


def _steps_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments that name a closed sequence of steps."""
    steps = command.add_mutually_exclusive_group(required=True)
    steps.add_argument(
        "--method",
        choices=(*METHODS, PUBLISHED),
        help=f"how the build goes; {PUBLISHED} is the printed three-robot plan of arch25",
    )
    steps.add_argument("--plan", type=Path, metavar="FILE", help="CSV of the steps")
    robots_argument(command, "--method sequential or cantilever: the two")


def _add_assess(commands: Commands, parents: list[_Parser]) -> None:
    command = commands.add_parser(
        "assess",
        parents=parents,
        help="does every step stand, and with what margins",
        description="Assess every step of a build as rigid blocks that touch: does it stand, the "
        "least bond and friction with which it does, the tilt it survives, the force robots must "
        "have, and what fails first. A verdict is proven by forces or by a motion.",
        epilog="example: seqopt assess arch25 --method cantilever --mortar dry --out dry.csv",
    )
    _steps_arguments(command)
    command.add_argument(
        "--mortar",
        choices=tuple(MORTARS),
        default="epoxy",
        help="what is in the joints: the epoxy of Bruun et al. (25°, 3 MPa, 2 MPa) or nothing "
        "(default: %(default)s)",
    )
    for name, metavar, text in (
        ("--friction", "NUMBER", "coefficient of friction"),
        ("--tensile-strength", "PA", "tensile strength"),
        ("--cohesion", "PA", "cohesion"),
    ):
        command.add_argument(name, metavar=metavar, help=f"{text}, in place of the mortar's own")
    command.add_argument(
        "--out", type=Path, metavar="FILE", help="CSV to write; standard output if not given"
    )


def _add_optimize(commands: Commands, parents: list[_Parser]) -> None:
    command = commands.add_parser(
        "optimize",
        parents=parents,
        help="choose every open grip of a build",
        description="Choose where robots hold, over all steps of a method, by one formulation; "
        "check the answer from the problem's own data, and write plan, selection, responses and "
        "summary.",
        epilog="example: seqopt optimize arch25 --formulation overlap_dp --out best",
    )
    command.add_argument(
        "--formulation",
        metavar="NAME",
        help=f"one of {', '.join(formulation_names())}; the free schedule has its own",
    )
    command.add_argument(
        "--schedule",
        default=next(iter(SCHEDULES)),
        metavar="NAME|FILE",
        help=f"which build has the open grips: {', '.join(SCHEDULES)} (of all robots), or a CSV "
        "file of steps in which open grips are marked ? (default: %(default)s); or "
        f"{FREE}: any robot may release, hold or place next",
    )
    robots_argument(command, "a schedule by name: the")
    criterion_arguments(command)
    command.add_argument(
        "--aim",
        metavar="NAME,NAME",
        help="with --schedule free, what is to be least, the most important first: minmax (of the "
        "criterion, worst-ratio by default), sum, steps, regrips, travel, a response or "
        "sum(RESPONSE) (default: minmax)",
    )
    add_rules(command)
    caps_arguments(command)
    command.add_argument(
        "--option",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="option of the formulation, as horizon=2 or width=10; may be repeated",
    )
    proof_argument(command)
    robust_arguments(command)
    resources_arguments(command)
    command.add_argument("--out", type=Path, metavar="DIR", required=True, help="folder to write")
    strict_argument(command)


def _add_report(commands: Commands, parents: list[_Parser]) -> None:
    command = commands.add_parser(
        "report",
        parents=parents,
        help="show plans step by step, as a page for the browser",
        description="Write a page with a step viewer of the plans in a folder: the structure in "
        "three dimensions, who holds what, axial forces, displacements and responses along the "
        "build. It is one file and needs no network. A scene.json in the folder is the scene.",
        epilog="example: seqopt report best",
    )
    command.add_argument("folder", type=Path, metavar="DIR", help="folder that holds plans as CSV")
    command.add_argument(
        "--out", type=Path, metavar="FILE", help="page to write (default: report.html in DIR)"
    )


def _add_scene(commands: Commands, parents: list[_Parser]) -> None:
    command = commands.add_parser(
        "scene",
        parents=parents,
        help="check, describe and export a scene",
        description="Check a scene, say what is in it, and write it as JSON if asked.",
        epilog="example: seqopt scene vault338 --export my.json",
    )
    what = command.add_mutually_exclusive_group()
    what.add_argument(
        "--list",
        action="store_true",
        help="name all built-in scenes, a line each: bricks, joints, what it is",
    )
    what.add_argument("--export", type=Path, metavar="FILE", help="JSON file to write")
