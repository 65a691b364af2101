"""How long a build takes whose steps are given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from seqopt.contact.mortar import Mortar
from seqopt.engines.registry import USUAL, make_engine
from seqopt.errors import ProblemError, StepError
from seqopt.plan.build import GivenSequence
from seqopt.questions import Built, Steps, find_build
from seqopt.stability.standing import Standing
from seqopt.times._step_check import check_cured
from seqopt.work import Tell

USUAL_SECONDS = "fetch=30,place=10,approach=10,grip=5,release=5"


def times(
    scene: Built,
    steps: Steps | None = None,
    *,
    stands: Standing | Mortar | str | None = None,
    reassign: bool = False,
    robots: int | Sequence[str] | None = None,
    cache: Path | str | None = None,
    progress: Tell | None = None,
) -> GivenSequence:
    """Say how long a build takes and who does what when.

    Parameters
    ----------
    scene, steps : optional
        As of `seqopt.questions.find_build`.
    stands : optional
        As of `optimize`; here with curing.
    reassign : bool, optional
        Give the same grips, in the same order, to the robots with which the build ends first,
        within their reach and payload.
    robots, cache, progress : optional
        As of `optimize`.

    Returns
    -------
    GivenSequence
        The build: its ``times()`` are the timetable, its ``makespan`` is in s.

    Raises
    ------
    SeqoptError
        If it is not known how long robots take, or a state does not stand when it begins.

    Examples
    --------
    >>> import seqopt
    >>> words = "fetch=30,place=10,approach=10,grip=5,release=5"
    >>> times(seqopt.load_scene("arch25").with_durations(words), "cantilever").makespan
    1090.0
    """
    build = find_build(scene, steps, robots=robots, cache=cache, progress=progress)
    standing = stands if isinstance(stands, Standing) else None
    if stands is not None and (standing is None or standing.curing is None):
        text = "here it goes with curing of mortar that has a bond; seqopt assess says what stands"
        raise ProblemError(f"stands: {text}")
    own = build.reassigned() if reassign else build.steps
    out = GivenSequence(build.engine, own, build.title, standing=standing, result=build.result)
    try:
        starts = out.times()["start_s"].tolist()
    except StepError as error:
        if standing is None and "durations" not in str(error):
            raise
        where = "durations" if "durations" in str(error) else "curing"
        raise ProblemError(f"{where}: {error}") from None
    if standing is not None:
        check_cured(build.engine.network, own, standing, starts)
    return out


def with_usual_durations(build: GivenSequence) -> GivenSequence:
    """Return a build whose robots take `USUAL_SECONDS`, if it is not known how long they take."""
    scene = build.engine.network.scene
    if all(robot.durations for robot in scene.robots):
        return build
    engine = make_engine(USUAL, scene.with_durations(USUAL_SECONDS))
    return GivenSequence(engine, build.steps, build.title)
