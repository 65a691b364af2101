"""Where the blocks of a file touch each other and the ground.

Polygons are shapely's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from seqopt._registry import Later
from seqopt.arrays import Floats, FrozenValue
from seqopt.errors import FileError, SceneError
from seqopt.exchange._content import GROUND, Given
from seqopt.exchange._doubts import _bounds_of, _near_pairs, plane_axes
from seqopt.exchange._meshes import Repaired, Surface
from seqopt.responses.quantities import length_text
from seqopt.scene._checks import as_vector, positive, short, units
from seqopt.scene.boxes import TOLERATED, _spring_fields
from seqopt.scene.library.common import DOWN, JointLaw
from seqopt.scene.parts import Brick, Ground, Joint
from seqopt.scene.shape import Polyhedron, normal_of, polygon_moments
from seqopt.work import Progress, Tell

SHAPELY = Later("shapely")  # an extra
_Shape = Polyhedron | Surface
_THIN_PIECE = 1e-6  # by which the hull of what is convex may be larger, over its area
_GRAIN = 1e-9  # length to which corners are rounded, over the size of what overlaps


def _convex_pieces(polygons: Sequence[Any]) -> Iterator[Floats]:
    """Yield the convex pieces of a union of polygons: corners (m, 2), counterclockwise, m."""
    size = max((max(abs(x) for x in polygon.bounds) for polygon in polygons), default=1.0)
    grain = _GRAIN * size
    try:
        whole = SHAPELY.unary_union(list(polygons), grid_size=grain).simplify(grain)
        for part in _polygons(whole):
            if part.is_empty:
                continue
            if _is_convex(part):
                yield _corners(part)
                continue
            triangles = [*SHAPELY.constrained_delaunay_triangles(part).geoms]
            yield from map(_corners, _merged(triangles, grain))
    except SHAPELY.errors.ShapelyError as error:  # they are too degenerate
        raise SceneError(f"a face where blocks touch cannot be cut: {short(error, 80)}") from error


def _polygons(shape: Any) -> list[Any]:
    """Return the polygons that a shape consists of, among points and lines perhaps."""
    return [part for part in getattr(shape, "geoms", [shape]) if part.geom_type == "Polygon"]


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
    hull = SHAPELY.geometry.polygon.orient(polygon.convex_hull)
    return np.array(hull.exterior.coords)[:-1]


_OPPOSED = np.cos(np.radians(15.0))  # cosine from which on normals are against each other
_LEVEL = 1 - 1e-6  # cosine from which on faces are in one plane
_MOST_PAIRS = 300_000  # of blocks that are near each other
_SLIVER = 1e-6  # overlap treated as zero, over the smaller of two faces

_Plane = tuple[Floats, Floats, list[Any]]  # origin, axes, and polygons in it
_Facets = tuple[list[Floats], Floats, Floats]  # corners of faces, normals outward, and middles


def touching_faces(
    shapes: Sequence[_Shape], gap: float, progress: Tell | None = None
) -> tuple[_Held, ...]:
    """Return pairs of places of blocks that touch, and the face over which they do, in their order.

    Two blocks touch where a face of one lies on a face of the other: normals against each other,
    and no more than a gap between the planes anywhere in the overlap. What overlaps in one plane is
    united and cut into convex pieces, each a face of its own, halfway between the two; its normal
    points from the first block into the second.

    ``shapes``: where they are in the scene; ``gap``: most that may lie between two faces, or by
    which they may interpenetrate, m; ``progress``: called with how far it is, once it takes longer
    than a second. Raises `FileError` if shapely is not installed.
    """
    if find_spec("shapely") is None:
        raise FileError("finding where blocks touch needs shapely; pip install 'seqopt[blocks]'")
    gap = positive("gap", gap, "m")
    facets = list[_Facets]()
    for shape in shapes:
        if not hasattr(shape, "points") or not hasattr(shape, "faces"):
            raise SceneError(f"shapes: {short(shape)} is not a shape; give each as Polyhedron(...)")
        corners = [shape.points[list(face)] for face in shape.faces]
        normals = units(np.array([normal_of(face) for face in corners]))
        facets.append((corners, normals, np.array([face.mean(axis=0) for face in corners])))
    course, done = Progress("finding faces", len(shapes), progress), 0
    out = list[_Held]()
    near = _near_pairs([_bounds_of(shape.points) for shape in shapes], gap)
    for tries, (i, j) in enumerate(near):
        course.add(i - done)
        done = i
        if tries == _MOST_PAIRS:
            raise SceneError(f"more than {_MOST_PAIRS} pairs of blocks are in one place; part them")
        for origin, axes, polygons in _overlaps(facets[i], facets[j], gap):
            for piece in _convex_pieces(polygons):
                out.append(((i, j), flat_face(origin + piece @ axes[1:], axes[0])))
    return tuple(out)


def _overlaps(first: _Facets, second: _Facets, gap: float) -> list[_Plane]:
    """Return the planes in which faces of two blocks overlap, with the overlaps."""
    (corners, normals, middles), (others, against, ends) = first, second
    planes: list[_Plane] = []
    step = ends[None] - middles[:, None]
    apart = np.abs(np.einsum("kmi,ki->km", step, normals))
    near = apart <= gap + (1 - _OPPOSED**2) ** 0.5 * np.linalg.norm(step, axis=2)
    for k, m in np.argwhere((normals @ against.T < -_OPPOSED) & near):
        normal = normals[k] - against[m]
        normal /= np.linalg.norm(normal)
        middle = 0.5 * (middles[k] + ends[m])
        same = (
            each
            for each in planes
            if normal @ each[1][0] > _LEVEL and abs((middle - each[0]) @ each[1][0]) <= 0.5 * gap
        )
        plane: _Plane = next(same, (middle, plane_axes(normal), []))
        overlap = _overlap(corners[k], others[m], plane[:2], gap)
        planes += [plane] if overlap and not plane[2] else []
        plane[2].extend(overlap)
    return planes


def _overlap(first: Floats, second: Floats, plane: tuple[Floats, Floats], gap: float) -> list[Any]:
    """Return the overlap of two faces (m, 3), seen along a normal, if they are near all over it."""
    origin, axes = plane
    seen = [(face - origin) @ axes.T for face in (first, second)]
    one, other = (SHAPELY.make_valid(SHAPELY.Polygon(face[:, 1:])) for face in seen)
    common = one.intersection(other)
    if not common.area > _SLIVER * min(one.area, other.area):
        return []
    points = SHAPELY.get_coordinates(common)
    heights = []  # of each face's plane, over the points
    for face in seen:
        normal, middle = normal_of(face), face.mean(axis=0)
        heights.append(middle[0] - (points - middle[1:]) @ normal[1:] / normal[0])
    if np.abs(heights[1] - heights[0]).max() > gap:
        return []
    return _polygons(common)


_STUB = 0.05  # m; from a face on the ground to the fixed point behind it


@dataclass(frozen=True, eq=False, repr=False)
class _FlatFace(FrozenValue):
    """A convex face in its own plane: m, m², m⁴.

    ``axes`` (3, 3): rows are the normal and the principal axes of the area; ``corners`` (m, 2):
    from the centroid along these, counterclockwise; ``moments``: about these.
    """

    center: Floats
    axes: Floats
    corners: Floats
    area: float
    moments: tuple[float, float]


def flat_face(corners: Floats, normal: Floats | None = None) -> _FlatFace:
    """Return a face (m, 3) in its mean plane; ``normal``: to which side it looks.

    Corners are counterclockwise by default. Raises `SceneError` if it has no area, or crosses
    itself.
    """
    corners = np.asarray(corners, dtype=float).reshape(-1, 3)
    across = normal_of(corners) if len(corners) > 2 else np.zeros(3)
    size = float(np.linalg.norm(across))
    if not size > 0:
        raise SceneError(f"a face has no area; its corners are {short(corners.tolist())}")
    across = across / size
    if normal is not None and across @ normal < 0:
        across, corners = -across, corners[::-1]
    sides = np.linalg.svd(across[None])[2][1:]
    sides[1] = np.cross(across, sides[0])
    middle = corners.mean(axis=0)
    flat = (corners - middle) @ sides.T
    area, shift, spread = polygon_moments(flat)
    first = np.linalg.eigh(spread)[1][:, 1]
    turned = np.array([first, [-first[1], first[0]]])  # axes of the largest and least moment
    if not np.linalg.det(spread) > 0:
        raise SceneError(f"a face crosses itself; its corners are {short(corners.tolist())}")
    sides = turned @ sides
    return _FlatFace(
        center=np.asarray(middle + (turned @ shift) @ sides),
        axes=np.vstack([across, sides]),
        corners=np.asarray((flat - shift) @ turned.T),
        area=area,
        moments=(float(turned[1] @ spread @ turned[1]), float(turned[0] @ spread @ turned[0])),
    )


def face_joint(bricks: tuple[int, int], face: _FlatFace, law: JointLaw) -> Joint:
    """Return the joint of two bricks over a face whose normal points into the second."""
    return Joint(bricks=bricks, **_fields(face, law))


def face_ground(brick: int, face: _FlatFace, law: JointLaw, stub: float = _STUB) -> Ground:
    """Return the ground end of a brick over a face whose normal points into it; ``stub`` in m."""
    anchor = as_vector(face.center - stub * face.axes[0])
    return Ground(brick=brick, anchor=anchor, **_fields(face, law))


def _fields(face: _FlatFace, law: JointLaw) -> dict[str, Any]:
    """Return what a joint and a ground end over a face have in common."""
    stiffness = law.stiffness(face.area, face.moments)
    fields = _spring_fields(face.center, face.axes[0], face.axes[1], stiffness)
    return {**fields, "face": tuple((x, y) for x, y in face.corners.tolist())}


_Held = tuple[tuple[int, int], _FlatFace]


def _find_contacts(
    given: Given, blocks: Sequence[Repaired], bricks: Mapping[int, Brick]
) -> tuple[list[_Held], list[str]]:
    """Return faces where blocks touch, their normals into the second; and how they were found.

    Places are those of the file; the ground, which blocks not built belong to, comes first.
    """
    facets, gap = [block.facets for block in blocks], _widest_gap(given, bricks)
    thinnest = min(min(brick.dimensions) for brick in bricks.values())
    odd = f", more than the thinnest block: {length_text(thinnest)}" * (gap > thinnest)
    near = length_text(float(f"{gap:.3g}"))
    lines = [f"faces are found where blocks are no more than {near} apart{odd}"]
    faces = list[_Held]()
    for pair, face in touching_faces(facets, gap, given.progress):
        a, b = (i if i in bricks else GROUND for i in pair)
        if b == GROUND != a:
            turned = flat_face(face.center + face.corners @ face.axes[1:], -face.axes[0])
            faces.append(((GROUND, a), turned))
        elif b != GROUND:
            faces.append(((a, b), face))
    if len(bricks) == len(blocks):
        faces += _standing(bricks, facets, gap)
        lines.append("no supports are named: blocks with a face at the lowest level stand there")
    return faces, lines


def _widest_gap(given: Given, bricks: Mapping[int, Brick]) -> float:
    """Return the most that may lie between faces that touch, m."""
    thinnest = min(min(brick.dimensions) for brick in bricks.values())
    return TOLERATED * thinnest if given.gap is None else positive("gap", given.gap, "m")


def _standing(bricks: Mapping[int, Brick], solids: Sequence[_Shape], gap: float) -> Iterator[_Held]:
    """Yield the faces of blocks at the lowest level, their normals into the blocks."""
    level = min(float(solids[i].points[:, 2].min()) for i in bricks)
    for i in bricks:
        low = []
        for face in solids[i].faces:
            corners = solids[i].points[list(face)]
            flat = flat_face(corners)
            if flat.axes[0] @ DOWN > _OPPOSED and corners[:, 2].max() <= level + gap:
                low.append(SHAPELY.Polygon(corners[:, :2]))
        for piece in _convex_pieces(low) if low else ():
            height = np.full((len(piece), 1), level)
            yield (GROUND, i), flat_face(np.hstack([piece, height]), -DOWN)
