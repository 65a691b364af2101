"""Closed polyhedra, checked: volume, centroid and longest axis of any block; and polygons."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, Vector, frozen
from seqopt.errors import SceneError
from seqopt.scene._checks import rows, settle, short, vector, wholes

_Corner = TypeVar("_Corner")
_STRAIGHT = 1e-9  # by how much a convex polygon may turn back, over the square of its longest edge
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
        vertices = rows("shape: vertices", self.vertices, "a list of lists")
        faces = rows("shape: faces", self.faces, "a list of lists")
        points = tuple(vector("shape: a vertex", row) for row in vertices)
        faces = tuple(wholes("shape: a face", row) for row in faces)
        settle(self, vertices=points, faces=faces)
        _require_closed(len(points), faces)
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
        """Its faces as fans of triangles, (T, 3, 3), m, whose signs add up to the face."""
        return frozen(self.points[fans(self.faces)])

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
        """Principal axes of its volume as rows (3, 3), the longest first; of equals x, then y."""
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
        """Return how far it extends along unit vectors (k, 3), m."""
        return np.asarray(np.ptp(self.points @ axes.T, axis=0))

    def contains(self, point: Floats) -> bool:
        """Return whether a point lies inside. ``point`` (3,)."""
        return bool(_surround(self.triangles, point[None])[0])

    def nodes(self) -> tuple[Vector, Vector]:
        """Return where its inner nodes lie if nobody says, from the centroid, m.

        A quarter of the extent away along the longest principal axis, on either side; nearer, or
        along another axis, where that is outside; outside if all are.
        """
        reach = 0.25 * self.extents(self.axes)
        steps = [share * reach[i] * self.axes[i] for i in range(3) for share in _NEAR]
        center = self.centroid
        inside = (s for s in steps if self.contains(center + s) and self.contains(center - s))
        found = next(inside, steps[0])
        x, y, z = (found + 0.0).tolist()
        return (0.0 - x, 0.0 - y, 0.0 - z), (x, y, z)


def _surround(triangles: Floats, points: Floats) -> Bools:
    """Return which points (k, 3) lie inside a solid: its triangles (T, 3, 3) surround them once."""
    a, b, c = np.moveaxis(triangles - points[:, None, None], 2, 0)
    lengths = [np.linalg.norm(side, axis=2) for side in (a, b, c)]
    above = np.einsum("kti,kti->kt", a, np.cross(b, c))
    below = lengths[0] * lengths[1] * lengths[2]
    for i, (one, other) in enumerate(((b, c), (c, a), (a, b))):
        below = below + np.einsum("kti,kti->kt", one, other) * lengths[i]
    halves = np.arctan2(above, below).sum(axis=1)  # of the solid angles
    return np.asarray(np.abs(halves) > np.pi)


def edges(face: Sequence[_Corner]) -> Iterator[tuple[_Corner, _Corner]]:
    """Return the corners of a face, each with the next one, once around."""
    return zip(face, (*face[1:], *face[:1]), strict=True)


def fans(faces: Sequence[Sequence[int]]) -> Ints:
    """Return the triangles (T, 3) that cut faces from their first corners."""
    found = [(face[0], face[k], face[k + 1]) for face in faces for k in range(1, len(face) - 1)]
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def normal_of(corners: Floats) -> Floats:
    """Return the normal (3,) of a polygon (m, 3), as long as twice its area, m²."""
    spokes = corners - corners[0]
    return np.asarray(np.cross(spokes[1:-1], spokes[2:]).sum(axis=0))


def bend(corners: Floats) -> float:
    """Return how far corners of a polygon (m, 3) lie from its plane, m; infinite without area."""
    normal = normal_of(corners)
    size = float(np.linalg.norm(normal))
    if not size > 0:
        return np.inf
    return float(np.abs((corners - corners.mean(axis=0)) @ normal).max() / size)


def _convex_polygon(
    where: str, corners: Iterable[Iterable[float]]
) -> tuple[tuple[float, float], ...]:
    """Return the corners of a convex polygon that has an area, counterclockwise, m."""
    points = []
    for corner in rows(where, corners):
        x, y, _ = vector(f"{where}: a corner", (*rows(f"{where}: a corner", corner), 0.0))
        points.append((x, y))
    edges = [(u - x, v - y) for (x, y), (u, v) in zip(points, points[1:] + points[:1], strict=True)]
    after = [*zip(edges, edges[1:] + edges[:1], strict=True)]
    turns = [a * d - b * c for (a, b), (c, d) in after]
    slack = _STRAIGHT * max((a * a + b * b for a, b in edges), default=0.0)
    angle = math.fsum(
        math.atan2(turn, a * c + b * d) for turn, ((a, b), (c, d)) in zip(turns, after, strict=True)
    )
    if len(points) < 3 or not max(turns) > slack or min(turns) < -slack or angle > 3 * math.pi:
        raise SceneError(
            f"{where} is {short(points)}; give three corners or more of a convex polygon, "
            "counterclockwise"
        )
    return tuple(points)


def clip(polygon: Floats, other: Floats) -> Floats:
    """Return the common part (m, 2) of two convex polygons, edge by edge of the second.

    Corners are counterclockwise.
    """
    kept: list[list[float]] = polygon.tolist()
    for (x, y), (u, v) in edges(other.tolist()):
        before, kept = kept, []
        inside = [(u - x) * (q - y) - (v - y) * (p - x) for p, q in before]
        for k, (p, q) in enumerate(before):
            last, here = inside[k - 1], inside[k]
            if last * here < 0:
                share, (r, s) = last / (last - here), before[k - 1]
                kept.append([r + share * (p - r), s + share * (q - s)])
            if here >= 0:
                kept.append([p, q])
    return np.array(kept).reshape(-1, 2)


def polygon_moments(flat: Floats) -> tuple[float, Floats, Floats]:
    """Return area, centroid (2,), and integrals of squares about it (2, 2) of a polygon (m, 2)."""
    after = np.roll(flat, -1, axis=0)
    turn = flat[:, 0] * after[:, 1] - flat[:, 1] * after[:, 0]
    area = 0.5 * float(turn.sum())
    center = turn @ (flat + after) / (6 * area)
    one, two = flat - center, after - center
    turn = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    squares = sum(np.einsum("e,ea,eb->ab", turn, arm, arm) for arm in (one, two, one + two))
    return area, center, np.asarray(squares / 24)


def _require_closed(count: int, faces: tuple[tuple[int, ...], ...]) -> None:
    """Require faces of vertices that there are, and every edge to be passed once each way."""
    if count < 4 or len(faces) < 4:
        raise SceneError(f"shape: {count} vertices and {len(faces)} faces; give at least four each")
    for i, face in enumerate(faces):
        wanted = ""
        if len(face) < 3 or len(set(face)) < len(face):
            wanted = "give three vertices or more, each once"
        elif min(face) < 0 or max(face) >= count:
            wanted = f"name vertices from 0 to {count - 1}"
        if wanted:
            raise SceneError(f"shape: face {i} is {short(list(face))}; {wanted}")
    passed = Counter(edge for face in faces for edge in edges(face))
    for (a, b), times in passed.items():
        if times == 1 and not passed[b, a]:
            raise SceneError(f"shape: edge {a}-{b} has a face on one side only; close the shape")
        if times > 1:
            raise SceneError(
                f"shape: at edge {a}-{b} faces do not agree which side is outside, or more than "
                "two meet; list vertices counterclockwise as seen from outside"
            )
