"""What is possible in a scene but probably wrong, as mixed-up units or solids in one place.

The depth of two solids, of any shape, is the diameter of the largest ball in both. They are apart
if a plane parallel to a face of either passes between them, or if they do not meet once both are
eroded, all of their faces moved inward, so that what only touches parts. A ball is grown from where
they meet.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from seqopt._registry import Later
from seqopt.arrays import Bools, Floats, FrozenValue
from seqopt.scene._checks import frames, units
from seqopt.scene.parts import Ground, Joint, Sphere
from seqopt.scene.scene import Scene, _hang_free
from seqopt.scene.scene_file import _find_overlapping
from seqopt.scene.shape import Polyhedron, _surround, fans, normal_of
from seqopt.work import Progress, Tell

networkx, optimize = Later("networkx"), Later("scipy.optimize")  # slow to import
_FAR_AWAY = 1.0  # of a joint from a brick, over the brick's largest dimension
_THICK_BRICK = 5.0  # m; the smallest dimension of a brick whose lengths may be meant in mm
_DENSITIES = (10.0, 30_000.0)  # kg/m³; from aerogel to the heaviest metals
_TINY_BRICK = 0.002  # m; the largest dimension of a brick whose lengths were meant in m
_FAR_REACH = 100.0  # m; of a robot, and of the base of its arm
_LONG_TOOL, _LONG = 10.0, 500.0  # m; of an arm, and of the whole structure
_GALE = 5.0  # wind over weight
_BELOW = 0.25  # of the smallest dimension; by less a wedge may hang below what bears its sides
_PULL = 100.0  # m/s²; ten times that of the earth


def _find_odd_units(scene: Scene) -> Iterator[str]:
    """Yield a line on gravity, lengths and densities that seem to be in other units."""
    at, down = np.array([brick.position for brick in scene.bricks]), np.array(scene.gravity)
    if (pull := math.hypot(*down)) > _PULL:
        yield f"gravity is {pull:g} m/s²: give it in meters, if it is meant in millimeters"
    room = _BELOW * pull * min(min(brick.dimensions) for brick in scene.bricks)
    if max(np.dot(end.position, down) for end in scene.grounds) < (at @ down).min() - room:
        yield "gravity points away from every ground end; check its sign"
    if (length := np.ptp(at, axis=0).max()) > _LONG:
        yield f"it is {length:.4g} m long, which looks like millimeters; give meters"
    if (wind := max(map(abs, scene.wind))) > _GALE:
        yield f"wind is {wind:g} times the weight; give a share of the weight, as 0.1"
    large = [brick for brick in scene.bricks if min(brick.dimensions) > _THICK_BRICK]
    tiny = [brick for brick in scene.bricks if max(brick.dimensions) < _TINY_BRICK]
    odd = [brick for brick in scene.bricks if not _DENSITIES[0] <= brick.density <= _DENSITIES[1]]
    for found, text in (
        (large, "dimensions of {1} m look like millimeters; give meters"),
        (tiny, "dimensions of {1} m are tiny; check their unit"),
        (odd, "a density of {0.density:g} kg/m³ is odd; check its unit"),
    ):
        if found:
            more = f" and {len(found) - 1} more" if len(found) > 1 else ""
            sizes = tuple(float(f"{size:.6g}") for size in found[0].dimensions)
            yield f"brick {found[0].name}{more}: {text.format(found[0], sizes)}"
    far = {what: (label, length) for label, what, length, most in _lengths(scene) if length > most}
    for what, (label, length) in far.items():
        yield f"{label}: {what} of {length:g} m looks like millimeters; give meters"
    moved = [end for end in scene.grounds if end.movement and max(map(abs, end.movement)) > 1]
    for end in moved[:1]:
        yield f"{end.label}: a movement of {max(map(abs, end.movement or ())):g} is m or rad"


def _lengths(scene: Scene) -> Iterator[tuple[str, str, float, float]]:
    """Yield lengths, m, that may be meant in millimeters: whose, of what, and the usual most."""
    for robot in reversed(scene.robots):
        if isinstance(robot.reach, Sphere):
            yield robot.name, "a reach", robot.reach.radius, _FAR_REACH
        if robot.arm is not None:
            yield robot.name, "a tool_length", robot.arm.tool_length, _LONG_TOOL
            yield robot.name, "a position of its arm", math.hypot(*robot.arm.position), _FAR_REACH
    large = {brick.name: max(brick.dimensions) for brick in scene.bricks}
    springs: tuple[Joint | Ground, ...] = (*reversed(scene.joints), *scene.grounds)
    for spring in springs:
        most = min(large[end] for end in spring.ends)
        yield spring.label, "a thickness", spring.thickness or 0.0, most


def find_doubts(scene: Scene, *, made: bool = False) -> Iterator[str]:
    """Yield what looks wrong in a scene, one line each; most scenes have none.

    ``made``: whether it was made of words, so that only its units can be wrong.
    """
    yield from _find_odd_units(scene)
    if made:
        return
    yield from _find_overlapping(scene, across_joints=True)
    ties = networkx.Graph(
        [joint.bricks for joint in scene.joints if any(joint.translational_stiffness)]
    )
    ties.add_edges_from(
        ("ground", end.brick) for end in scene.grounds if any(end.translational_stiffness)
    )
    tied = networkx.node_connected_component(ties, "ground") if "ground" in ties else ()
    if free := [brick.name for brick in scene.bricks if brick.name not in tied]:
        yield f"{_hang_free(free)}; tie it"
    bricks = {brick.name: brick for brick in scene.bricks}
    springs: tuple[Joint | Ground, ...] = (*scene.joints, *scene.grounds)
    placed = [(spring.label, spring.position, end) for spring in springs for end in spring.ends]
    placed += [(load.label, load.position, load.brick) for load in scene.loads if load.position]
    for label, position, end in placed:
        at = np.abs(bricks[end].frame @ np.subtract(position, bricks[end].position))
        away = np.linalg.norm(np.maximum(at - 0.5 * np.array(bricks[end].dimensions), 0.0))
        if away > _FAR_AWAY * max(bricks[end].dimensions):
            yield f"{label}: it lies {away:.4g} m from brick {end}"


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


def find_overlaps(
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


def plane_axes(normal: Floats) -> Floats:
    """Return a right-handed frame (3, 3) whose first row is a unit normal."""
    side = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
    return frames(normal, side / np.linalg.norm(side))


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
