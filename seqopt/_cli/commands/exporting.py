"""The command ``export``: a plan in a format of others."""

from __future__ import annotations

from dataclasses import field, replace
from pathlib import Path

from seqopt._cli import inputs, options
from seqopt._cli.answer import Answer
from seqopt._files import require_apart, write_text
from seqopt.arms._kept import arm_faults
from seqopt.exchange._formats import formats, writable
from seqopt.exchange.exports import export_plan, read_folder


class Export(options.Postures, options.Written):
    """Which plan, and in which format?

    folder : PLAN_DIR|SCENE
        folder of a plan; of a scene, in its place, the usual steps are taken
    format : NAME
        what to write (default: {default}): {choices}
    source : FILE
        with compas_assembly: the assembly that was imported, to write the plan into
    distance : M
        with tasks or tasks_csv: from a grip to where the tool comes from and goes to, m (default:
        the longest side of each block)

    What is written and printed?
    out : FILE
        file to write (default: standard output)
    """

    folder: options.BuiltFrom = field(kw_only=False, metadata={"place": True})
    format: str = field(default="csv", kw_only=False, metadata={"choices": writable})
    source: options.File | None = None
    distance: float | None = None


def run(asked: Export) -> Answer:
    """Write the plan of a folder, as seqopt optimize --out makes it, in a format of others.

    It says which block is absent, placed or held in which step, what each robot does and where, or
    is the assembly with its plan.

    Examples
    --------
    seqopt export best --format csv --out blocks.csv
    seqopt export best --format tasks --distance 0.15 --out tasks.json
    """
    folder, taken = inputs.plan_folder(asked, asked.folder)
    read = [folder / name for name in ("scene.json", "plan.csv")]
    source = None if asked.source is None else Path(asked.source)
    require_apart([*filter(None, [asked.path])], [*read, *filter(None, [source])])
    scene, steps = read_folder(folder)
    notes: tuple[str, ...] = ()
    form = formats()[asked.format]
    if "distance" in form.takes and scene.has_arms:
        if trouble := inputs.posture_trouble(asked, scene):
            notes = (f"arms: grips are proposals without postures; {trouble}",)
        else:
            notes = tuple(f"arms cannot: {fault}" for fault in arm_faults(scene, steps))
    text = export_plan(scene, steps, asked.format, source, asked.distance)
    said, lost = f"{len(steps)} steps", form.lost
    if lost:
        plan = "" if "steps" in lost else f" and {said}"
        said = f"{len(scene.bricks)} blocks{plan}, without {', '.join(lost)},"
    facts = {"steps": len(steps), "format": asked.format}
    notes = (*taken, *notes)
    answer = Answer(facts, notes=notes, value=text, scene=scene)
    if asked.path is None:
        return replace(answer, facts=facts | {"text": text}, data=text)
    write_text(asked.path, text)
    return replace(answer, text=f"{said} written to {asked.path}", written=(asked.path,))
