"""The command ``import``: a scene of an assembly of others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from seqopt._cli import options, remarks
from seqopt._cli.answer import Answer
from seqopt._files import require_apart, write_text
from seqopt.errors import ProblemError
from seqopt.exchange._content import UNITS, UPS, Given
from seqopt.exchange._formats import readable
from seqopt.exchange.imports import import_scene
from seqopt.problem.requirements import number_word
from seqopt.scene.library.common import JointLaw
from seqopt.scene.scene_file import dump_scene

MOST_ROBOTS = 100


class Import(options.Asked):
    """What is read and written?

    file : FILE
        what to read
    out : FILE
        scene to write, JSON
    format : NAME
        what the file is (default: what it looks like): {choices}
    name : NAME
        of the scene (default: that of the file)

    What does the file not say?
    unit : CHOICE
        unit of length, where the file has none
    up : CHOICE
        axis that is up (default: y in a GLB, else z)
    density : KG/M3
        of blocks for which the file has none, kg/m³
    supports : KEY,KEY
        blocks that are the ground, by their keys or layers in the file (default: those that it
        marks, else what stands at the lowest level)
    robots : N
        how many there are, mobile ones that reach all (default: those of the file, else 3)

    Which joints are made?
    stiffness : NORMAL,TANGENTIAL
        of joints by area, N/m³, in place of that of the file (default: 1.5e9,1.5e8)
    gap : M
        most that may lie between faces that touch (default: a twentieth of the thinnest block)
    detect :
        look for faces although the file has some
    accept_overlaps :
        import blocks that interpenetrate by more than faces tolerate
    """

    file: Path = options.word(place=True)
    out: Path = options.word()
    format: str | None = options.word(None, choices=readable)
    name: str | None = None
    unit: str | None = options.word(None, choices=UNITS)
    up: str | None = options.word(None, choices=UPS)
    density: float | None = None
    supports: str | None = None
    robots: int | None = options.word(None, most=MOST_ROBOTS)
    stiffness: str | None = None
    gap: float | None = None
    detect: bool = False
    accept_overlaps: bool = False


def run(asked: Import) -> Answer:
    """Read an assembly of others, say what was assumed, and write it as a scene.

    It is a file of Rhino, an assembly of COMPAS, meshes, or a table of boxes.

    Usage
    FILE --out SCENE.json [--unit UNIT] [other options]

    Examples
    --------
    seqopt import wall.obj --unit m --density 2400 --out wall.json
    seqopt import boxes.csv --unit mm --supports 0,1 --out house.json
    """
    require_apart([asked.out], [asked.file])
    asked.tell("reading the file")
    scene = import_scene(asked.file, asked.format, _given(asked))
    write_text(asked.out, dump_scene(scene))
    assumed = scene.provenance.splitlines()
    said = f"{remarks.size_line(scene)}; written to {asked.out}"
    return Answer(
        facts={"assumed": assumed},
        scene=scene,
        text="\n".join([*assumed, said]),
        written=(asked.out,),
    )


def _given(asked: Import) -> Given:
    """Return the options that complete the data of the file."""
    same = ("unit", "up", "density", "gap", "detect", "accept_overlaps", "robots", "name")
    given = Given(**{name: getattr(asked, name) for name in same}, progress=asked.tell)
    if asked.supports is not None:
        keys = [key.strip() for key in asked.supports.split(",") if key.strip()]
        given = replace(given, supports=keys)
    if asked.stiffness is None:
        return given
    pair, where = asked.stiffness.split(","), f"--stiffness {asked.stiffness}"
    if len(pair) != 2:
        raise ProblemError(f"{where}: give two numbers, as 1.5e9,1.5e8")
    along, across = (number_word(number, where) for number in pair)
    return replace(given, law=JointLaw(translational=(along, across, across)))
