"""Whether it is known how long the robots of a scene take."""

from __future__ import annotations

from collections.abc import Sequence

from seqopt.errors import StepError
from seqopt.scene.arm import EXAMPLE, Durations
from seqopt.scene.scene import Scene


def require_durations(scene: Scene, robots: Sequence[int] | None = None) -> tuple[Durations, ...]:
    """Return the durations of some robots of a scene, by index, or of all; none is assumed."""
    which = range(len(scene.robots)) if robots is None else robots
    lacking = [scene.robots[r].name for r in which if scene.robots[r].durations is None]
    if lacking:
        raise StepError(
            f"scene {scene.name}: it is not known how long {', '.join(lacking)} "
            f"take{'s' * (len(lacking) == 1)}; give durations, as {EXAMPLE}"
        )
    return tuple(d for r in which if (d := scene.robots[r].durations) is not None)


def has_durations(scene: Scene) -> bool:
    """Return whether it is known how long every robot takes."""
    return bool(scene.robots) and all(robot.durations is not None for robot in scene.robots)


def have_speeds(scene: Scene) -> bool:
    """Return whether ways of some robot take time of their own."""
    return any(robot.durations and robot.durations.speed for robot in scene.robots)
