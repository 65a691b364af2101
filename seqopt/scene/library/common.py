"""What generators share: joints where faces meet, checked numbers, robots, orders, herringbone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from heapq import heapify, heappop, heappush

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints, Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import (
    MOST_BRICKS,
    as_float,
    check,
    kind_of,
    positive,
    stiffness,
    units,
    unless_none,
)
from seqopt.scene.arch import STANDARD_GRAVITY
from seqopt.scene.boxes import Boxes, as_vector, boxes, spring_fields
from seqopt.scene.parts import THICKEST, Brick, Ground, Joint, Robot


@dataclass(frozen=True, kw_only=True)
class JointLaw:
    """The stiffness of a joint per area of the face over which its bricks meet.

    ``translational``: along the joint's normal and across it twice, N/m per m²; ``rotational``:
    about the same axes, N m/rad per m². By default what a bed of the translational stiffness over
    the face resists: it grows with the face's second moments of area. Raises `SceneError` if a
    number is not finite or negative.

    Examples
    --------
    >>> law = JointLaw(translational=(1.5e9, 1.5e8, 1.5e8))
    >>> [f"{k:.4g}" for k in law.stiffness(0.02, (2e-5, 7e-5))[0]]
    ['3e+07', '3e+06', '3e+06']
    """

    translational: Vector
    rotational: Vector | None = None

    def __post_init__(self) -> None:
        check(self, "joint law", translational=stiffness, rotational=unless_none(stiffness))

    def stiffness(self, area: float, moments: tuple[float, float]) -> tuple[Vector, Vector]:
        """Return the stiffness of a joint over a face, N/m and N m/rad.

        ``area``: m²; ``moments``: second moments of area about the two axes across the normal, m⁴.
        """
        normal, one, other = self.translational
        first, second = moments
        turning = (one * first + other * second, normal * first, normal * second)
        if self.rotational is not None:
            turn, bend, tilt = self.rotational
            turning = (area * turn, area * bend, area * tilt)
        return (area * normal, area * one, area * other), turning

    def over_rectangle(self, width: float, depth: float) -> tuple[Vector, Vector]:
        """Return the stiffness of a joint over a rectangle; sides in m."""
        area = width * depth
        return self.stiffness(area, (area * depth**2 / 12, area * width**2 / 12))


# of the domes that Bruun et al. built later
MASONRY = JointLaw(translational=(1.5e9, 1.5e8, 1.5e8))
DOWN = np.array([0.0, 0.0, -1.0])
a_law = partial(kind_of, kind=JointLaw)


def mobile_robots(bricks: Sequence[Brick], count: int = 3) -> tuple[Robot, ...]:
    """Return robots that reach everything, each of which can bear all bricks."""
    weight = STANDARD_GRAVITY * math.fsum(brick.mass for brick in bricks)
    return tuple(Robot(name=f"rob{i}", payload=weight) for i in range(1, count + 1))


def touching_order(
    rank: Sequence[float | tuple[float, ...]],
    pairs: Iterable[tuple[int, int]],
    starts: Iterable[int],
) -> list[int]:
    """Return an order in which everything touches what stands before it, or the ground.

    Of what can be placed, the lowest ``rank`` is next; what cannot be reached is left out.
    """
    beside: list[set[int]] = [set() for _ in rank]
    for a, b in pairs:
        beside[a].add(b)
        beside[b].add(a)
    seen, order = {*starts}, list[int]()
    ready = [(rank[i], i) for i in seen]
    heapify(ready)
    while ready:
        i = heappop(ready)[1]
        order.append(i)
        for j in beside[i] - seen:
            seen.add(j)
            heappush(ready, (rank[j], j))
    return order


def few_enough(where: str, bricks: int) -> None:
    """Require a structure of at most `MOST_BRICKS`."""
    if bricks > MOST_BRICKS:
        raise SceneError(f"{where}: {bricks} bricks; give numbers that make at most {MOST_BRICKS}")


def joint_width(where: str, value: float) -> float:
    """Return the width of a joint, which may be none."""
    return 0.0 if as_float(value) == 0 else positive(where, value, "m, or 0")


def _running_bond(
    courses: Iterable[tuple[Floats, Floats, Floats]],
    columns: int,
    dimensions: Vector,
    gap: float,
    density: float,
) -> list[Brick]:
    """Return the bricks of courses, every second one shifted by half a brick, course by course.

    ``courses``: where each starts, m, and unit vectors along it and across its bricks.
    """
    out = list[Brick]()
    for course, (start, along, across) in enumerate(courses):
        for column in range(columns):
            node = 2 * len(out) + 2
            brick = Brick(
                name=len(out) + 1,
                position=as_vector(
                    start + (dimensions[0] + gap) * (column + 0.5 * (course % 2)) * along
                ),
                length_axis=as_vector(along),
                width_axis=as_vector(across),
                dimensions=dimensions,
                density=density,
                nodes=(node, node + 1),
                placing_node=node,
            )
            out.append(brick)
    return out


def _bond_pairs(columns: int, bricks: int) -> list[tuple[int, int]]:
    """Return which bricks of a running bond share a joint: with those below, and beside it."""
    out = []
    for i in range(bricks):
        course, column = divmod(i, columns)
        below = (column, column + 1) if course % 2 else (column - 1, column)
        out += [(i - column - columns + c, i) for c in below if course and 0 <= c < columns]
        out += [(i - 1, i)] if column else []
    return out


REPEAT = 4  # rows and columns after which a herringbone repeats


@dataclass(frozen=True)
class Tile:
    """Two cells of a herringbone, covered by one brick that lies along its rows or across.

    Rows are counted along the structure, columns across it; the given cell has the smaller numbers.
    """

    row: int
    column: int
    along: bool

    @property
    def cells(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Row and column of both cells."""
        other = (self.row + 1, self.column) if self.along else (self.row, self.column + 1)
        return (self.row, self.column), other

    @property
    def middle(self) -> tuple[float, float]:
        """Where its middle is, in rows and columns; a column is counted at its middle."""
        if self.along:
            return self.row + 1.0, float(self.column)
        return self.row + 0.5, self.column + 0.5


def tiles(rows: int, columns: Iterable[int]) -> list[Tile]:
    """Return the tiles of a herringbone whose first cells are in some columns, between two edges.

    With k = (row + column) mod 4 a tile along covers the cells k = 0 and 1 of a column, one across
    k = 2 and the cell k = 3 in the next. A tile that would cross an edge is left out.
    """
    out = []
    for column in columns:
        for row in range(rows):
            place = (row + column) % REPEAT
            if place == 2 or (place == 0 and row + 1 < rows):
                out.append(Tile(row, column, along=place == 0))
    return out


def neighbors(chosen: Sequence[Tile]) -> list[tuple[int, int]]:
    """Return which tiles share an edge of a cell: their places, each pair once, ascending."""
    owner = {cell: i for i, tile in enumerate(chosen) for cell in tile.cells}
    beside = [
        (i, owner.get(cell, i))
        for (row, column), i in owner.items()
        for cell in ((row + 1, column), (row, column + 1))
    ]
    return sorted({(min(pair), max(pair)) for pair in beside if pair[0] != pair[1]})


_ON_EDGE = 1e-12  # distance treated as zero, over the size of the faces
_PARALLEL = 1e-12  # sine of an angle between edges treated as zero


@dataclass(frozen=True, eq=False, repr=False)
class _ContactAreas(FrozenValue):
    """The overlaps of P pairs of faces."""

    area: Floats  # (P,); m²; 0 where faces do not overlap
    centroid: Floats  # (P, 2); m
    moments: Floats  # (P, 2); second moments of area about the two axes through the centroid, m⁴


def _contact_areas(first: Floats, second: Floats) -> _ContactAreas:
    """Return the overlaps of convex polygons (P, m, 2), counterclockwise, m."""
    near = first.mean(axis=1, keepdims=True)
    one, other = first - near, second - near
    slack = _ON_EDGE * np.abs(one).max(initial=0.0)  # an edge that both have is counted once
    start, end = (
        np.concatenate(parts, axis=1)
        for parts in zip(_inside(one, other, slack), _inside(other, one, -slack), strict=True)
    )
    turn = _cross(start, end)
    area = 0.5 * turn.sum(axis=1)
    real = area > slack**2
    size = np.where(real, area, 1.0)[:, None]
    centroid = (turn[:, :, None] * (start + end)).sum(axis=1) / (6 * size)
    start, end = start - centroid[:, None], end - centroid[:, None]
    squares = start**2 + start * end + end**2
    moments = (_cross(start, end)[:, :, None] * squares).sum(axis=1)[:, ::-1] / 12
    return _ContactAreas(
        np.where(real, area, 0.0), centroid + near[:, 0], np.where(real[:, None], moments, 0.0)
    )


def _inside(polygon: Floats, other: Floats, slack: float) -> tuple[Floats, Floats]:
    """Return where the part of each edge in another polygon starts and ends, each (P, m, 2)."""
    start, step = polygon, np.roll(polygon, -1, axis=1) - polygon
    side = units(np.roll(other, -1, axis=1) - other)
    height = _cross(side[:, None], start[:, :, None] - other[:, None])  # (P, m, m)
    slope = _cross(side[:, None], step[:, :, None])
    flat = np.abs(slope) <= _PARALLEL * np.linalg.norm(step, axis=2)[:, :, None]
    crossing = -height / np.where(flat, 1.0, slope)
    outside = flat & (height + slack < 0)
    enters = np.where(outside, np.inf, np.where(flat | (slope < 0), 0.0, crossing))
    leaves = np.where(flat | (slope > 0), 1.0, crossing)
    low = np.maximum(enters.max(axis=2), 0.0)
    high = np.maximum(np.minimum(leaves.min(axis=2), 1.0), 0.0)
    low = np.minimum(low, high)
    return start + low[:, :, None] * step, start + high[:, :, None] * step


def _cross(first: Floats, second: Floats) -> Floats:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


_Pairs = Sequence[tuple[int, int]]


@dataclass(frozen=True, eq=False, repr=False)
class _Faces(FrozenValue):
    """The faces of boxes that look at others: box, axis across the face, unit vectors outward."""

    which: Ints
    axis: Ints
    out: Floats


@dataclass(frozen=True, eq=False, repr=False)
class _Overlaps(FrozenValue):
    """Where pairs of boxes look at each other, seen along mean normals into the second.

    ``sides`` (P, 2, 3): unit vectors across the normals, the first most nearly an edge of the first
    box.
    """

    faces: tuple[_Faces, _Faces]
    along: Floats
    sides: Floats
    shared: _ContactAreas


def _overlaps(shapes: Boxes, pairs: _Pairs, normals: Floats | None = None) -> _Overlaps:
    """Return where boxes look at each other, by default with the faces that do so most."""
    a, b = np.array(pairs, dtype=np.int64).T
    step = shapes.place[b] - shapes.place[a]
    axes = _facing(shapes, a, b) if normals is None else _across(shapes, a, b, normals)
    one, other = _towards(shapes, a, axes[0], step), _towards(shapes, b, axes[1], -step)
    along = units(one.out - other.out)
    across = shapes.frame[a, (one.axis + 1) % 3]
    across = units(across - along * (along * across).sum(axis=1, keepdims=True))
    sides = np.stack([across, np.cross(along, across)], axis=1)
    shared = _contact_areas(_corners(shapes, one, sides), _corners(shapes, other, sides))
    return _Overlaps((one, other), along, sides, shared)


def _shares(bricks: Sequence[Brick], pairs: _Pairs, normals: Floats) -> Floats:
    """Return how much of the smaller of two faces the other covers, (P,), from 0 to 1."""
    if not pairs:
        return np.zeros(0)
    shapes = boxes(bricks)
    found = _overlaps(shapes, pairs, normals)
    whole = []
    for face in found.faces:
        side, other = (shapes.half[face.which, (face.axis + k) % 3] for k in (1, 2))
        whole.append(4 * side * other)
    return np.asarray(found.shared.area / np.minimum(*whole))


def _between(shapes: Boxes, pairs: _Pairs, found: _Overlaps) -> tuple[Floats, list[float]]:
    """Return the points (P, 3) halfway between faces, and the widths of joints that are thick."""
    middle = (found.shared.centroid[:, None, :] @ found.sides)[:, 0]
    start, end = (_height(shapes, face, found.along, middle) for face in found.faces)
    slopes = [
        (found.sides @ face.out[:, :, None])[..., 0] / (found.along * face.out).sum(axis=1)[:, None]
        for face in found.faces
    ]
    area = np.maximum(found.shared.area, np.finfo(float).tiny)[:, None]
    reach = np.sqrt(3 * found.shared.moments[:, ::-1] / area)  # half the sides of a rectangle
    taper = (np.abs(slopes[1] - slopes[0]) * reach).sum(axis=1)  # at the ends of the overlap
    place = middle + 0.5 * (start + end)[:, None] * found.along
    thin = 2 * shapes.half[np.array(pairs)].min(axis=(1, 2))
    widest = end - start + taper
    thick: list[float] = np.where(widest > THICKEST * thin, widest, 0.0).tolist()
    return place, thick


def _across(shapes: Boxes, a: Ints, b: Ints, normals: Floats) -> tuple[Ints, Ints]:
    """Return the axes of first and second boxes that are most nearly along given directions."""
    one, other = (np.abs(shapes.frame[i] @ normals[:, :, None])[..., 0] for i in (a, b))
    return one.argmax(axis=1), other.argmax(axis=1)


def _facing(shapes: Boxes, a: Ints, b: Ints) -> tuple[Ints, Ints]:
    """Return the axes across the faces of first and second boxes that look at each other.

    Of the first's faces, each with the most nearly parallel one of the second, it is those beyond
    which the other box lies farthest, in its size.
    """
    turned = shapes.frame[a] @ shapes.frame[b].transpose(0, 2, 1)
    partner = np.abs(turned).argmax(axis=2)
    second = np.take_along_axis(_beyond(shapes, b, a), partner, axis=1)
    axis = (_beyond(shapes, a, b) + second).argmax(axis=1)
    return axis, partner[np.arange(len(a)), axis]


def _beyond(shapes: Boxes, which: Ints, other: Ints) -> Floats:
    """Return how far other boxes lie along the axes of some, (P, 3), over where they touch."""
    frame = shapes.frame[which]
    away = (frame @ (shapes.place[other] - shapes.place[which])[:, :, None])[:, :, 0]
    turned = np.abs(frame @ shapes.frame[other].transpose(0, 2, 1))
    reach = (turned @ shapes.half[other][:, :, None])[:, :, 0]
    return np.asarray(np.abs(away) / (shapes.half[which] + reach))


def _towards(shapes: Boxes, which: Ints, axis: Ints, step: Floats) -> _Faces:
    """Return the faces across some axes that look along steps (P, 3)."""
    normal = shapes.frame[which, axis]
    return _Faces(which, axis, np.sign((normal * step).sum(axis=1))[:, None] * normal)


def _corners(shapes: Boxes, face: _Faces, sides: Floats) -> Floats:
    """Return the corners (P, 4, 2) of faces along two axes each (P, 2, 3), counterclockwise."""
    row = np.arange(len(face.which))
    edges = [(face.axis + k) % 3 for k in (1, 2)]
    frame, half = shapes.frame[face.which], shapes.half[face.which]
    flat = [
        half[row, edge][:, None] * (sides @ frame[row, edge][:, :, None])[:, :, 0] for edge in edges
    ]
    flat[1] *= np.sign(flat[0][:, :1] * flat[1][:, 1:] - flat[0][:, 1:] * flat[1][:, :1])
    center = shapes.place[face.which] + half[row, face.axis][:, None] * face.out
    middle = (sides @ center[:, :, None])[:, :, 0]
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return np.stack([middle + a * flat[0] + b * flat[1] for a, b in signs], axis=1)


def _height(shapes: Boxes, face: _Faces, along: Floats, point: Floats) -> Floats:
    """Return how far along directions (P, 3) from points (P, 3) faces lie, (P,)."""
    half = shapes.half[face.which, face.axis]
    away = ((shapes.place[face.which] - point) * face.out).sum(axis=1) + half
    return np.asarray(away / (along * face.out).sum(axis=1))


_STUB = 0.05  # m; of a ground end that does not say


def _joints_between(
    bricks: Sequence[Brick], pairs: _Pairs, law: JointLaw, normals: Floats | None = None
) -> tuple[Joint, ...]:
    """Return the joints of bricks, each where the faces that look at each other overlap.

    They are in the middle of the overlap, halfway between the faces; axes are the faces' mean
    normal and the edge of the first brick that is most nearly across it. One that is thick says so.
    """
    if not pairs:
        return ()
    shapes = boxes(bricks)
    found = _overlaps(shapes, pairs, normals)
    apart = np.flatnonzero(found.shared.area == 0)
    if len(apart):
        i, j = pairs[apart[0]]
        raise SceneError(
            f"joint ({bricks[i].name}, {bricks[j].name}): the faces of its bricks do not overlap; "
            "move the bricks to each other"
        )
    place, thick = _between(shapes, pairs, found)
    stiff = map(law.stiffness, found.shared.area.tolist(), found.shared.moments.tolist())
    fields = map(spring_fields, place, found.along, found.sides[:, 0], stiff)
    return tuple(
        Joint(bricks=(bricks[i].name, bricks[j].name), thickness=width or None, **held)
        for (i, j), held, width in zip(pairs, fields, thick, strict=True)
    )


def _ground_under(brick: Brick, down: Floats, law: JointLaw, stub: float = _STUB) -> Ground:
    """Return the ground end in the middle of the face of a brick that looks down (3,) most."""
    shapes = boxes([brick])
    frame, half = shapes.frame[0], shapes.half[0]
    i = int(np.abs(frame @ down).argmax())
    out = np.sign(frame[i] @ down) * frame[i]
    place = shapes.place[0] + half[i] * out
    side, other = (i + 1) % 3, (i + 2) % 3
    stiff = law.over_rectangle(2 * float(half[side]), 2 * float(half[other]))
    fields = spring_fields(place, -out, frame[side], stiff)
    return Ground(brick=brick.name, anchor=as_vector(place + stub * out), **fields)
