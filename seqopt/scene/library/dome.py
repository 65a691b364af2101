"""Domes of any size, in running bond."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene._checks import check, whole_between
from seqopt.scene.boxes import as_vector, require_apart
from seqopt.scene.library.common import (
    DOWN,
    MASONRY,
    JointLaw,
    Shape,
    _few_enough,
    _masonry,
    _shares,
    _touching_order,
)
from seqopt.scene.parts import Brick
from seqopt.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class DomeShape(Shape):
    """The numbers that shape a dome, a cap of a sphere with an opening; lengths in m.

    ``courses``: rows from the ground to the opening, equally high. ``around``: bricks in the lowest
    course; courses have fewer the higher they are.
    ``span``, ``rise``: diameter at the ground and height over it, of the surface through the
    bricks' middles, before the opening is cut. ``opening``: diameter of the opening. ``thickness``:
    of the bricks, at right angles to the surface. ``gap``: least width of the joints, on the
    inside; boxes on a sphere leave more elsewhere. ``density``: kg/m³. ``law``: how stiff joints
    are.

    Examples
    --------
    >>> DomeShape(courses=8, around=24).rise
    1.0
    """

    kind = "dome"
    courses: int
    around: int
    span: float = 2.0
    rise: float = 1.0
    opening: float = 0.5
    thickness: float = 0.08
    gap: float = 0.005
    density: float = 2000.0
    law: JointLaw = MASONRY

    def __post_init__(self) -> None:
        super().__post_init__()
        check(self, "dome", courses=partial(whole_between, least=1))
        _few_enough("dome", self.courses * self.around)
        if self.rise > 0.5 * self.span:
            raise SceneError(
                f"dome: rise is {self.rise:g} m; give at most half of the span, {0.5 * self.span:g}"
            )
        if self.opening >= self.span:
            raise SceneError(
                f"dome: opening is {self.opening:g} m; give less than the span, {self.span:g}"
            )

    @property
    def radius(self) -> float:
        """Radius of the sphere, m."""
        return (0.25 * self.span**2 + self.rise**2) / (2 * self.rise)

    def latitude(self, row: float) -> float:
        """Return the angle above the horizontal at which a row begins, from the center, rad."""
        first, last = (math.acos(0.5 * d / self.radius) for d in (self.span, self.opening))
        return first + (last - first) * row / self.courses


_LEAST_SHARE = 0.1  # of the smaller face: bricks that share less have no joint
_NO_SHARE = 1e-6  # of an angle: places that share less only meet at a corner
_TURN = 2 * math.pi


class _Place(NamedTuple):
    """The place of a brick: from one row to another, and how far around on either side."""

    low: int  # rows
    high: int  # rows
    azimuth: float  # rad
    half: float  # rad


def dome(shape: DomeShape) -> Scene:
    """Return the scene of a dome that is built from the ground up, course by course.

    Its axis is z, and the surface through the middles of its bricks starts at z = 0. Bricks are
    boxes cut to the room that their place in the dome leaves: shorter the higher they are, unless a
    course has fewer of them.

    Three robots reach everything. Raises `SceneError` if a place leaves no room for a brick, or
    bricks interpenetrate.

    Examples
    --------
    >>> dome(DomeShape(courses=4, around=12))
    <Scene dome 39: 39 bricks, 82 joints, 12 ground ends, 3 robots>
    """
    places = list[_Place]()
    for row in range(shape.courses):  # bricks as long as the lowest ones, half a brick shifted
        size = math.cos(shape.latitude(row)) / math.cos(shape.latitude(0))
        count = max(3, round(shape.around * size))
        half = 0.5 * _TURN / count
        shift = half * (row % 2)
        places += [_Place(row, row + 1, 2 * half * i + shift, half) for i in range(count)]
    loose = [_brick(shape, place, i) for i, place in enumerate(places)]
    pairs, normals = _beside(shape, places)
    kept = np.flatnonzero(_shares(loose, pairs, normals) >= _LEAST_SHARE)
    pairs, normals = [pairs[k] for k in kept], normals[kept]
    grounded = [i for i, place in enumerate(places) if not place.low]
    order = _touching_order(range(len(places)), pairs, grounded)
    if len(order) < len(places):
        raise SceneError(
            f"dome: {len(places) - len(order)} of {len(places)} bricks lie on no other; "
            "give more around or more courses"
        )
    rank = {old: new for new, old in enumerate(order)}
    ends = [(min(rank[a], rank[b]), max(rank[a], rank[b])) for a, b in pairs]
    turn = sorted(range(len(ends)), key=lambda k: ends[k][::-1])
    places, ends = [places[old] for old in order], [ends[k] for k in turn]
    bricks = [_brick(shape, place, b) for b, place in enumerate(places, start=1)]
    require_apart("dome", bricks, "give more around, a wider gap or thinner bricks")
    feet = [(brick, DOWN) for brick, p in zip(bricks, places, strict=True) if not p.low]
    name = f"dome {len(bricks)}"
    return _masonry(name, ".dome.", bricks, ends, shape.law, feet, normals[turn])


def _beside(shape: DomeShape, places: Sequence[_Place]) -> tuple[list[tuple[int, int]], Floats]:
    """Return which places share an edge, and directions across these, (P, 3)."""
    low, high, azimuth, half = np.array(places).T
    away = np.abs((azimuth[:, None] - azimuth + 0.5 * _TURN) % _TURN - 0.5 * _TURN)
    shared = half[:, None] + half - away
    above = (high[:, None] == low) & (shared > _NO_SHARE * half)
    level = (low[:, None] < high) & (low < high[:, None])
    beside = level & (np.abs(shared) <= _NO_SHARE * half)
    a, b = np.nonzero(np.triu(above | above.T | beside, 1))
    middle = [_directions(shape.latitude(0.5 * (p.low + p.high)), p.azimuth) for p in places]
    axes = np.array(middle)[:, :2]
    which = np.where(beside[a, b], 0, 1)
    return list(zip(a.tolist(), b.tolist(), strict=True)), axes[a, which] + axes[b, which]


def _brick(shape: DomeShape, place: _Place, name: int) -> Brick:
    """Return the largest box in its place, as far as joints leave room.

    Its faces keep off the planes through the axis and the cones from the center that bound the
    place; the lower one would else dip below its cone at the ends.
    """
    low, high = (shape.latitude(row) for row in (place.low, place.high))
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    inner = shape.radius - 0.5 * shape.thickness
    room = inner * math.tan(half) - 0.5 * shape.gap
    dip = shape.radius * 0.5 * place.half**2 * math.sin(low) * math.cos(low) if place.low else 0.0
    start, end = dip - room if place.low else -inner * math.tan(half), room
    nearest = inner * math.cos(middle) - end * math.sin(middle)
    wide = 2 * nearest * math.tan(place.half) - shape.gap / math.cos(place.half)
    tall = end - start
    if min(wide, tall) <= shape.gap:
        raise SceneError(
            f"dome: a brick in course {place.low + 1} would be {1e3 * wide:.3g} mm long and "
            f"{1e3 * tall:.3g} mm high; give fewer around, fewer courses or a larger opening"
        )
    around, up, out = _directions(middle, place.azimuth)
    center = np.array([0.0, 0.0, shape.rise - shape.radius])  # of the sphere
    flat = wide >= tall
    return Brick(
        name=name,
        position=as_vector(center + shape.radius * out + 0.5 * (start + end) * up),
        length_axis=as_vector(around if flat else up),
        width_axis=as_vector(up if flat else around),
        dimensions=(max(wide, tall), min(wide, tall), shape.thickness),
        density=shape.density,
        nodes=(2 * name - 2, 2 * name - 1),
        placing_node=2 * name - 1,
    )


def _directions(latitude: float, azimuth: float) -> tuple[Floats, Floats, Floats]:
    """Return the unit vectors around the axis, up along the surface, and outward."""
    c, s = math.cos(azimuth), math.sin(azimuth)
    across, rises = math.cos(latitude), math.sin(latitude)
    return (
        np.array([-s, c, 0.0]),
        np.array([-rises * c, -rises * s, across]),
        np.array([across * c, across * s, rises]),
    )
