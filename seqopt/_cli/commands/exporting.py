"""The command ``export``: a plan in a format of others."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from seqopt._cli.answer import Answer
from seqopt._cli.inputs import posture_trouble, read_steps
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt._files import write_file
from seqopt.arms._kept import arm_faults
from seqopt.exchange._formats import formats
from seqopt.exchange.exports import export
from seqopt.work import Tell


def run(asked: Annotated[Call, ("call", export)], *, out: File = None, progress: Tell) -> Answer:
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
    Output(out, words.get("scene"), words.get("plan"), words.get("source")).keep_apart(out)
    (given, notes), form = read_steps(words, progress), formats()[format]
    scene, steps = given.network.scene, given.steps
    if "distance" in form.takes and scene.has_arms:
        if trouble := posture_trouble(scene, words.get("cache"), progress):
            notes = (*notes, f"arms: grips are proposals without postures; {trouble}")
        else:
            notes = (*notes, *(f"arms cannot: {fault}" for fault in arm_faults(scene, steps)))
    text = asked(scene=scene, steps=steps, progress=progress)
    said, lost = f"{len(steps)} steps", form.lost
    if lost:
        plan = "" if "steps" in lost else f" and {said}"
        said = f"{len(scene.bricks)} blocks{plan}, without {', '.join(lost)},"
    facts = {"steps": len(steps), "format": format}
    answer = Answer(facts, notes=notes, scene=scene)
    if out is None:
        return replace(answer, facts=facts | {"text": text}, data=text)
    write_file(out, text)
    return replace(answer, text=f"{said} written to {out}", written=(out,))
