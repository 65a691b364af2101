"""The command ``import``: a scene of an assembly of others."""

from __future__ import annotations

import argparse
from pathlib import Path

from seqopt.cli.saying.answer import Answer
from seqopt.cli.words.asked import scene_facts
from seqopt.cli.words.common_arguments import form_arguments, group
from seqopt.cli.words.values import number_word
from seqopt.errors import ProblemError
from seqopt.files import require_apart, write_text
from seqopt.scene.imports.content import UNITS, UPS, Given
from seqopt.scene.imports.formats import FORMATS, import_scene
from seqopt.scene.library.common import JointLaw
from seqopt.scene.scene_file import dump_scene
from seqopt.work.progress import Tell

MOST_ROBOTS = 100
DESCRIPTION = (
    "Read an assembly of COMPAS, a mesh, a table of boxes or a frame, say what was assumed, and "
    "write it as a scene."
)
USAGE = ("FILE --out SCENE.json [--unit UNIT] [other options]",)
EXAMPLES = (
    "seqopt import wall.obj --unit m --density 2400 --out wall.json",
    "seqopt import boxes.csv --unit mm --supports 0,1 --out house.json",
)


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``import``."""
    basic = group(command, "what is read and written")
    basic.add_argument("file", type=Path, metavar="FILE", help="what to read")
    basic.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="scene to write, JSON"
    )
    basic.add_argument(
        "--format", choices=FORMATS, help="what the file is (default: what it looks like)"
    )
    basic.add_argument("--name", help="of the scene (default: that of the file)")
    said = group(command, "what the file does not say")
    said.add_argument("--unit", choices=UNITS, help="unit of length, where the file has none")
    said.add_argument("--up", choices=UPS, default="z", help="axis that is up (default: z)")
    said.add_argument(
        "--density", metavar="KG/M3", help="of blocks for which the file has none, kg/m³"
    )
    said.add_argument(
        "--supports",
        metavar="KEY,KEY",
        help="blocks that are the ground, by their keys in the file (default: those that it "
        "marks, else what stands at the lowest level)",
    )
    said.add_argument(
        "--robots", default="3", metavar="N", help="mobile robots that reach all (default: 3)"
    )
    joints = group(command, "joints (advanced)")
    joints.add_argument(
        "--stiffness",
        metavar="NORMAL,TANGENTIAL",
        help="of joints by area, N/m³, in place of that of the file (default: 1.5e9,1.5e8)",
    )
    joints.add_argument(
        "--gap",
        metavar="M",
        help="most that may lie between faces that touch (default: a twentieth of the thinnest "
        "block)",
    )
    joints.add_argument(
        "--detect", action="store_true", help="look for faces although the file has some"
    )
    form_arguments(group(command, "what is printed"))


def run(options: argparse.Namespace) -> Answer:
    """Read an assembly of others, and write it as a scene.

    ``options``: of the command.
    """
    require_apart([options.out], [options.file])
    options.tell("reading the file")
    scene = import_scene(options.file, options.format, _given(options, options.tell))
    write_text(options.out, dump_scene(scene))
    assumed = scene.provenance.splitlines()
    said = (
        f"{scene.name}: {len(scene.bricks)} bricks, {len(scene.joints)} joints, "
        f"{len(scene.grounds)} ground ends; written to {options.out}"
    )
    return Answer(
        facts={"scene": scene_facts(scene), "assumed": assumed},
        text="\n".join([*assumed, said]),
        written=(options.out,),
    )


def _given(options: argparse.Namespace, tell: Tell) -> Given:
    """Return what the words say where the file does not."""
    keys = options.supports
    return Given(
        unit=options.unit,
        up=options.up,
        density=_positive("--density", options.density),
        supports=None if keys is None else [key.strip() for key in keys.split(",") if key.strip()],
        law=_law(options.stiffness),
        gap=_positive("--gap", options.gap),
        detect=options.detect,
        robots=_robots(options.robots),
        name=options.name,
        progress=tell,
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
