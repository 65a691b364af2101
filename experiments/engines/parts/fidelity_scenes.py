"""Planar scenes: arches in one plane, and a scene pressed flat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from seqopt.arrays import Vector
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import Brick, Ground, Joint
from seqopt.scene.scene import Scene

S = TypeVar("S", Joint, Ground)
SPAN = 6.0  # m along the line of a flat arch


def flat_arch(count: int) -> Scene:
    """Return a closed arch of bricks that all lie along it, in one plane."""
    pitch = np.linspace(1.3, -1.3, count)
    size = (SPAN / count, 0.116, 0.053)
    return arch_scene(ArchShape(pitch=pitch, pattern="V", dimensions=size, gap=0.0))


def flattened(scene: Scene) -> Scene:
    """Return a scene pressed into the plane y = 0; bricks laid across it keep their size along it.

    Nodes keep their numbers and all lie in the plane.
    """
    return replace(
        scene,
        name=f"{scene.name} flattened",
        bricks=tuple(_brick(brick) for brick in scene.bricks),
        joints=tuple(_spring(joint) for joint in scene.joints),
        grounds=tuple(replace(_spring(end), anchor=_pressed(end.anchor)) for end in scene.grounds),
    )


def _pressed(point: Sequence[float]) -> Vector:
    return point[0], 0.0, point[2]


def _unit(axis: Sequence[float]) -> Vector:
    size = float(np.hypot(axis[0], axis[2]))
    return axis[0] / size, 0.0, axis[2] / size


def _brick(brick: Brick) -> Brick:
    length, width, height = brick.dimensions
    across = abs(brick.length_axis[1]) > abs(brick.width_axis[1])
    return replace(
        brick,
        position=_pressed(brick.position),
        length_axis=_unit(brick.width_axis if across else brick.length_axis),
        width_axis=(0.0, 1.0, 0.0),
        dimensions=(width, length, height) if across else brick.dimensions,
    )


def _spring(spring: S) -> S:
    position, along = _pressed(spring.position), _unit(spring.along)
    return replace(spring, position=position, along=along, across=(0.0, 1.0, 0.0))
