"""Whether what a problem is posed from is what it should be."""

from __future__ import annotations

from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError
from seqopt.network.network import Network
from seqopt.problem.requirements import Criterion
from seqopt.scene.checks import short
from seqopt.sequence.schedule import Schedule


def robots_of(engine: Engine, schedule: Schedule, criterion: Criterion) -> list[str]:
    """Return the names of a schedule's robots if all is what it should be, and grips are open.

    Raises `ProblemError` if one is something else, or no grip is open.
    """
    _require_kinds(engine, schedule, criterion)
    if not schedule.moves:
        raise ProblemError(
            f"schedule {schedule.method}: with {len(schedule.scene.bricks)} bricks it leaves no "
            "grip open; there is nothing to choose, analyze its steps"
        )
    return [robot.name for robot in schedule.scene.robots]


def _require_kinds(engine: Engine, schedule: Schedule, criterion: Criterion) -> None:
    """Say what is wanted where something else is given."""
    wanted = (
        (engine, isinstance(getattr(engine, "network", None), Network), "engine", "make_engine"),
        (schedule, isinstance(schedule, Schedule), "schedule", "three_robot_loop"),
        (criterion, hasattr(criterion, "for_scene"), "criterion", "CRITERIA"),
    )
    for given, right, what, source in wanted:
        if not right:
            raise ProblemError(f"{short(given)} is no {what}; take one of seqopt.{source}")
