"""The command ``import``: a scene of an assembly of others."""

from __future__ import annotations

import argparse

from seqopt._cli.answer import Answer
from seqopt._cli.asked import scene_facts, size_line
from seqopt._cli.options import declare, form_options
from seqopt._cli.screens import question
from seqopt._cli.values import count_word
from seqopt._files import require_apart, write_text
from seqopt.errors import ProblemError
from seqopt.exchange._content import UNITS, UPS, Given
from seqopt.exchange.imports import FORMATS, import_scene
from seqopt.problem._limit_words import number_word
from seqopt.scene.library.common import JointLaw
from seqopt.scene.scene_file import dump_scene

MOST_ROBOTS = 100
DESCRIPTION = (
    "Read a file of Rhino, an assembly of COMPAS, meshes in a file or a folder, a table of boxes "
    "or a frame, say what was assumed, and write it as a scene."
)
USAGE = ("FILE|FOLDER --out SCENE.json [--unit UNIT] [other options]",)
EXAMPLES = (
    "seqopt import wall.obj --unit m --density 2400 --out wall.json",
    "seqopt import boxes.csv --unit mm --supports 0,1 --out house.json",
    "seqopt import blocks --unit m --density 2400 --supports 0 --out dome.json",
)


KEYS = {
    "--density KG/M3": "of blocks for which the file has none, kg/m³",
    "--supports KEY,KEY": "blocks that are the ground, by their keys or layers in the file "
    "(default: those that it marks, else what stands at the lowest level)",
}
JOINTS = {
    "--stiffness NORMAL,TANGENTIAL": "of joints by area, N/m³, in place of that of the file "
    "(default: 1.5e9,1.5e8)",
    "--gap M": "most that may lie between faces that touch (default: a twentieth of the thinnest "
    "block)",
    "--detect": "look for faces although the file has some",
    "--accept-overlaps": "import blocks that interpenetrate by more than faces tolerate",
}


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``import``."""
    basic = question(command, "What is read and written?")
    declare(basic, {"file FILE": "what to read, or a folder of meshes with a block in each"})
    declare(basic, {"--out FILE": "scene to write, JSON"}, required=True)
    what = f"what the file is (default: what it looks like): {', '.join(FORMATS)}"
    basic.add_argument("--format", choices=FORMATS, metavar="NAME", help=what)
    basic.add_argument("--name", help="of the scene (default: that of the file)")
    said = question(command, "What does the file not say?")
    said.add_argument("--unit", choices=UNITS, help="unit of length, where the file has none")
    up = "axis that is up (default: y in a GLB, else z)"
    said.add_argument("--up", choices=UPS, help=up)
    declare(said, KEYS)
    robots = "how many there are, mobile ones that reach all (default: those of the file, else 3)"
    declare(said, {"--robots N": robots})
    declare(question(command, "Which joints are made?"), JOINTS)
    form_options(command)


def run(options: argparse.Namespace) -> Answer:
    """Read an assembly of others, and write it as a scene."""
    require_apart([options.out], [options.file])
    options.tell("reading the file")
    scene = import_scene(options.file, options.format, _given(options))
    write_text(options.out, dump_scene(scene))
    assumed = scene.provenance.splitlines()
    said = f"{size_line(scene)}; written to {options.out}"
    return Answer(
        facts={"scene": scene_facts(scene), "assumed": assumed},
        text="\n".join([*assumed, said]),
        written=(options.out,),
    )


def _given(options: argparse.Namespace) -> Given:
    """Return what the words say where the file does not."""
    keys, robots = options.supports, options.robots
    return Given(
        unit=options.unit,
        up=options.up,
        density=_positive("--density", options.density),
        supports=None if keys is None else [key.strip() for key in keys.split(",") if key.strip()],
        law=_law(options.stiffness),
        gap=_positive("--gap", options.gap),
        detect=options.detect,
        accept_overlaps=options.accept_overlaps,
        robots=robots if robots is None else count_word(robots, "--robots", MOST_ROBOTS),
        name=options.name,
        progress=options.tell,
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
