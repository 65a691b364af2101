"""The commands ``import`` and ``export``: assemblies of others in, plans out."""

from __future__ import annotations

import argparse
from pathlib import Path

from seqopt.cli.terminal import say, show
from seqopt.cli.values import number_word
from seqopt.errors import ProblemError
from seqopt.files import require_apart, write_text
from seqopt.scene.imports.content import UNITS, Given
from seqopt.scene.imports.formats import FORMATS, import_scene
from seqopt.scene.library.law import JointLaw
from seqopt.scene.scene_file import dump_scene
from seqopt.sequence.exports.formats import EXPORTS, export_plan, read_folder

MOST_ROBOTS = 100


def add_import(commands: argparse._SubParsersAction) -> None:  # type: ignore[type-arg]
    """Add the command ``import``.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = commands.add_parser(
        "import",
        help="make a scene of an assembly of others",
        description="Read an assembly of COMPAS, a mesh, a table of boxes or a frame, say what was "
        "assumed, and write it as a scene.",
        epilog="example: seqopt import wall.obj --unit m --density 2400 --out wall.json",
    )
    command.add_argument("file", type=Path, metavar="FILE", help="what to read")
    command.add_argument("--format", choices=FORMATS, help="by default what it looks like")
    command.add_argument(
        "--unit", metavar="UNIT", help=f"its unit of length, where it has none: {', '.join(UNITS)}"
    )
    command.add_argument(
        "--density", metavar="KG/M3", help="of blocks for which it has none, kg/m³"
    )
    command.add_argument(
        "--supports",
        metavar="KEY,KEY",
        help="blocks that are the ground, by their keys in the file; by default those that it "
        "marks, else what stands at the lowest level",
    )
    command.add_argument(
        "--stiffness",
        metavar="NORMAL,TANGENTIAL",
        help="of joints by area, N/m³, in place of that of the file (default: 1.5e9,1.5e8)",
    )
    command.add_argument(
        "--gap",
        metavar="M",
        help="most that may lie between faces that touch (default: a twentieth of the thinnest "
        "block)",
    )
    command.add_argument(
        "--detect", action="store_true", help="look for faces although the file has some"
    )
    command.add_argument(
        "--robots", default="3", metavar="N", help="mobile robots that reach all (default: 3)"
    )
    command.add_argument("--name", help="of the scene (default: that of the file)")
    command.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="scene to write, JSON"
    )


def add_export(commands: argparse._SubParsersAction) -> None:  # type: ignore[type-arg]
    """Add the command ``export``.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = commands.add_parser(
        "export",
        help="write a plan in a format of others",
        description="Write the plan of a folder, as seqopt optimize --out makes it, in a format of "
        "others: which block is absent, placed or held in which step.",
        epilog="example: seqopt export best --format csv --out blocks.csv",
    )
    command.add_argument("folder", type=Path, metavar="PLAN_DIR", help="folder of a plan")
    command.add_argument("--format", choices=tuple(EXPORTS), required=True, help="what to write")
    command.add_argument(
        "--source",
        type=Path,
        metavar="FILE",
        help="with a format of COMPAS: the file that was imported, to name its elements or to "
        "write the plan into",
    )
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="file to write")


def import_file(options: argparse.Namespace) -> None:
    """Read an assembly of others, and write it as a scene.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command ``import``.
    """
    require_apart([options.out], [options.file])
    scene = import_scene(options.file, options.format, _given(options))
    write_text(options.out, dump_scene(scene))
    for line in scene.provenance.splitlines():
        show(line + "\n")
    say(
        f"{scene.name}: {len(scene.bricks)} bricks, {len(scene.joints)} joints, "
        f"{len(scene.grounds)} ground ends; written to {options.out}"
    )


def _given(options: argparse.Namespace) -> Given:
    """Return what the words say where the file does not."""
    keys = options.supports
    return Given(
        unit=options.unit,
        density=_positive("--density", options.density),
        supports=None if keys is None else [key.strip() for key in keys.split(",") if key.strip()],
        law=_law(options.stiffness),
        gap=_positive("--gap", options.gap),
        detect=options.detect,
        robots=_robots(options.robots),
        name=options.name,
    )


def _positive(where: str, text: str | None) -> float | None:
    return None if text is None else number_word(text, f"{where} {text}")


def _law(text: str | None) -> JointLaw | None:
    if text is None:
        return None
    words = text.split(",")
    if len(words) != 2:
        raise ProblemError(f"--stiffness {text}: give two numbers, as 1.5e9,1.5e8")
    along, across = (number_word(word, f"--stiffness {text}") for word in words)
    return JointLaw(translational=(along, across, across))


def _robots(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:9]) <= MOST_ROBOTS:
        raise ProblemError(f"--robots {text}: give a whole number from 1 to {MOST_ROBOTS}")
    return int(text)


def export_folder(options: argparse.Namespace) -> None:
    """Write the plan of a folder in a format of others.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command ``export``.
    """
    inputs = [options.folder / name for name in ("scene.json", "plan.csv")]
    require_apart([options.out], [*inputs, *filter(None, [options.source])])
    scene, steps = read_folder(options.folder)
    write_text(options.out, export_plan(scene, steps, options.format, options.source))
    say(f"{len(steps)} steps written to {options.out}")
