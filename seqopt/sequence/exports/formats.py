"""Formats in which a plan can be written, and reading the folder of a plan."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from seqopt.errors import FileError, StepError
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.exports._arm_tasks import _known_tasks
from seqopt.sequence.exports._blocks import blocks_obj, boxes_csv
from seqopt.sequence.exports._compas_fab import fab_json
from seqopt.sequence.exports._compas_plans import Source, compas_assembly, read_source, timber_plan
from seqopt.sequence.exports._tables import plan_csv, plan_json, sequencer_json
from seqopt.sequence.exports._tasks import Postures, Task, tasks_csv, tasks_json
from seqopt.sequence.schedule_file import read_plan
from seqopt.sequence.steps import Step

_PLAIN: dict[str, Callable[[Scene, Sequence[Step]], str]] = {
    "csv": plan_csv,
    "json": plan_json,
    "sequencer": sequencer_json,
}
_WITH_SOURCE: dict[str, Callable[[Scene, Sequence[Step], Source | None], str]] = {
    "compas_timber": timber_plan,
    "compas_assembly": compas_assembly,
}
_TASKS: dict[str, Callable[[Scene, Iterable[Task]], str]] = {
    "tasks": tasks_json,
    "tasks_csv": lambda _, tasks: tasks_csv(tasks),
    "compas_fab": fab_json,
}
_BLOCKS: dict[str, Callable[[Scene], str]] = {"boxes": boxes_csv, "obj": blocks_obj}
TASKS = tuple(_TASKS)
"""Formats of what robots do, with postures where they have arms."""
EXPORTS = (*_PLAIN, *_TASKS, *_WITH_SOURCE, *_BLOCKS)
_BOXES = ("nodes", "joints", "ground ends", "robots", "loads", "steps")
LOST: dict[str, tuple[str, ...]] = {
    "compas_assembly": (),
    "boxes": ("shapes other than boxes", *_BOXES),
    "obj": ("densities", "the order", *_BOXES),
}
"""What a scene is without, once it was exported and imported again; other formats are no scenes."""


def export_plan(  # what is written, and what some formats take beside
    scene: Scene,
    steps: Sequence[Step],
    form: str,
    source: str | Path | None = None,
    distance: float | None = None,
    postures: Postures | None = None,
) -> str:
    """Return a plan for a scene in the format of another program, one of `EXPORTS`.

    ``source`` is the file from which the scene was imported, of any format, for formats of COMPAS:
    the plan then names its elements, or is written into it if it is an assembly. ``distance``, m,
    is from a grip to where a tool comes from, and ``postures`` are joint values of arms by robot
    and node, for formats of tasks; see `plan_tasks`. By default they are those of
    `seqopt.arms.find_postures`, where robots of the scene have arms; an empty mapping leaves them
    out. Raises `StepError` if the format is not known or does not take what is given; `ExtraError`
    if postures have to be computed and what computes them (extra ``arms``) is not installed.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> steps = seqopt.sequential(seqopt.build_network(scene))
    >>> export_plan(scene, steps[:2], "sequencer")[:46]
    '{"assembly_sequence": [{"installPartIDs": [1],'
    """
    if form not in EXPORTS:
        raise StepError(f"format is {short(form)}; give one of {', '.join(EXPORTS)}")
    if form not in _TASKS and (distance is not None or postures):
        raise StepError(f"format {form} takes no distance or postures; {', '.join(TASKS)} do")
    if form in _WITH_SOURCE:
        read = None if source is None else read_source(scene, Path(source))
        return _WITH_SOURCE[form](scene, steps, read)
    if source is not None:
        raise StepError(f"format {form} takes no source; leave it out")
    if form in _TASKS:
        return _TASKS[form](scene, _known_tasks(scene, steps, distance, postures))
    return _BLOCKS[form](scene) if form in _BLOCKS else _PLAIN[form](scene, steps)


def read_folder(folder: Path) -> tuple[Scene, tuple[Step, ...]]:
    """Return the scene and the steps of a plan's folder, as ``seqopt optimize`` writes it."""
    picked = (folder / "pick" / "plan.csv").is_file()
    give = folder / "pick" if picked else "a folder of seqopt optimize --out or pareto --pick"
    for name in ("scene.json", "plan.csv"):
        if not (folder / name).is_file():
            raise FileError(f"{folder}: it has no {name}; give {give}")
    scene = load_scene(folder / "scene.json")
    return scene, read_plan(scene, folder / "plan.csv")
