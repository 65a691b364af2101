"""The command ``import``: a scene of an assembly of others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from seqopt._cli import remarks
from seqopt._cli.answer import Answer
from seqopt._files import require_apart, write_text
from seqopt.errors import ProblemError
from seqopt.exchange._content import UNITS, UPS, Given
from seqopt.exchange._formats import readable
from seqopt.exchange.imports import import_scene
from seqopt.problem.requirements import number_word
from seqopt.scene.library.common import JointLaw
from seqopt.scene.scene_file import dump_scene
from seqopt.work.progress import Tell

MOST_ROBOTS = 100


def run(  # noqa: PLR0913  # every option is a parameter
    file: Path,
    *,
    out: Annotated[Path, ("value", "FILE")],
    format: Annotated[str | None, ("choices", readable)] = None,  # noqa: A002  # the option's name
    name: str | None = None,
    unit: Annotated[str | None, ("choices", UNITS)] = None,
    up: Annotated[str | None, ("choices", UPS)] = None,
    density: Annotated[float | None, ("value", "KG/M3")] = None,
    supports: Annotated[str | None, ("value", "KEY,KEY")] = None,
    robots: Annotated[int | None, ("value", "N"), ("most", MOST_ROBOTS)] = None,
    stiffness: Annotated[str | None, ("value", "NORMAL,TANGENTIAL")] = None,
    gap: Annotated[float | None, ("value", "M")] = None,
    detect: bool = False,
    accept_overlaps: bool = False,
    progress: Tell,
) -> Answer:
    """Read an assembly of others, say what was assumed, and write it as a scene.

    It is an assembly of COMPAS, meshes, or a table of boxes.

    Parameters
    ----------
    file : pathlib.Path
        What to read.
    out : pathlib.Path
        Scene to write, JSON.
    format : str, optional
        What the file is (default: what it looks like): {choices}.
    name : str, optional
        Of the scene (default: that of the file).
    unit : str, optional
        Unit of length of the file.
    up : str, optional
        Axis that is up (default: z).
    density : float, optional
        Of blocks for which the file has none, kg/m³.
    supports : str, optional
        Blocks that are the ground, by their keys or layers in the file (default: those that it
        marks, else what stands at the lowest level).
    robots : int, optional
        How many there are, mobile ones that reach all (default: those of the file, else 3).
    stiffness : str, optional
        Of joints by area, N/m³ (default: 1.5e9,1.5e8).
    gap : float, optional
        Most that may lie between faces that touch (default: a twentieth of the thinnest block).
    detect : bool, optional
        Look for faces although the file has some.
    accept_overlaps : bool, optional
        Import blocks that interpenetrate by more than faces tolerate.
    progress : callable, optional
        Called with the progress.

    Examples
    --------
    $ seqopt import wall.obj --unit m --density 2400 --out wall.json
    $ seqopt import boxes.csv --unit mm --supports 0,1 --out house.json
    """
    require_apart([out], [file])
    progress("reading the file")
    given = Given(
        unit=unit,
        up=up,
        density=density,
        gap=gap,
        detect=detect,
        accept_overlaps=accept_overlaps,
        robots=robots,
        name=name,
        progress=progress,
    )
    if supports is not None:
        keys = [key.strip() for key in supports.split(",") if key.strip()]
        given = replace(given, supports=keys)
    if stiffness is not None:
        pair, where = stiffness.split(","), f"--stiffness {stiffness}"
        if len(pair) != 2:
            raise ProblemError(f"{where}: give two numbers, as 1.5e9,1.5e8")
        along, across = (number_word(number, where) for number in pair)
        given = replace(given, law=JointLaw(translational=(along, across, across)))
    scene = import_scene(file, format, given)
    write_text(out, dump_scene(scene))
    assumed = scene.provenance.splitlines()
    said = "\n".join([*assumed, f"{remarks.size_line(scene)}; written to {out}"])
    return Answer({"assumed": assumed}, said, scene=scene, written=(out,))
