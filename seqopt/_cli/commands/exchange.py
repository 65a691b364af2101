"""The commands ``import`` and ``export``: scenes of other programs, and plans for them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from seqopt._cli.answer import Answer
from seqopt._cli.outputs import read_steps
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt._files import write_file
from seqopt.arms._kept import arm_faults, posture_trouble
from seqopt.exchange._content import Given
from seqopt.exchange._files import Output, require_apart
from seqopt.exchange._formats import formats, readable
from seqopt.exchange.exports import export
from seqopt.exchange.imports import import_scene
from seqopt.network._words import size_line
from seqopt.scene.scene_file import dump_scene
from seqopt.work import Tell


def read(
    file: Path,
    *,
    out: Annotated[Path, ("value", "FILE")],
    given: Annotated[Call, ("call", Given)],
    format: Annotated[str | None, ("choices", readable)] = None,  # noqa: A002  # the option's name
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

    Examples
    --------
    $ seqopt import wall.obj --unit m --density 2400 --out wall.json
    $ seqopt import boxes.csv --unit mm --supports 0,1 --out house.json
    """
    require_apart([out], [file])
    progress("reading the file")
    scene = import_scene(file, format, given(progress=progress))
    write_file(out, dump_scene(scene))
    assumed = scene.provenance.splitlines()
    text = "\n".join([*assumed, f"{size_line(scene)}; written to {out}"])
    return Answer({"assumed": assumed}, text, scene=scene, written=(out,))


def write(asked: Annotated[Call, ("call", export)], *, out: File = None, progress: Tell) -> Answer:
    """Write the plan of a folder, as seqopt optimize --out makes it, in a format of others.

    It says what each robot does and where, or is the assembly with its plan.

    Parameters
    ----------
    out : pathlib.Path, optional
        File to write (default: standard output).

    Examples
    --------
    $ seqopt export best --format tasks --distance 0.15 --out tasks.json
    """
    words, format = asked.words, asked.words.get("format", "tasks")  # noqa: A001
    output = Output(out, words.get("scene"), words.get("plan"), words.get("source"))
    output.keep_apart(out)
    (given, notes), form = read_steps(words, progress), formats()[format]
    scene, steps = given.network.scene, given.steps
    if "distance" in form.takes and scene.has_arms:
        if trouble := posture_trouble(scene, words.get("cache"), progress):
            notes = (*notes, f"arms: grips are proposals without postures; {trouble}")
        else:
            notes = (*notes, *(f"arms cannot: {fault}" for fault in arm_faults(scene, steps)))
    text = asked(scene=scene, steps=steps, progress=progress)
    line, lost = f"{len(steps)} steps", form.lost
    if lost:
        plan = "" if "steps" in lost else f" and {line}"
        line = f"{len(scene.bricks)} blocks{plan}, without {', '.join(lost)},"
    facts = {"steps": len(steps), "format": format, **({} if out else {"text": text})}
    return Answer(facts, **output.put(text, line), notes=notes, scene=scene)
