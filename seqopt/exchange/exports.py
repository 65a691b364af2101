"""Plans in formats of others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from seqopt.errors import StepError
from seqopt.exchange._formats import formats, writable
from seqopt.questions import Built, Steps, find_steps
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.work import Tell


def export(  # every question is a word of its own
    scene: Built,
    steps: Steps | None = None,
    format: Annotated[str, ("choices", writable)] = "tasks",  # noqa: A002  # the option's name
    source: Path | str | None = None,
    distance: Annotated[float | None, ("value", "M")] = None,
    *,
    robots: int | Sequence[str] | None = None,
    cache: Path | str | None = None,
    progress: Tell | None = None,
) -> str:
    """Return a plan in a format of others: what each robot does and where, or an assembly.

    Parameters
    ----------
    scene, steps : optional
        As of `seqopt.questions.find_build`. Arms are in their postures where these can be computed;
        other grips are proposals.
    format : str, optional
        What to write (default: tasks).
    source : str or pathlib.Path, optional
        With compas_assembly: the assembly that was imported, to write the plan into.
    distance : float, optional
        With tasks or tasks_csv: from a grip to where the tool comes from and goes to, m (default:
        the longest side of each block).
    robots, cache, progress : optional
        As of `optimize`.

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
    >>> export("arch25", "sequential")[:39]
    '{"format": "seqopt-tasks", "version": 1'
    """
    known = formats()
    write = known[format].write if format in known else None
    if write is None:
        raise StepError(f"format is {short(format)}; give one of {', '.join(writable())}")
    pairs = {"source": source, "distance": distance}.items()
    given = {name: value for name, value in pairs if value is not None}
    for name in given:
        if name not in known[format].takes:
            others = ", ".join(each.name for each in known.values() if name in each.takes)
            raise StepError(f"format {format} takes no {name}; leave it out, or write {others}")
    if not isinstance(scene, Scene) or isinstance(steps, Path | str | None):
        found = find_steps(scene, steps, robots=robots, cache=cache, progress=progress)
        scene, steps = found.network.scene, found.steps
    text: object = write(scene, steps, **given)
    if not isinstance(text, str):
        raise StepError(f"format {format}: it writes {short(text)}; return a text")
    return text
