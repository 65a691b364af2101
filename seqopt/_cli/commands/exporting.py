"""The command ``export``: a plan in a format of others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from seqopt._cli import inputs
from seqopt._cli.answer import Answer
from seqopt._cli.signatures import door
from seqopt._cli.words import BuiltFrom, File, shown
from seqopt._files import require_apart, write_text
from seqopt.arms._kept import arm_faults
from seqopt.exchange._formats import formats, writable
from seqopt.exchange.exports import export_plan, read_folder
from seqopt.work.progress import Tell


@door
def export(
    folder: Annotated[BuiltFrom, ("value", "PLAN_DIR|SCENE")],
    *,
    cache: Path | str | None = None,
    progress: Tell = shown,
    format: Annotated[str, ("choices", writable)] = "tasks",  # noqa: A002  # the option's name
    source: Path | str | None = None,
    distance: Annotated[float | None, ("value", "M")] = None,
    out: File | None = None,
) -> Answer[str]:
    """Write the plan of a folder, as seqopt optimize --out makes it, in a format of others.

    It says what each robot does and where, or is the assembly with its plan.

    Parameters
    ----------
    folder : pathlib.Path, ShownBuild, Scene or str
        Folder of a plan; of a scene, in its place, the usual steps are taken.
    cache, progress : optional
        As of `optimize`.
    format : str, optional
        What to write (default: {default}): {choices}.
    source : pathlib.Path or str, optional
        With compas_assembly: the assembly that was imported, to write the plan into.
    distance : float, optional
        With tasks or tasks_csv: from a grip to where the tool comes from and goes to, m (default:
        the longest side of each block).
    out : pathlib.Path or str, optional
        File to write (default: standard output).

    Returns
    -------
    str
        The text of the file.

    Examples
    --------
    $ seqopt export best --format tasks --distance 0.15 --out tasks.json
    """
    place, taken = inputs.plan_folder(folder, cache, progress)
    read = [place / name for name in ("scene.json", "plan.csv")]
    path, given = (None if each is None else Path(each) for each in (out, source))
    require_apart([*filter(None, [path])], [*read, *filter(None, [given])])
    scene, steps = read_folder(place)
    notes: tuple[str, ...] = ()
    form = formats()[format]
    if "distance" in form.takes and scene.has_arms:
        if trouble := inputs.posture_trouble(scene, cache, progress):
            notes = (f"arms: grips are proposals without postures; {trouble}",)
        else:
            notes = tuple(f"arms cannot: {fault}" for fault in arm_faults(scene, steps))
    text = export_plan(scene, steps, format, given, distance)
    said, lost = f"{len(steps)} steps", form.lost
    if lost:
        plan = "" if "steps" in lost else f" and {said}"
        said = f"{len(scene.bricks)} blocks{plan}, without {', '.join(lost)},"
    facts = {"steps": len(steps), "format": format}
    notes = (*taken, *notes)
    answer = Answer(facts, notes=notes, value=text, scene=scene)
    if path is None:
        return replace(answer, facts=facts | {"text": text}, data=text)
    write_text(path, text)
    return replace(answer, text=f"{said} written to {path}", written=(path,))
