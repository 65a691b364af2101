"""Loads that a robot carries alone: the brick that it places or removes.

Joints and other grips share the weight of a placed brick. During transport the robot carries all
of it, and its tool.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import holds
from seqopt.sequence.steps import AnyStep, StepKind

_ROUNDING = 1e-9  # over a payload, by which a load may exceed it


class Carried(NamedTuple):
    """A brick that a robot places or removes."""

    step: int  # its number
    robot: int  # index among the scene's robots
    brick: int  # its name


def carried(scene: Scene, steps: Sequence[AnyStep]) -> Iterator[Carried]:
    """Yield robot and brick of every transport in steps, whose grips may be open.

    The robot that removes a brick held it before: unknown if the first step removes one.
    """
    removals = {step.number - 1: step for step in steps if step.kind is StepKind.REMOVE}
    for hold in holds(scene, steps):
        if hold.places is not None:
            yield Carried(hold.first, hold.robot, hold.places)
        if (step := removals.get(hold.last)) is not None:  # in which nobody else lets go
            yield Carried(step.number, hold.robot, scene.placed[step.bricks].name)


def loads(scene: Scene, robot: Robot) -> Floats:
    """Return the load of a robot with every brick in build order, its tool included, (B,), N."""
    tool = 0.0 if robot.arm is None else robot.arm.tool_mass
    gravity = scene.weight_factor * float(np.linalg.norm(scene.gravity))
    return gravity * (np.array([brick.mass for brick in scene.placed]) + tool)


def can_carry(scenes: Sequence[Scene], robot: int) -> Bools:
    """Return whether a robot can carry each brick in build order in all scenes, (B,)."""
    pairs = [(scene, scene.robots[robot]) for scene in scenes]
    within = [loads(scene, own) <= own.payload * (1 + _ROUNDING) for scene, own in pairs]
    return np.asarray(np.all(within, axis=0))
