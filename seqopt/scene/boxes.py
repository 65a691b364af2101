"""Bricks as solids: how far boxes are apart, and how deep two solids interpenetrate.

Two boxes are apart if a plane passes between them, parallel to a face of either or to an edge of
each. The depth of other solids is that of the largest ball in both: they are apart if a plane
parallel to a face of either passes between them, or if they do not meet once both are eroded, all
of their faces moved inward, so that what only touches parts. A ball is grown from where they meet.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from seqopt._registry import Later
from seqopt.arrays import Bools, Floats, FrozenValue, Ints, Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import as_vector, as_vectors, short, units, whole
from seqopt.scene.parts import Brick
from seqopt.scene.shape import Polyhedron, _surround, fans, normal_of, plane_axes
from seqopt.work import Progress, Tell

optimize, spatial = Later("scipy.optimize"), Later("scipy.spatial")  # slow to import


def block_brick(
    name: int, shape: Polyhedron, density: float, *, nodes: tuple[int, int] | None = None
) -> Brick:
    """Return a brick of any shape, placed by its second node.

    ``shape``: where it is in the scene, m. ``nodes``: twice the name, and one more, by default;
    they are where `Polyhedron.nodes` says.
    """
    if not isinstance(shape, Polyhedron):
        raise SceneError(f"brick {short(name)}: shape is {short(shape)}; give a Polyhedron")
    own = replace(shape, vertices=as_vectors(shape.points - shape.centroid))
    x, y, z = own.extents(own.axes).tolist()
    at, first, second = as_vectors(np.vstack([shape.centroid, own.axes[:2]]))
    numbers = nodes or (2 * whole("brick: its name", name), 2 * name + 1)
    return Brick(
        name=name,
        position=at,
        length_axis=first,
        width_axis=second,
        dimensions=(x, y, z),
        density=density,
        nodes=numbers,
        placing_node=numbers[-1],
        shape=own,
        node_offsets=own.nodes(),
    )


def _spring_fields(
    position: Floats, along: Floats, across: Floats, stiffness: tuple[Vector, Vector]
) -> dict[str, Any]:
    """Return the fields of a joint or ground end; stiffnesses are N/m, then N m/rad."""
    names = ("position", "along", "across", "translational_stiffness", "rotational_stiffness")
    return dict(zip(names, (*map(as_vector, (position, along, across)), *stiffness), strict=True))


def vertices_of(brick: Brick) -> tuple[Floats, Sequence[Sequence[int]]]:
    """Return the vertices (V, 3) of a brick in the scene, m, and its faces among them."""
    if brick.shape is not None:
        return np.asarray(brick.shape.points + np.array(brick.position)), brick.shape.faces
    half = 0.5 * np.array(brick.dimensions)[:, None] * brick.frame
    return np.asarray(np.array(brick.position) + BOX_CORNERS @ half), BOX_FACES


BOX_CORNERS = np.array([*product((-1.0, 1.0), repeat=3)])
BOX_FACES = ((0, 1, 3, 2), (6, 7, 5, 4), (4, 5, 1, 0), (2, 3, 7, 6), (0, 2, 6, 4), (5, 7, 3, 1))


_PARALLEL = 1e-9  # sine of an angle between edges treated as zero
_DEEPEST = 1e-6  # depth that is rounding, over the smallest dimension


def _boxes(bricks: Sequence[Brick]) -> tuple[Floats, Floats, Floats]:
    """Return centroids (n, 3), frames (n, 3, 3) and halves of dimensions (n, 3) of bricks, m."""
    place = np.array([brick.position for brick in bricks]).reshape(-1, 3)
    frame = np.array([brick.frame for brick in bricks]).reshape(-1, 3, 3)
    return place, frame, 0.5 * np.array([brick.dimensions for brick in bricks]).reshape(-1, 3)


def box_corners(bricks: Sequence[Brick]) -> Floats:
    """Return where the corners of bricks are, each as a box, (n, 8, 3), m."""
    place, frame, half = _boxes(bricks)
    return np.asarray(place[:, None] + (BOX_CORNERS * half[:, None]) @ frame)


def _separations(bricks: Sequence[Brick]) -> tuple[Ints, Floats]:
    """Return how far bricks are apart that are near each other, as pairs (P, 2) and m (P,).

    Along the direction in which they are farthest apart: at most their distance, negative where
    they interpenetrate.
    """
    place, frame, half = _boxes(bricks)
    longest = 2 * float(np.linalg.norm(half, axis=1).max(initial=0.0))
    near = spatial.KDTree(place).query_pairs(longest, output_type="ndarray")
    pairs = near[np.lexsort(near.T[::-1])].astype(np.int64)
    a, b = pairs.T
    first, second = frame[a], frame[b]
    normal = np.cross(first[:, :, None], second[:, None, :]).reshape(len(first), 9, 3)
    size = np.linalg.norm(normal, axis=2, keepdims=True)
    normal = np.where(size > _PARALLEL, normal / np.maximum(size, _PARALLEL), 0.0)
    axes = np.concatenate([first, second, normal], axis=1)
    apart = np.abs(axes @ (place[b] - place[a])[:, :, None])[:, :, 0]
    for which in (a, b):
        spread = np.abs(axes @ frame[which].transpose(0, 2, 1))
        apart -= (spread @ half[which][:, :, None])[:, :, 0]
    real = np.linalg.norm(axes, axis=2) > _PARALLEL
    return pairs, np.where(real, apart, -np.inf).max(axis=1, initial=-np.inf)


def require_apart(
    where: str, bricks: Sequence[Brick], remedy: str, deepest: float = _DEEPEST
) -> None:
    """Require bricks that interpenetrate by at most ``deepest`` of the smallest dimension."""
    pairs, distance = _separations(bricks)
    thin = min(min(brick.dimensions) for brick in bricks)
    if distance.min(initial=0.0) < -deepest * thin:
        i, j = pairs[distance.argmin()]
        raise SceneError(
            f"{where}: bricks {bricks[i].name} and {bricks[j].name} interpenetrate by "
            f"{-1e3 * distance.min():.3g} mm; {remedy}"
        )


TOLERATED = 0.05  # depth that rounding and mortar explain, over the smallest dimension
_ERODED = (0.55, 0.45)  # of two solids, over the depth; unequal, so that no faces meet in one plane
_ALIKE_NORMALS = 0.05  # of normals at a vertex: what they span less is not solved for
_STARTS = 4  # points from which balls are grown
_STUCK = 1e-4  # share by which a ball grows less once it is as large as can be


@dataclass(frozen=True)
class Overlap:
    """Two solids that interpenetrate.

    ``pair``: their places; ``depth``: diameter of the largest ball in both, m; ``bounds``: by how
    much their bounds overlap along x, y and z, m.
    """

    pair: tuple[int, int]
    depth: float
    bounds: tuple[float, float, float]

    def __str__(self) -> str:
        along = (f"{1e3 * b:.3g} mm along {a}" for a, b in zip("xyz", self.bounds, strict=True))
        return f"by {1e3 * self.depth:.3g} mm (their bounds by {', '.join(along)})"


@dataclass(frozen=True, eq=False, repr=False)
class _Face(FrozenValue):
    """A face that has an area: a corner, its normal and two axes in it, corners (m, 2) in these.

    ``step`` (m, 2): from each corner to the next.
    """

    origin: Floats
    axes: Floats
    flat: Floats
    step: Floats


def _near_pairs(bounds: Sequence[Floats], gap: float) -> Iterator[tuple[int, int]]:
    """Yield pairs of bounds, lows and highs (2, 3) in m, that are no farther apart than a gap.

    A negative gap asks for bounds that overlap by as much.
    """
    low, high = np.moveaxis(np.reshape(bounds, (-1, 2, 3)), 1, 0)
    for i in range(len(low)):
        over = ((low[i + 1 :] - gap <= high[i]) & (low[i] - gap <= high[i + 1 :])).all(axis=1)
        for j in np.flatnonzero(over):
            yield i, i + 1 + int(j)


def _bounds_of(points: Floats) -> Floats:
    """Return the lows and highs (2, k) of points (n, k)."""
    return np.array([points.min(axis=0), points.max(axis=0)])


def _find_overlaps(
    solids: Sequence[Polyhedron], tolerated: Sequence[float], progress: Tell | None = None
) -> Iterator[Overlap]:
    """Yield pairs of solids that interpenetrate by more than either's tolerance, m.

    ``progress``: called with how far it is.
    """
    bounds = [_bounds_of(solid.points) for solid in solids]
    faces: dict[int, list[_Face]] = {}
    course, done = Progress("looking for overlaps", len(solids), progress), 0
    for i, j in _near_pairs(bounds, -min(tolerated, default=0.0)):
        course.add(i - done)
        done, deepest, pair = i, min(tolerated[i], tolerated[j]), (solids[i], solids[j])
        for k in (i, j):
            faces[k] = faces.get(k) or _faces(solids[k].points, solids[k])
        every = (*faces[i], *faces[j])
        along = np.vstack([np.eye(3), [face.axes[0] for face in every]])
        low, high = np.stack([_bounds_of(solid.points @ along.T) for solid in pair], axis=1)
        over = high.min(axis=0) - low.max(axis=0)  # negative where they are apart
        if over.min() <= deepest:
            continue
        starts = _where_both(pair, deepest)
        radius = max((_grown(pair, every, start) for start in starts), default=0.0)
        if 2 * radius > deepest:
            x, y, z = over[:3].tolist()
            yield Overlap((i, j), 2 * radius, (x, y, z))


def overlapping(bricks: Sequence[Brick]) -> list[tuple[int, int, float]]:
    """Return the names of bricks that interpenetrate by more than `TOLERATED`, and depths, m.

    The deepest come first.
    """
    thin = np.array([min(brick.dimensions) for brick in bricks])
    if all(brick.shape is None for brick in bricks):
        pairs, apart = _separations(bricks)
        deep = -apart > TOLERATED * thin[pairs].min(axis=1)
        found = [(i, j, -d) for (i, j), d in zip(pairs[deep], apart[deep].tolist(), strict=True)]
    else:
        shapes = [
            Polyhedron(as_vectors(points), tuple(map(tuple, faces)))
            for points, faces in map(vertices_of, bricks)
        ]
        overlaps = _find_overlaps(shapes, (TOLERATED * thin).tolist())
        found = [(*each.pair, each.depth) for each in overlaps]
    found.sort(key=lambda held: -held[2])
    return [(bricks[i].name, bricks[j].name, depth) for i, j, depth in found]


def _faces(points: Floats, solid: Polyhedron) -> list[_Face]:
    """Return the faces of a solid that have an area; ``points``: where its vertices are."""
    out = []
    for corners in (points[list(face)] for face in solid.faces):
        normal = normal_of(corners)
        if normal.any():
            axes = plane_axes(units(normal))
            flat = (corners - corners[0]) @ axes[1:].T
            out.append(_Face(corners[0], axes, flat, np.roll(flat, -1, axis=0) - flat))
    return out


def _where_both(pair: Sequence[Polyhedron], deepest: float) -> Floats:
    """Return points (k, 3), up to `_STARTS`, that lie deep in two solids: none if these are apart.

    Where eroded solids meet, a vertex of one lies in the other, or an edge passes a face.
    """
    moved = []
    for solid, share in zip(pair, _ERODED, strict=True):  # with all faces moved inward
        normals: list[list[Floats]] = [[] for _ in solid.points]
        for face in solid.faces:
            normal = normal_of(solid.points[list(face)])
            for vertex in face if normal.any() else ():
                normals[vertex].append(units(normal))
        flat = (np.linalg.pinv(np.array(own or [np.zeros(3)]), _ALIKE_NORMALS) for own in normals)
        shift = np.array([each.sum(axis=1) for each in flat])
        moved.append(solid.points - share * deepest * shift)
    faces = [_faces(points, solid) for points, solid in zip(moved, pair, strict=True)]
    found = []
    for mine, other in ((0, 1), (1, 0)):
        triangles = moved[other][fans(pair[other].faces)]
        found.append(moved[mine][_surround(triangles, moved[mine])])
        rims = [moved[mine][list(face)] for face in pair[mine].faces]
        start = np.vstack(rims)
        step = np.vstack([np.roll(rim, -1, axis=0) - rim for rim in rims])
        for other_face in faces[other]:  # where edges pass it
            normal, origin = other_face.axes[0], other_face.origin
            slope = step @ normal
            ahead = ((origin - start) @ normal) / np.where(slope == 0, np.inf, slope)
            met = start + ahead[:, None] * step
            inside = _within(other_face, (met - origin) @ other_face.axes[1:].T)
            found.append(met[(ahead > 0) & (ahead < 1) & inside])
    points = np.vstack(found)
    return points[:: max(1, len(points) // _STARTS)][:_STARTS]


def _within(face: _Face, seen: Floats) -> Bools:
    """Return which points (k, 2) of a face's plane lie in it."""
    to = seen[:, None] - face.flat
    crosses = (to[:, :, 1] < 0) != (to[:, :, 1] < face.step[:, 1])
    turn = to[:, :, 0] * face.step[:, 1] - to[:, :, 1] * face.step[:, 0]
    return np.asarray((crosses & (turn * np.sign(face.step[:, 1]) < 0)).sum(axis=1) % 2 == 1)


def _foot(face: _Face, point: Floats) -> Floats:
    """Return the point (3,) of a face that is nearest to another."""
    spot = face.axes[1:] @ (point - face.origin)
    if not _within(face, spot[None])[0]:
        to, size = spot - face.flat, (face.step**2).sum(axis=1)
        share = np.einsum("mi,mi->m", to, face.step) / np.where(size > 0, size, 1.0)
        rim = face.flat + np.clip(share, 0.0, 1.0)[:, None] * face.step
        spot = rim[((spot - rim) ** 2).sum(axis=1).argmin()]
    return np.asarray(face.origin + spot @ face.axes[1:])


def _grown(pair: Sequence[Polyhedron], faces: Sequence[_Face], center: Floats) -> float:
    """Return the radius of a ball in two solids that is moved and grown until it is stuck; 0: none.

    Each program grows it between planes through its nearest points of all faces.
    """
    radius = 0.0
    while True:
        feet = np.array([_foot(face, center) for face in faces])
        away = np.linalg.norm(center - feet, axis=1)
        inside = all(solid.contains(center) for solid in pair)
        if not inside or not away.min() > radius * (1 + _STUCK):
            return radius
        radius = float(away.min())
        rows = np.column_stack([(feet - center) / away[:, None], np.ones(len(away))])
        found = optimize.linprog([0, 0, 0, -1], rows, away, bounds=[(None, None)] * 3 + [(0, None)])
        if found.status:
            return radius
        center = center + np.asarray(found.x)[:3]
