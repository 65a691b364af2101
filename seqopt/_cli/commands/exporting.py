"""The command ``export``: a plan in a format of others."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from seqopt._cli.answer import Answer
from seqopt._cli.asked import posture_trouble, scene_facts
from seqopt._cli.options import POSTURES, WRITTEN, declare, form_options
from seqopt._cli.screens import question
from seqopt._cli.words.given import plan_folder
from seqopt._files import require_apart, write_text
from seqopt.arms._plan_postures import arm_faults
from seqopt.exchange._tasks import Postures
from seqopt.exchange.exports import EXPORTS, LOST, TASKS, export_plan, read_folder
from seqopt.problem._limit_words import number_word
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

DESCRIPTION = (
    "Write the plan of a folder, as seqopt optimize --out makes it, in a format of others: which "
    "block is absent, placed or held in which step, what each robot does and where, or the scene "
    "with its plan."
)
EXAMPLES = (
    "seqopt export best --format csv --out blocks.csv",
    "seqopt export best --format tasks --distance 0.15 --out tasks.json",
)


DISTANCE = {
    "--distance M": "with tasks, tasks_csv or compas_fab: from a grip to where the tool comes "
    "from and goes to, m (default: the longest side of each block)"
}
SOURCE = {
    "--source FILE": "with a format of COMPAS: the file that was imported, to name its elements or "
    "to write the plan into"
}


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``export``."""
    basic = question(command, "Which plan, and in which format?")
    about = "folder of a plan; of a scene, in its place, the usual steps are taken"
    declare(basic, {"folder PLAN_DIR|SCENE": about})
    said = f"what to write: {', '.join(EXPORTS)} (default: %(default)s)"
    basic.add_argument("--format", choices=EXPORTS, default="csv", metavar="NAME", help=said)
    declare(basic, SOURCE)
    declare(basic, DISTANCE | POSTURES)
    about = "file to write (default: standard output)"
    declare(question(command, WRITTEN), {"--out FILE": about})
    form_options(command)


def run(options: argparse.Namespace) -> Answer:
    """Write the plan of a folder in a format of others."""
    folder = plan_folder(options, options.folder)
    inputs = [folder / name for name in ("scene.json", "plan.csv")]
    outputs = [*filter(None, [options.out])]
    require_apart(outputs, [*inputs, *filter(None, [options.source])])
    scene, steps = read_folder(folder)
    given = options.distance
    distance = None if given is None else number_word(given, f"--distance {given}")
    notes, postures = _arms(options, scene, steps)
    text = export_plan(scene, steps, options.format, options.source, distance, postures)
    said, lost = f"{len(steps)} steps", LOST.get(options.format)
    if lost:
        said = f"{len(scene.bricks)} blocks, without {', '.join(lost)},"
    elif lost is not None:
        said = f"the scene and its {len(steps)} steps"
    facts = {"scene": scene_facts(scene), "steps": len(steps), "format": options.format}
    if options.out is None:
        return Answer(facts=facts | {"text": text}, data=text, notes=notes)
    write_text(options.out, text)
    said = f"{said} written to {options.out}"
    return Answer(facts=facts, text=said, written=(options.out,), notes=notes)


def _arms(
    options: argparse.Namespace, scene: Scene, steps: Sequence[Step]
) -> tuple[tuple[str, ...], Postures | None]:
    """Return what there is to say of arms in a plan, and postures: none where they are not known.

    Other formats than those of tasks have none.
    """
    if options.format not in TASKS or not scene.has_arms:
        return (), None
    if trouble := posture_trouble(options, scene):
        return (f"arms: grips are proposals without postures; {trouble}",), {}
    return tuple(f"arms cannot: {fault}" for fault in arm_faults(scene, steps)), None
