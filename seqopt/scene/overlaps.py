"""Which solids interpenetrate, and how deep: the largest ball that lies in both.

Two solids are apart if a plane parallel to a face of either passes between them. Otherwise centers
of balls are sought in cells of the space that the bounds of both share. A cell is left out if none
that is deep enough can lie in it; where all are left out, the solids are apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue
from seqopt.scene._checks import units
from seqopt.scene.boxes import _separations, as_vectors, vertices_of
from seqopt.scene.parts import Brick
from seqopt.scene.shape import FLAT, Polyhedron, normal_of, plane_axes
from seqopt.work.progress import Progress, Tell

TOLERATED = 0.05  # depth that rounding and mortar explain, over the smallest dimension
_SLACK = 1.5  # depth from which on an overlap is found for sure, over that which is tolerated
_CELLS = 24  # along the longest side of the space that is searched
_MOST_CELLS = 4_000  # of one size that are cut further, the deepest
_STARTS = 2  # from which balls are grown, of all cells of a size
_STUCK = 1e-4  # share by which a ball grows less once it is as large as can be
_RAY, *_SIDES = plane_axes(units(np.array([0.3490658, 0.5171023, 0.7817391])))  # along no face
_ACROSS = np.array(_SIDES)
_CORNERS = np.array([*product((0.0, 1.0), repeat=3)])


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

    ``step`` (m, 2): from each corner to the next; ``bounds`` (2, 3); ``shadow`` (2, 2): bounds
    as seen along the ray.
    """

    origin: Floats
    axes: Floats
    flat: Floats
    step: Floats
    bounds: Floats
    shadow: Floats


def near_pairs(bounds: Sequence[Floats], gap: float) -> Iterator[tuple[int, int]]:
    """Yield pairs of bounds, lows and highs (2, 3) in m, that are no farther apart than a gap.

    A negative gap asks for bounds that overlap by as much.
    """
    low, high = np.moveaxis(np.reshape(bounds, (-1, 2, 3)), 1, 0)
    for i in range(len(low)):
        over = ((low[i + 1 :] - gap <= high[i]) & (low[i] - gap <= high[i + 1 :])).all(axis=1)
        for j in np.flatnonzero(over):
            yield i, i + 1 + int(j)


def bounds_of(points: Floats) -> Floats:
    """Return the lows and highs (2, k) of points (n, k)."""
    return np.array([points.min(axis=0), points.max(axis=0)])


def find_overlaps(
    solids: Sequence[Polyhedron], tolerated: Sequence[float], progress: Tell | None = None
) -> Iterator[Overlap]:
    """Yield pairs of solids that interpenetrate by more than what either tolerates, m.

    What is deeper by half is found for sure. ``progress``: told how far it is.

    Examples
    --------
    >>> from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
    >>> one, other = (
    ...     Polyhedron(tuple((x + at, y, z) for x, y, z in BOX_CORNERS), BOX_FACES)
    ...     for at in (0, 1.8)
    ... )
    >>> [str(found) for found in find_overlaps([one, other], [0.1, 0.1])]
    ['by 200 mm (their bounds by 200 mm along x, 2e+03 mm along y, 2e+03 mm along z)']
    """
    bounds = [bounds_of(solid.points) for solid in solids]
    faces: dict[int, list[_Face]] = {}
    course, done = Progress("looking for overlaps", len(solids), progress), 0
    for i, j in near_pairs(bounds, -min(tolerated, default=0.0)):
        course.add(i - done)
        done = i
        deepest = min(tolerated[i], tolerated[j])
        for k in (i, j):
            faces[k] = faces.get(k) or _faces(solids[k])
        axes = np.array([face.axes[0] for face in (*faces[i], *faces[j])]).T
        heights = _common(*(bounds_of(solids[k].points @ axes) for k in (i, j)))
        if (heights[1] - heights[0]).min() <= deepest:
            continue
        region = _common(bounds[i], bounds[j])
        radius = _ball_in_both((faces[i], faces[j]), region, deepest / 2)
        if radius > deepest / 2:
            x, y, z = (region[1] - region[0]).tolist()
            yield Overlap((i, j), 2 * radius, (x, y, z))


def overlapping(bricks: Sequence[Brick]) -> list[tuple[int, int, float]]:
    """Return the names of bricks that interpenetrate by more than `TOLERATED`, and depths, m.

    The deepest come first. Bricks that are not convex are left out: they take seconds a pair.
    """
    thin = np.array([min(brick.dimensions) for brick in bricks])
    if all(brick.shape is None for brick in bricks):
        pairs, apart = _separations(bricks)
        deep = -apart > TOLERATED * thin[pairs].min(axis=1)
        found = [(i, j, -d) for (i, j), d in zip(pairs[deep], apart[deep].tolist(), strict=True)]
    else:
        solids = {
            i: Polyhedron(as_vectors(points), faces)
            for i, (points, faces) in enumerate(map(vertices_of, bricks))
        }
        convex = [i for i, solid in solids.items() if _is_convex(solid)]
        overlaps = find_overlaps([solids[i] for i in convex], TOLERATED * thin[convex])
        found = [(convex[each.pair[0]], convex[each.pair[1]], each.depth) for each in overlaps]
    found.sort(key=lambda held: -held[2])
    return [(bricks[i].name, bricks[j].name, depth) for i, j, depth in found]


def _is_convex(solid: Polyhedron) -> bool:
    """Return whether no vertex lies before a face, but for what makes faces flat."""
    size = float(np.ptp(solid.points, axis=0).max())
    return all(
        float(((solid.points - face.origin) @ face.axes[0]).max()) <= FLAT * size
        for face in _faces(solid)
    )


def _common(some: Floats, others: Floats) -> Floats:
    """Return the bounds (2, k) of what two bounds share; turned round where they are apart."""
    return np.array([np.maximum(some[0], others[0]), np.minimum(some[1], others[1])])


def _faces(solid: Polyhedron) -> list[_Face]:
    out = []
    for corners in (solid.points[list(face)] for face in solid.faces):
        normal = normal_of(corners)
        if normal.any():
            axes = plane_axes(units(normal))
            flat = (corners - corners[0]) @ axes[1:].T
            step = np.roll(flat, -1, axis=0) - flat
            seen = (bounds_of(corners), bounds_of(corners @ _ACROSS.T))
            out.append(_Face(corners[0], axes, flat, step, *seen))
    return out


def _ball_in_both(pair: Sequence[Sequence[_Face]], region: Floats, least: float) -> float:
    """Return the radius of a largest ball in two solids, m; 0 if none has more than ``least``.

    ``region`` (2, 3): what the bounds of both share.
    """
    wide = region + np.array([[-2.0 * least], [2.0 * least]])
    near = [face for faces in pair for face in faces if _meet(face.bounds, wide)]
    shadow = bounds_of((region[0] + (region[1] - region[0]) * _CORNERS) @ _ACROSS.T)
    passed = [[face for face in faces if _meet(face.shadow, shadow)] for faces in pair]
    centers, half = _grid(region)
    while len(centers):
        reach = _SLACK * least - float(np.linalg.norm(half))  # what a center has at least
        depth = np.full(len(centers), 2 * least)
        for face in near:
            depth = np.minimum(depth, np.linalg.norm(centers - _foot(face, centers), axis=1))
        for faces in ([], *passed):
            depth = np.where(_hold(faces, centers), depth, -depth) if faces else depth
            centers, depth = centers[depth > reach], depth[depth > reach]
        best = np.argsort(-depth)[:_MOST_CELLS]
        deep = best[: np.count_nonzero(depth > 0)]
        for start in centers[deep[:: max(1, len(deep) // _STARTS)]]:
            if (radius := _grown(pair, start)) > least:
                return radius
        centers = (centers[best][:, None] + half * (_CORNERS - 0.5)).reshape(-1, 3)
        half = half / 2
    return 0.0


def _grid(region: Floats) -> tuple[Floats, Floats]:
    """Return the centers (k, 3) of cells of a region, about cubes, and half of their sides (3,)."""
    sides = region[1] - region[0]
    counts = np.ceil(sides / max(sides.min(), sides.max() / _CELLS)).astype(int)
    places = np.array([*product(*map(range, counts.tolist()))])
    return region[0] + (places + 0.5) * sides / counts, 0.5 * sides / counts


def _meet(some: Floats, others: Floats) -> bool:
    return bool((some[0] <= others[1]).all() and (others[0] <= some[1]).all())


def _foot(face: _Face, points: Floats) -> Floats:
    """Return the points (k, 3) of a face that are nearest to others."""
    seen = (points - face.origin) @ face.axes[1:].T
    to, size = seen[:, None] - face.flat, (face.step**2).sum(axis=1)
    share = np.einsum("kmi,mi->km", to, face.step) / np.where(size > 0, size, 1.0)
    rim = face.flat + np.clip(share, 0.0, 1.0)[:, :, None] * face.step
    away = ((seen[:, None] - rim) ** 2).sum(axis=2)
    nearest = rim[np.arange(len(points)), away.argmin(axis=1)]
    spot = np.where(_within(face, seen)[:, None], seen, nearest)
    return np.asarray(face.origin + spot @ face.axes[1:])


def _within(face: _Face, seen: Floats) -> Bools:
    """Return which points (k, 2) of a face's plane lie in it."""
    to = seen[:, None] - face.flat
    crosses = (to[:, :, 1] < 0) != (to[:, :, 1] < face.step[:, 1])
    turn = to[:, :, 0] * face.step[:, 1] - to[:, :, 1] * face.step[:, 0]
    return np.asarray((crosses & (turn * np.sign(face.step[:, 1]) < 0)).sum(axis=1) % 2 == 1)


def _hold(faces: Sequence[_Face], points: Floats) -> Bools:
    """Return which points (k, 3) lie inside: a ray from there passes an odd number of faces."""
    odd = np.zeros(len(points), dtype=bool)
    for face in faces:
        slope = float(face.axes[0] @ _RAY)
        if slope != 0:
            ahead = ((face.origin - points) @ face.axes[0]) / slope
            met = points + ahead[:, None] * _RAY - face.origin
            odd ^= (ahead > 0) & _within(face, met @ face.axes[1:].T)
    return odd


def _grown(pair: Sequence[Sequence[_Face]], center: Floats) -> float:
    """Return the radius of a ball in two solids that is moved and grown until it is stuck.

    Each program grows it between planes through its nearest points of all faces.
    """
    from scipy.optimize import linprog  # noqa: PLC0415  # for solids that overlap only

    radius = 0.0
    while True:
        feet = np.vstack([_foot(face, center[None]) for faces in pair for face in faces])
        away = np.linalg.norm(center - feet, axis=1)
        inside = all(_hold(faces, center[None])[0] for faces in pair)
        if not inside or not away.min() > radius * (1 + _STUCK):
            return radius
        radius = float(away.min())
        rows = np.column_stack([(feet - center) / away[:, None], np.ones(len(away))])
        found = linprog([0, 0, 0, -1], rows, away, bounds=[(None, None)] * 3 + [(0, None)])
        if found.status:
            return radius
        center = center + found.x[:3]
