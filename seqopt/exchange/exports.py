"""Plans in formats of others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from seqopt.errors import StepError
from seqopt.exchange._formats import formats, writable
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step


def export_plan(
    scene: Scene,
    steps: Sequence[Step],
    form: str,
    source: str | Path | None = None,
    distance: float | None = None,
) -> str:
    """Return a plan for a scene in the format of another program.

    Parameters
    ----------
    scene, steps
        A scene, and a checked plan for it.
    form
        The name of a format that can be written.
    source
        The assembly that was imported, for ``compas_assembly``: the plan is added to it.
    distance
        For formats of tasks, see `plan_tasks`. Arms are in their postures where these can be
        computed; other grips are proposals.

    Returns
    -------
    str
        The text of the file.

    Raises
    ------
    StepError
        If the format is not known or does not take what is given.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> steps = seqopt.sequential(seqopt.build_network(scene))
    >>> export_plan(scene, steps[:2], "tasks")[:39]
    '{"format": "seqopt-tasks", "version": 1'
    """
    known = formats()
    write = known[form].write if form in known else None
    if write is None:
        raise StepError(f"format is {short(form)}; give one of {', '.join(writable())}")
    pairs = {"source": source, "distance": distance}.items()
    given = {name: value for name, value in pairs if value is not None}
    for name in given:
        if name not in known[form].takes:
            others = ", ".join(each.name for each in known.values() if name in each.takes)
            raise StepError(f"format {form} takes no {name}; leave it out, or write {others}")
    text: object = write(scene, steps, **given)
    if not isinstance(text, str):
        raise StepError(f"format {form}: it writes {short(text)}; return a text")
    return text
