"""What a robot carries by itself: the brick that it places or takes away.

A grip on a brick that stands shares its weight with joints and other grips. On the way there the
robot alone has all of it, and its tool.
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
    """A brick that a robot places, or takes away."""

    step: int  # its number
    robot: int  # index among the scene's robots
    brick: int  # its name


def carried(scene: Scene, steps: Sequence[AnyStep]) -> Iterator[Carried]:
    """Yield who carries which brick in steps, some of whose grips may be open.

    Who takes a brick away held it until then: of a first step that does, that is not known.
    """
    removals = {step.number - 1: step for step in steps if step.kind is StepKind.REMOVE}
    for hold in holds(scene, steps):
        if hold.places is not None:
            yield Carried(hold.first, hold.robot, hold.places)
        if (step := removals.get(hold.last)) is not None:  # in which nobody else lets go
            yield Carried(step.number, hold.robot, scene.placed[step.bricks].name)


def loads(scene: Scene, robot: Robot) -> Floats:
    """Return what a robot carries with every brick in build order, its tool included, (B,), N."""
    tool = 0.0 if robot.arm is None else robot.arm.tool_mass
    gravity = scene.weight_factor * float(np.linalg.norm(scene.gravity))
    return gravity * (np.array([brick.mass for brick in scene.placed]) + tool)


def can_carry(scenes: Sequence[Scene], robot: int) -> Bools:
    """Return which bricks in build order a robot carries within its payload in all scenes, (B,)."""
    pairs = [(scene, scene.robots[robot]) for scene in scenes]
    within = [loads(scene, own) <= own.payload * (1 + _ROUNDING) for scene, own in pairs]
    return np.asarray(np.all(within, axis=0))
