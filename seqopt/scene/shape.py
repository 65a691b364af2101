"""Convex polygons and closed polyhedra, checked: volume, centroid and longest axis of any block."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from seqopt.arrays import Floats, Vector, frozen
from seqopt.errors import SceneError
from seqopt.scene.checks import short, vector, wholes

_Part = TypeVar("_Part")
_STRAIGHT = 1e-9  # by how much a convex polygon may turn back, over the square of its longest edge


def rows(where: str, values: Iterable[_Part]) -> tuple[_Part, ...]:
    """Return what there is to go through. Raises `SceneError` if it is no list."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise SceneError(f"{where} is {short(values)}; give a list")
    return tuple(values)


def convex_polygon(
    where: str, corners: Iterable[Iterable[float]]
) -> tuple[tuple[float, float], ...]:
    """Return the corners of a convex polygon, counterclockwise.

    ``corners``: two coordinates each, once around, m. Raises `SceneError` if there are fewer than
    three, one is not finite, or they are no convex polygon with an area.
    """
    points = []
    for corner in rows(where, corners):
        x, y, _ = vector(f"{where}: a corner", (*rows(f"{where}: a corner", corner), 0.0))
        points.append((x, y))
    edges = [(u - x, v - y) for (x, y), (u, v) in zip(points, points[1:] + points[:1], strict=True)]
    turns = [a * d - b * c for (a, b), (c, d) in zip(edges, edges[1:] + edges[:1], strict=True)]
    size = max((a * a + b * b for a, b in edges), default=0.0)
    slack = _STRAIGHT * size
    angle = math.fsum(
        math.atan2(turn, a * c + b * d)
        for turn, (a, b), (c, d) in zip(turns, edges, edges[1:] + edges[:1], strict=True)
    )
    if len(points) < 3 or not max(turns) > slack or min(turns) < -slack or angle > 3 * math.pi:
        raise SceneError(
            f"{where} is {short(points)}; give three corners or more of a convex polygon, "
            "counterclockwise"
        )
    return tuple(points)


FLAT = 1e-4  # by how much a face may leave its plane, over the size of the block
_EVEN = 1e-12  # share of the second moments by which axes of equal length are told apart
_NEAR = (1.0, 0.75, 0.5, 0.25, 0.1)  # of a quarter of the extent: where a node is tried


@dataclass(frozen=True)
class Polyhedron:
    """A closed polyhedron, convex or not.

    ``vertices``: from the block's centroid, in the scene's axes, m; ``faces``: places among the
    vertices, once around each face, counterclockwise from outside. Raises `SceneError` if it is not
    closed, its faces are not flat or do not agree which side is outside, or its volume is not
    positive.

    Examples
    --------
    >>> corners = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    >>> wedge = Polyhedron(corners, ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
    >>> round(wedge.volume, 4), wedge.centroid.round(2).tolist()
    (0.1667, [0.25, 0.25, 0.25])
    """

    vertices: tuple[Vector, ...]
    faces: tuple[tuple[int, ...], ...]

    def __post_init__(self) -> None:
        for name in ("vertices", "faces"):
            rows = getattr(self, name)
            if isinstance(rows, str) or not isinstance(rows, Iterable):
                raise SceneError(f"shape: {name} is {short(rows)}; give a list of lists")
        points = tuple(vector("shape: a vertex", row) for row in self.vertices)
        faces = tuple(wholes("shape: a face", row) for row in self.faces)
        object.__setattr__(self, "vertices", points)
        object.__setattr__(self, "faces", faces)
        _require_corners(len(points), faces)
        _require_closed(faces)
        size = float(np.ptp(self.points, axis=0).max(initial=0.0))
        for i, face in enumerate(faces):
            if bend(self.points[list(face)]) > FLAT * size:
                raise SceneError(f"shape: face {i} is not flat; cut it into triangles")
        if not self.volume > 0:
            raise SceneError(
                f"shape: its volume is {self.volume:g} m³; list the vertices of every face "
                "counterclockwise as seen from outside"
            )

    @cached_property
    def points(self) -> Floats:
        """Its vertices, (V, 3), m."""
        return frozen(np.array(self.vertices, dtype=float).reshape(-1, 3))

    @cached_property
    def triangles(self) -> Floats:
        """Its faces as fans of triangles, (T, 3, 3), m; of a face that is not convex they overlap.

        With their signs they add up to the face all the same.
        """
        fans = [
            (face[0], face[k], face[k + 1]) for face in self.faces for k in range(1, len(face) - 1)
        ]
        return frozen(self.points[np.array(fans, dtype=np.int64).reshape(-1, 3)])

    @cached_property
    def _tetrahedra(self) -> tuple[Floats, Floats, Floats]:
        """The mean of the vertices, and signed tetrahedra from it: volumes and corners."""
        middle = self.points.mean(axis=0)
        corners = self.triangles - middle
        return middle, np.asarray(np.linalg.det(corners) / 6), corners

    @cached_property
    def volume(self) -> float:
        """Volume, m³."""
        return float(self._tetrahedra[1].sum())

    @cached_property
    def centroid(self) -> Floats:
        """Centroid, (3,), m."""
        middle, volume, corners = self._tetrahedra
        return frozen(np.asarray(middle + volume @ corners.sum(axis=1) / (4 * volume.sum())))

    @cached_property
    def axes(self) -> Floats:
        """Principal axes of its volume, the longest first, (3, 3), rows are unit vectors.

        Where two are equally long, those nearest to x, then to y, come first.
        """
        arms = self.triangles - self.centroid
        volume = np.linalg.det(arms) / 6  # of tetrahedra from the centroid
        total = arms.sum(axis=1)
        spread = np.einsum("t,tia,tib->ab", volume, arms, arms)
        spread = (spread + np.einsum("t,ta,tb->ab", volume, total, total)) / 20
        spread += _EVEN * np.trace(spread) * np.diag([2.0, 1.0, 0.0])
        found = np.linalg.eigh(spread)[1].T[::-1].copy()
        found[2] = np.cross(found[0], found[1])
        for i in (0, 1):  # their signs follow from the shape, not from the solver
            largest = int(np.abs(found[i]).argmax())
            if found[i, largest] < 0:
                found[[i, 2]] *= -1
        return frozen(found)

    def extents(self, axes: Floats) -> Floats:
        """Return how far it extends along unit vectors. ``axes`` (k, 3). Result (k,): m."""
        return np.asarray(np.ptp(self.points @ axes.T, axis=0))

    def contains(self, point: Floats) -> bool:
        """Return whether a point lies inside: its faces surround it once. ``point`` (3,)."""
        a, b, c = np.moveaxis(self.triangles - point, 1, 0)
        lengths = [np.linalg.norm(side, axis=1) for side in (a, b, c)]
        above = np.einsum("ti,ti->t", a, np.cross(b, c))
        below = lengths[0] * lengths[1] * lengths[2]
        for i, (one, other) in enumerate(((b, c), (c, a), (a, b))):
            below = below + np.einsum("ti,ti->t", one, other) * lengths[i]
        return bool(abs(np.arctan2(above, below).sum()) > np.pi)  # half of the solid angle

    def nodes(self) -> tuple[Vector, Vector]:
        """Return where its two inner nodes lie if nobody says: on either side of the centroid.

        Result: from the centroid, m: a quarter of the extent away along the longest principal axis;
        nearer, or along another axis, where that is outside; outside if all are.
        """
        reach = 0.25 * self.extents(self.axes)
        tries = [(share * reach[i], i) for i in range(3) for share in _NEAR]
        steps = [(size * self.axes[i]) for size, i in tries]
        found = next((step for step in steps if self._holds(step)), steps[0])
        x, y, z = (found + 0.0).tolist()
        return (0.0 - x, 0.0 - y, 0.0 - z), (x, y, z)

    def _holds(self, step: Floats) -> bool:
        return self.contains(self.centroid + step) and self.contains(self.centroid - step)


def normal_of(corners: Floats) -> Floats:
    """Return the normal of a polygon, as long as twice its area.

    ``corners`` (m, 3): once around, m. Result (3,): m².
    """
    spokes = corners - corners[0]
    return np.asarray(np.cross(spokes[1:-1], spokes[2:]).sum(axis=0))


def bend(corners: Floats) -> float:
    """Return how far corners of a polygon lie from its plane.

    ``corners`` (m, 3): once around, m. Result: m; infinite if it has no area.
    """
    normal = normal_of(corners)
    size = float(np.linalg.norm(normal))
    if not size > 0:
        return np.inf
    return float(np.abs((corners - corners.mean(axis=0)) @ normal).max() / size)


def with_shape(entry: dict[str, Any]) -> dict[str, Any]:
    """Return the entry of a brick in a document with its shape, if it has one, as a value.

    ``entry``: with ``name`` and perhaps ``shape``.
    """
    if entry.get("shape") is None:
        return entry
    try:
        return {**entry, "shape": Polyhedron(**entry["shape"])}
    except SceneError as error:
        raise SceneError(f"brick {short(entry['name'])}: {error}") from error


def _require_corners(count: int, faces: tuple[tuple[int, ...], ...]) -> None:
    """Require faces of at least three different vertices that there are."""
    if count < 4 or len(faces) < 4:
        raise SceneError(f"shape: {count} vertices and {len(faces)} faces; give at least four each")
    for i, face in enumerate(faces):
        if len(face) < 3 or len(set(face)) < len(face):
            raise SceneError(
                f"shape: face {i} is {short(list(face))}; give three vertices or more, each once"
            )
        if min(face) < 0 or max(face) >= count:
            raise SceneError(
                f"shape: face {i} is {short(list(face))}; name vertices from 0 to {count - 1}"
            )


def _require_closed(faces: tuple[tuple[int, ...], ...]) -> None:
    """Require every edge to be passed once each way."""
    edges = Counter(
        (a, b) for face in faces for a, b in zip(face, (*face[1:], face[0]), strict=True)
    )
    for (a, b), times in edges.items():
        if times == 1 and not edges[b, a]:
            raise SceneError(f"shape: edge {a}-{b} has a face on one side only; close the shape")
        if times > 1:
            raise SceneError(
                f"shape: at edge {a}-{b} faces do not agree which side is outside, or more than "
                "two meet; list vertices counterclockwise as seen from outside"
            )


_SAME_PLACE = 1e-6  # distance treated as zero, over the size of a block


def two_points(where: str, given: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
    """Return where the nodes of a block are if they are two places.

    Raises `SceneError` if they are not two different points.
    """
    found = [vector(f"{where}: node_offsets", row) for row in rows(f"{where}: node_offsets", given)]
    if len(found) != 2 or found[0] == found[1]:
        raise SceneError(f"{where}: node_offsets are {short(given)}; give two different points")
    return found[0], found[1]


def check_shape(where: str, shape: object, dimensions: Vector, axes: tuple[Vector, Vector]) -> None:
    """Require a shape about the centroid that extends as far as the dimensions say.

    ``axes``: unit vectors along length and width. Raises `SceneError` if it is not such a shape.
    """
    size = max(dimensions)
    if not isinstance(shape, Polyhedron):
        raise SceneError(f"{where}: shape is {short(shape)}; give a Polyhedron")
    off = math.hypot(*shape.centroid.tolist())
    if not off <= _SAME_PLACE * size:
        raise SceneError(
            f"{where}: the centroid of its shape is {off:.3g} m from its position; give vertices "
            "from the centroid"
        )
    length, width = np.array(axes[0]), np.array(axes[1])
    extents = shape.extents(np.stack([length, width, np.cross(length, width)]))
    if not np.allclose(extents, dimensions, rtol=0.0, atol=_SAME_PLACE * size):
        raise SceneError(
            f"{where}: dimensions are {list(dimensions)}, and its shape extends "
            f"{[float(f'{e:.6g}') for e in extents]} along its axes; give these"
        )
