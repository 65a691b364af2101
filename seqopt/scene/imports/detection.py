"""Faces over which blocks touch, found from their shapes.

Two blocks touch where a face of one lies on a face of the other: normals against each other, and
no more than a gap between the planes anywhere in the overlap. What overlaps in one plane is united
and cut into convex pieces, each a face of its own. Polygons are shapely's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import FileError, SceneError
from seqopt.scene.checks import positive, short
from seqopt.scene.shape import normal_of
from seqopt.work.progress import Progress, Tell

_THIN_PIECE = 1e-6  # by which the hull of what is convex may be larger, over its area
_GRAIN = 1e-9  # length to which corners are rounded, over the size of what overlaps


def convex_pieces(polygons: Sequence[Any]) -> Iterator[Floats]:
    """Yield the convex pieces of a union of polygons.

    Result (m, 2): corners counterclockwise, m. Raises `SceneError` if polygons are too degenerate
    to be cut.
    """
    try:
        yield from _pieces(import_module("shapely"), polygons)
    except import_module("shapely.errors").ShapelyError as error:
        raise SceneError(f"a face where blocks touch cannot be cut: {short(error, 80)}") from error


def _pieces(shapely: Any, polygons: Sequence[Any]) -> Iterator[Floats]:
    """Yield the convex pieces of a union of polygons, without a word where that fails."""
    size = max((max(abs(x) for x in polygon.bounds) for polygon in polygons), default=1.0)
    whole = shapely.unary_union(list(polygons), grid_size=_GRAIN * size).simplify(_GRAIN * size)
    for part in getattr(whole, "geoms", [whole]):
        if part.geom_type != "Polygon" or part.is_empty:
            continue
        if _is_convex(part):
            yield _corners(part)
            continue
        triangles = [*shapely.constrained_delaunay_triangles(part).geoms]
        yield from map(_corners, _merged(triangles, _GRAIN * size))


def _merged(pieces: list[Any], grain: float) -> list[Any]:
    """Return convex polygons united as long as two of them have a convex union."""
    pieces = sorted(pieces, key=lambda piece: -piece.area)
    i = 0
    while i < len(pieces):
        for j in range(i + 1, len(pieces)):
            if pieces[i].intersection(pieces[j]).length <= grain:
                continue
            union = pieces[i].union(pieces[j], grid_size=grain).simplify(grain)
            if union.geom_type == "Polygon" and _is_convex(union):
                pieces[i] = union
                del pieces[j]
                break
        else:
            i += 1
    return pieces


def _is_convex(polygon: Any) -> bool:
    hull = polygon.convex_hull.area
    return not polygon.interiors and bool(hull - polygon.area <= _THIN_PIECE * hull)


def _corners(polygon: Any) -> Floats:
    """Return the corners of the hull of a polygon that is convex but for rounding."""
    hull = import_module("shapely").geometry.polygon.orient(polygon.convex_hull)
    return np.array(hull.exterior.coords)[:-1]


OPPOSED = np.cos(np.radians(15.0))  # cosine from which on normals are against each other
_LEVEL = 1 - 1e-6  # cosine from which on faces are in one plane
_MOST_PAIRS = 300_000  # of blocks that are near each other
_SLIVER = 1e-6  # overlap treated as zero, over the smaller of two faces

_Plane = tuple[Floats, Floats, list[Any]]  # origin, axes, and polygons in it


@dataclass(frozen=True, eq=False, repr=False)
class _TouchingFace(FrozenValue):
    """A convex face between two blocks."""

    blocks: tuple[int, int]  # places of the blocks, ascending
    corners: Floats  # (m, 3); once around, m
    normal: Floats  # (3,); unit vector from the first block into the second


class _Solid(Protocol):
    """What has faces: a polyhedron, or a surface that is not closed."""

    @property
    def points(self) -> Floats:
        """Vertices, (V, 3), m."""

    @property
    def faces(self) -> Sequence[Sequence[int]]:
        """Places among the vertices, once around each face."""


@dataclass(frozen=True, eq=False, repr=False)
class Surface(FrozenValue):
    """A surface that is not closed, as of a support; both of its sides are faces."""

    points: Floats  # (V, 3); m
    faces: tuple[tuple[int, ...], ...]  # places among the vertices


@dataclass(frozen=True)
class _Facets:
    """The faces of a block: corners, unit normals outward, and middles."""

    corners: tuple[Floats, ...]
    normal: Floats
    middle: Floats


def require_polygons(what: str) -> None:
    """Raise an error unless polygons can be cut.

    Raises `FileError` if the extra is not installed.
    """
    if find_spec("shapely") is None:
        raise FileError(f"{what} needs shapely; pip install 'seqopt[blocks]'")


def touching_faces(
    shapes: Sequence[_Solid], gap: float, progress: Tell | None = None
) -> tuple[_TouchingFace, ...]:
    """Return the faces over which blocks touch.

    ``shapes``: where they are in the scene; ``gap``: most that may lie between two faces, or by
    which they may interpenetrate, m; ``progress``: told how far it is, once it takes longer than a
    second. Result: in the order of the blocks; halfway between the two faces. Raises `FileError` if
    shapely is not installed; `SceneError` if the gap is not positive, or more than `_MOST_PAIRS`
    blocks are near each other.

    Examples
    --------
    >>> from seqopt.scene.shape import Polyhedron
    >>> corners = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1))
    >>> sides = ((0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
    >>> up = Polyhedron(corners, (*sides, (3, 2, 1, 0)))
    >>> down = Polyhedron(
    ...     tuple((x, y, -z) for x, y, z in corners),
    ...     (*(side[::-1] for side in sides), (0, 1, 2, 3)),
    ... )
    >>> [(face.blocks, face.normal.tolist()) for face in touching_faces([up, down], 1e-6)]
    [((0, 1), [0.0, 0.0, -1.0])]
    """
    require_polygons("finding where blocks touch")
    gap = positive("gap", gap, "m")
    for shape in shapes:
        if not hasattr(shape, "points") or not hasattr(shape, "faces"):
            raise SceneError(f"shapes: {short(shape)} is not a shape; give each as Polyhedron(...)")
    return tuple(_found(shapes, gap, Progress("finding faces", len(shapes), progress)))


def _found(shapes: Sequence[_Solid], gap: float, course: Progress) -> Iterator[_TouchingFace]:
    """Yield the faces over which blocks touch, pair by pair."""
    facets, done = [_facets(shape) for shape in shapes], 0
    for tries, (i, j) in enumerate(_near(shapes, gap)):
        course.add(i - done)
        done = i
        if tries == _MOST_PAIRS:
            raise SceneError(f"more than {_MOST_PAIRS} pairs of blocks are in one place; part them")
        for polygons, (origin, axes) in _overlaps(facets[i], facets[j], gap):
            for piece in convex_pieces(polygons):
                yield _TouchingFace((i, j), origin + piece @ axes[1:], axes[0])


def _facets(shape: _Solid) -> _Facets:
    corners = tuple(shape.points[list(face)] for face in shape.faces)
    normals = np.array([normal_of(face) for face in corners])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    return _Facets(corners, normals / size, np.array([face.mean(axis=0) for face in corners]))


def _near(shapes: Sequence[_Solid], gap: float) -> Iterator[tuple[int, int]]:
    """Yield pairs of blocks whose boxes along the axes are no farther apart than a gap."""
    low = np.array([shape.points.min(axis=0) for shape in shapes]).reshape(-1, 3) - gap
    high = np.array([shape.points.max(axis=0) for shape in shapes]).reshape(-1, 3)
    for i in range(len(shapes)):
        later = slice(i + 1, None)
        over = ((low[later] <= high[i]) & (low[i] <= high[later])).all(axis=1)
        for j in np.flatnonzero(over):
            yield i, i + 1 + int(j)


def _overlaps(first: _Facets, second: _Facets, gap: float) -> Iterator[tuple[list[Any], Any]]:
    """Yield overlaps of the faces of two blocks, plane by plane, with the origins and axes."""
    planes: list[_Plane] = []
    for k, m in _opposed(first, second, gap):
        normal = first.normal[k] - second.normal[m]
        normal /= np.linalg.norm(normal)
        middle = 0.5 * (first.middle[k] + second.middle[m])
        same = next((plane for plane in planes if _in_plane(plane, normal, middle, gap)), None)
        origin, axes, known = (middle, _plane_axes(normal), []) if same is None else same
        known += _overlap(first.corners[k], second.corners[m], (origin, axes), gap)
        if same is None and known:
            planes.append((origin, axes, known))
    for origin, axes, polygons in planes:
        yield polygons, (origin, axes)


def _in_plane(plane: _Plane, normal: Floats, middle: Floats, gap: float) -> bool:
    """Return whether a face lies in a plane, no farther off than half a gap."""
    origin, axes, _ = plane
    return bool(normal @ axes[0] > _LEVEL and abs((middle - origin) @ axes[0]) <= 0.5 * gap)


def _opposed(first: _Facets, second: _Facets, gap: float) -> Ints:
    """Return pairs (P, 2) of faces that look at each other from near planes."""
    against = first.normal @ second.normal.T < -OPPOSED
    step = second.middle[None] - first.middle[:, None]
    apart = np.abs(np.einsum("kmi,ki->km", step, first.normal))
    wide = np.linalg.norm(step, axis=2)
    return np.argwhere(against & (apart <= gap + (1 - OPPOSED**2) ** 0.5 * wide)).astype(np.int64)


def _plane_axes(normal: Floats) -> Floats:
    """Return a right-handed frame (3, 3) whose first row is a normal."""
    side = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
    side /= np.linalg.norm(side)
    return np.stack([normal, side, np.cross(normal, side)])


def _overlap(first: Floats, second: Floats, plane: tuple[Floats, Floats], gap: float) -> list[Any]:
    """Return the overlap of two faces (m, 3), seen along a normal, if they are near all over it."""
    shapely = import_module("shapely")
    origin, axes = plane
    seen = [(face - origin) @ axes.T for face in (first, second)]
    one, other = (shapely.make_valid(shapely.Polygon(face[:, 1:])) for face in seen)
    common = one.intersection(other)
    if not common.area > _SLIVER * min(one.area, other.area):
        return []
    points = shapely.get_coordinates(common)
    heights = [_heights(face, points) for face in seen]
    if np.abs(heights[1] - heights[0]).max() > gap:
        return []
    return [part for part in getattr(common, "geoms", [common]) if part.geom_type == "Polygon"]


def _heights(face: Floats, points: Floats) -> Floats:
    """Return how high a plane through corners (m, 3) lies over points (k, 2) of its first axis."""
    normal, middle = normal_of(face), face.mean(axis=0)
    return np.asarray(middle[0] - (points - middle[1:]) @ normal[1:] / normal[0])
