"""The command ``import``: a scene of an assembly of others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from seqopt._cli import remarks
from seqopt._cli.answer import Answer
from seqopt._cli.signatures import Call
from seqopt._files import write_file
from seqopt.errors import ProblemError
from seqopt.exchange._content import Given
from seqopt.exchange._files import require_apart
from seqopt.exchange._formats import readable
from seqopt.exchange.imports import import_scene
from seqopt.problem.requirements import number_word
from seqopt.scene.library.common import JointLaw
from seqopt.scene.scene_file import dump_scene
from seqopt.work import Tell


def run(
    file: Path,
    *,
    out: Annotated[Path, ("value", "FILE")],
    given: Annotated[Call, ("call", Given)],
    format: Annotated[str | None, ("choices", readable)] = None,  # noqa: A002  # the option's name
    supports: Annotated[str | None, ("value", "KEY,KEY")] = None,
    stiffness: Annotated[str | None, ("value", "NORMAL,TANGENTIAL")] = None,
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
        What the file is (default: what it looks like).
    supports : str, optional
        Blocks that are the ground, by their keys in the file (default: those that it marks,
        else what stands at the lowest level).
    stiffness : str, optional
        Of joints by area, N/m³ (default: 1.5e9,1.5e8).

    Examples
    --------
    $ seqopt import wall.obj --unit m --density 2400 --out wall.json
    $ seqopt import boxes.csv --unit mm --supports 0,1 --out house.json
    """
    require_apart([out], [file])
    progress("reading the file")
    more: dict[str, Any] = {"progress": progress}
    if stiffness is not None:
        pair, where = stiffness.split(","), f"--stiffness {stiffness}"
        if len(pair) != 2:
            raise ProblemError(f"{where}: give two numbers, as 1.5e9,1.5e8")
        along, across = (number_word(number, where) for number in pair)
        more["law"] = JointLaw(translational=(along, across, across))
    asked = given(**more)
    if supports is not None:  # also if none are supports
        asked = replace(asked, supports=[key.strip() for key in supports.split(",") if key.strip()])
    scene = import_scene(file, format, asked)
    write_file(out, dump_scene(scene))
    assumed = scene.provenance.splitlines()
    said = "\n".join([*assumed, f"{remarks.size_line(scene)}; written to {out}"])
    return Answer({"assumed": assumed}, said, scene=scene, written=(out,))
