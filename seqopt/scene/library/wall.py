"""Walls in running bond: upright, or corbelled, each course beyond the one below."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from seqopt.arrays import Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import check, whole_between
from seqopt.scene.library.common import (
    DOWN,
    MASONRY,
    JointLaw,
    Shape,
    _bond_pairs,
    _few_enough,
    _masonry,
    _running_bond,
)
from seqopt.scene.scene import Scene

WHOLE = 1e-3  # of a brick: lengths in mm come to whole bricks


@dataclass(frozen=True, kw_only=True)
class WallShape(Shape):
    """The numbers that shape a wall.

    ``columns``: bricks in a course. ``courses``: every second one is shifted by half a brick.
    ``length``, ``height``: in place of these, how long a course is, and how high all are, m.
    ``dimensions``: length, width and height of a brick, m. ``gap``: width of the joints, m; 0 where
    bricks are laid dry. ``corbel``: how far each course projects beyond the one below it, across
    the wall, m. ``density``: kg/m³. ``law``: how stiff joints are.

    Examples
    --------
    >>> WallShape(columns=4, courses=3).dimensions
    (0.2, 0.1, 0.06)
    """

    kind = "wall"
    columns: int = 0
    courses: int = 0
    length: float | None = None
    height: float | None = None
    dimensions: Vector = (0.2, 0.1, 0.06)
    gap: float = 0.0
    corbel: float = 0.0
    density: float = 2000.0
    law: JointLaw = MASONRY

    def __post_init__(self) -> None:
        super().__post_init__()
        self._count("columns", "length", self.dimensions[0])
        self._count("courses", "height", self.dimensions[2])
        whole = partial(whole_between, least=1)
        check(self, "wall", columns=whole, courses=whole)
        _few_enough("wall", self.columns * self.courses)
        if self.gap >= 0.5 * self.dimensions[0]:
            raise SceneError(
                f"wall: gap is {self.gap:g} m, half a brick or more; give less than "
                f"{0.5 * self.dimensions[0]:g}"
            )
        if abs(self.corbel) >= self.dimensions[1]:
            raise SceneError(
                f"wall: corbel is {self.corbel:g} m, a brick's width or more, and courses would "
                f"not lie on each other; give less than {self.dimensions[1]:g}"
            )

    def _count(self, name: str, extent: str, each: float) -> None:
        """Set the number of bricks where their total length or height is given."""
        value = getattr(self, extent)
        if value is None and not getattr(self, name):
            raise SceneError(
                f"wall: {name} is 0 or missing; give a whole number, or {extent} in m in its place"
            )
        if value is None:
            return
        if getattr(self, name):
            raise SceneError(f"wall: {name} and {extent} are both given; give one")
        count = (value + self.gap) / (each + self.gap)
        if abs(count - round(count)) > WHOLE or round(count) < 1:
            near = sorted({max(1, math.floor(count)), math.floor(count) + 1})
            fits = [f"{n * (each + self.gap) - self.gap:.6g} ({n} {name})" for n in near]
            raise SceneError(
                f"wall: {extent} is {value:g} m, no whole number of bricks; give "
                f"{' or '.join(fits)}"
            )
        object.__setattr__(self, name, round(count))


def wall(shape: WallShape) -> Scene:
    """Return the scene of a wall that is built course by course, from left to right.

    It runs towards +x from y = 0 and stands on z = 0. A brick has joints with those beside
    it and those that it lies on: nearly every one closes a loop.

    Three robots reach everything. Raises `SceneError` if the numbers make no scene.

    Examples
    --------
    >>> wall(WallShape(columns=4, courses=3))
    <Scene wall 4 x 3: 12 bricks, 23 joints, 4 ground ends, 3 robots>
    """
    heights = (shape.dimensions[2] + shape.gap) * np.arange(shape.courses)
    starts = (
        np.array([0.0, shape.corbel * course, height + 0.5 * shape.dimensions[2]])
        for course, height in enumerate(heights.tolist())
    )
    courses = ((start, np.eye(3)[0], np.eye(3)[1]) for start in starts)
    bricks = _running_bond(courses, shape.columns, shape.dimensions, shape.gap, shape.density)
    name = f"wall {shape.columns} x {shape.courses}"
    feet = [(brick, DOWN) for brick in bricks[: shape.columns]]
    pairs = _bond_pairs(shape.columns, len(bricks))
    return _masonry(name, ".wall.", bricks, pairs, shape.law, feet)
