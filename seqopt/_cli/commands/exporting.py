"""The command ``export``: a plan in a format of others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from seqopt._cli.answer import Answer
from seqopt._cli.inputs import posture_trouble, read_steps
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt._files import write_text
from seqopt.arms._kept import arm_faults
from seqopt.exchange._formats import formats, writable
from seqopt.exchange.exports import export_plan
from seqopt.work.progress import Tell


def export(
    asked: Annotated[Call, ("call", read_steps)],
    *,
    format: Annotated[str, ("choices", writable)] = "tasks",  # noqa: A002  # the option's name
    source: Path | None = None,
    distance: Annotated[float | None, ("value", "M")] = None,
    out: File = None,
    progress: Tell,
) -> Answer:
    """Write the plan of a folder, as seqopt optimize --out makes it, in a format of others.

    It says what each robot does and where, or is the assembly with its plan.

    Parameters
    ----------
    format : str, optional
        What to write (default: {default}): {choices}.
    source : pathlib.Path, optional
        With compas_assembly: the assembly that was imported, to write the plan into.
    distance : float, optional
        With tasks or tasks_csv: from a grip to where the tool comes from and goes to, m (default:
        the longest side of each block).
    out : pathlib.Path, optional
        File to write (default: standard output).

    Examples
    --------
    $ seqopt export best --format tasks --distance 0.15 --out tasks.json
    """
    Output(out, asked.words.get("scene"), asked.words.get("plan"), source).keep_apart(out)
    given = asked(progress=progress)
    scene, steps, notes, form = given.scene, given.steps, given.notes, formats()[format]
    if "distance" in form.takes and scene.has_arms:
        if trouble := posture_trouble(scene, asked.words.get("cache"), progress):
            notes = (*notes, f"arms: grips are proposals without postures; {trouble}")
        else:
            notes = (*notes, *(f"arms cannot: {fault}" for fault in arm_faults(scene, steps)))
    text = export_plan(scene, steps, format, source, distance)
    said, lost = f"{len(steps)} steps", form.lost
    if lost:
        plan = "" if "steps" in lost else f" and {said}"
        said = f"{len(scene.bricks)} blocks{plan}, without {', '.join(lost)},"
    facts = {"steps": len(steps), "format": format}
    answer = Answer(facts, notes=notes, scene=scene)
    if out is None:
        return replace(answer, facts=facts | {"text": text}, data=text)
    write_text(out, text)
    return replace(answer, text=f"{said} written to {out}", written=(out,))
