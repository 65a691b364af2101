"""Running bond: walls, upright or corbelled, and barrel vaults.

Courses lie on each other, every second one shifted by half a brick. A brick has joints with those
beside it and those that it lies on, each where the faces that look at each other overlap.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from seqopt.arrays import Floats, Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import as_vector, check, density, finite, sizes, units, whole_between
from seqopt.scene.boxes import _spring_fields, require_apart
from seqopt.scene.library.arch_form import ArchForm, _first_that_fits, _laid
from seqopt.scene.library.common import (
    DOWN,
    MASONRY,
    JointLaw,
    _few_enough,
    _joint_width,
    _mobile_robots,
    a_law,
)
from seqopt.scene.parts import THICKEST, Brick, Ground, Joint
from seqopt.scene.scene import Scene

_SLIVER = 1e-9  # overlap treated as none, over the smaller dimension of a brick
_STUB = 0.05  # m; of a ground end
_HEAD = 0  # axis of a brick across the joint beside it: its length


@dataclass(frozen=True, kw_only=True)
class WallShape:
    """The numbers that shape a wall.

    ``columns``: bricks in a course. ``courses``: every second one is shifted by half a brick.
    ``dimensions``: length, width and height of a brick, m. ``gap``: width of the joints, m; 0 where
    bricks are laid dry. ``corbel``: how far each course projects beyond the one below it, across
    the wall, m. ``density``: kg/m³. ``law``: how stiff joints are.

    Examples
    --------
    >>> WallShape(columns=4, courses=3).dimensions
    (0.2, 0.1, 0.06)
    """

    columns: int
    courses: int
    dimensions: Vector = (0.2, 0.1, 0.06)
    gap: float = 0.0
    corbel: float = 0.0
    density: float = 2000.0
    law: JointLaw = MASONRY

    def __post_init__(self) -> None:
        count = partial(whole_between, least=1)
        check(self, "wall", columns=count, courses=count, dimensions=sizes, gap=_joint_width)
        check(self, "wall", corbel=finite, density=density, law=a_law)
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
    high, (along, across, _) = shape.dimensions[2], np.eye(3)
    starts = (
        np.array([0.0, shape.corbel * course, (high + shape.gap) * course + 0.5 * high])
        for course in range(shape.courses)
    )
    courses = ((start, along, across) for start in starts)
    bricks = _bricks(courses, shape.columns, shape.dimensions, shape.gap, shape.density)
    feet = [_foot(brick, 2, DOWN, shape.law) for brick in bricks[: shape.columns]]
    name = f"wall {shape.columns} x {shape.courses}"
    return _bonded(name, bricks, shape.columns, 2, shape.law, feet)


def _vault(
    span: float,
    rise: float,
    columns: int,
    curve: str = "circular",
    courses: int | None = None,
    dimensions: Vector = (0.2, 0.1, 0.06),
    gap: float = 0.01,
    density: float = 2000.0,
) -> Scene:
    """Return the scene of a barrel vault that is built course by course from one springing.

    It spans along x from z = 0, and courses run along y. ``columns``: bricks in a course;
    ``courses``: by default as fit the curve; ``dimensions``: length along the vault, width along
    the curve and thickness of a brick; others as of an `ArchForm`. Raises `SceneError` if courses
    do not fill the curve, or bricks interpenetrate.
    """
    columns = whole_between("vault: columns", columns, 1)
    if courses is not None:
        courses = whole_between("vault: courses", courses, 2)
    _few_enough("vault", columns * (courses or 1))
    long, width, thickness = sizes("vault: dimensions", dimensions)
    shape = (width, long, thickness)  # a brick of the arch is as long as a course is wide
    form = ArchForm(
        span=span,
        rise=rise,
        curve=curve,
        bricks=courses,
        dimensions=shape,
        gap=gap,
        density=density,
    )

    def laid(count: int) -> Scene:
        _few_enough("vault", columns * count)
        _, flat = _laid(form, count)
        ends = np.insert(flat, 1, 0.0, axis=1)  # in space
        tangents = units(np.diff(ends, axis=0))
        middles = zip(0.5 * (ends[:-1] + ends[1:]), tangents, strict=True)
        starts = ((middle, np.eye(3)[1], tangent) for middle, tangent in middles)
        bricks = _bricks(starts, columns, (long, width, thickness), form.gap, form.density)
        require_apart("vault", bricks, "give another number of courses, or thinner bricks")
        pairs = zip(bricks[:columns], bricks[-columns:], strict=True)
        down = -tangents[0], tangents[-1]
        feet = [
            _foot(b, 1, way, form.law) for pair in pairs for b, way in zip(pair, down, strict=True)
        ]
        return _bonded(f"vault {columns} x {count}", bricks, columns, 1, form.law, feet)

    return _first_that_fits(form, laid)


def _bricks(
    courses: Iterable[tuple[Floats, Floats, Floats]],
    columns: int,
    dimensions: Vector,
    gap: float,
    density: float,
) -> list[Brick]:
    """Return the bricks course by course.

    ``courses``: where each starts, m, and unit vectors along it and across its bricks.
    """
    out = list[Brick]()
    for course, (start, along, across) in enumerate(courses):
        for column in range(columns):
            node, way = 2 * len(out) + 2, (dimensions[0] + gap) * (column + 0.5 * (course % 2))
            brick = Brick(
                name=len(out) + 1,
                position=as_vector(start + way * along),
                length_axis=as_vector(along),
                width_axis=as_vector(across),
                dimensions=dimensions,
                density=density,
                nodes=(node, node + 1),
                placing_node=node,
            )
            out.append(brick)
    return out


def _bonded(
    name: str,
    bricks: Sequence[Brick],
    columns: int,
    bed: int,
    law: JointLaw,
    feet: Iterable[Ground],
) -> Scene:
    """Return the scene of bricks in running bond; ``bed``: the axis across what they lie on."""
    joints = []
    for i, brick in enumerate(bricks):
        course, column = divmod(i, columns)
        for at in (column, column + 1) if course % 2 else (column - 1, column):
            if course and 0 <= at < columns:
                joints.append(_joint(bricks[i - column - columns + at], brick, bed, law))
        if column:
            joints.append(_joint(bricks[i - 1], brick, _HEAD, law))
    return Scene(
        name=name,
        provenance=f"Generated by {__name__}.",
        bricks=tuple(bricks),
        joints=tuple(joints),
        grounds=tuple(feet),
        build_order=tuple(brick.name for brick in bricks),
        robots=_mobile_robots(bricks),
    )


def _face(brick: Brick, axis: int, step: Floats) -> tuple[Floats, Floats]:
    """Return the middle and the outward normal of the face across an axis that looks that way."""
    out = np.sign(brick.frame[axis] @ step) * brick.frame[axis]
    return brick.position + 0.5 * brick.dimensions[axis] * out, out


def _foot(brick: Brick, axis: int, down: Floats, law: JointLaw) -> Ground:
    """Return the ground end in the middle of the face of a brick that looks down."""
    place, out = _face(brick, axis, down)
    side = (axis + 1) % 3
    stiffness = law.over_rectangle(brick.dimensions[side], brick.dimensions[axis - 1])
    fields = _spring_fields(place, -out, brick.frame[side], stiffness)
    return Ground(brick=brick.name, anchor=as_vector(place + _STUB * out), **fields)


def _joint(first: Brick, second: Brick, axis: int, law: JointLaw) -> Joint:
    """Return the joint in the middle of the overlap of two faces across the same axis of bricks.

    It lies halfway between the faces; its axes are their mean normal and the edge of the first
    brick most nearly across it. Bricks are turned about an edge alone: both faces are seen as
    rectangles along these axes. A joint that is thick at the ends of the overlap says so.
    """
    step = np.subtract(second.position, first.position)
    faces = _face(first, axis, step), _face(second, axis, -step)
    along, side = units(faces[0][1] - faces[1][1]), (axis + 1) % 3
    across = units(first.frame[side] - along * (along @ first.frame[side]))
    sides = np.stack([across, np.cross(along, across)])
    low, high = np.full(2, -np.inf), np.full(2, np.inf)
    for brick, (place, _) in zip((first, second), faces, strict=True):
        half = 0.5 * np.array(brick.dimensions)[:, None] * brick.frame
        extent = np.abs(np.delete(half, axis, axis=0) @ sides.T).sum(axis=0)
        low, high = (
            np.maximum(low, sides @ place - extent),
            np.minimum(high, sides @ place + extent),
        )
    thin, size = min(first.dimensions + second.dimensions), high - low
    if not size.min() > _SLIVER * thin:
        raise SceneError(
            f"joint ({first.name}, {second.name}): the faces of its bricks do not overlap; "
            "move the bricks to each other"
        )
    middle = 0.5 * (low + high) @ sides
    heights = [(place - middle) @ out / (along @ out) for place, out in faces]
    slopes = [sides @ out / (along @ out) for _, out in faces]
    widest = float(heights[1] - heights[0] + np.abs(slopes[1] - slopes[0]) @ (0.5 * size))
    place = middle + 0.5 * (heights[0] + heights[1]) * along
    return Joint(
        bricks=(first.name, second.name),
        thickness=widest if widest > THICKEST * thin else None,
        **_spring_fields(place, along, across, law.over_rectangle(*size.tolist())),
    )
