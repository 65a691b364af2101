"""Where the blocks of a file touch each other and the ground: its own faces, or those found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Vector
from seqopt.errors import SceneError
from seqopt.scene.boxes import as_vectors
from seqopt.scene.checks import positive, short
from seqopt.scene.imports.content import Content, FileJoint, Given
from seqopt.scene.imports.detection import (
    OPPOSED,
    Surface,
    convex_pieces,
    require_polygons,
    touching_faces,
)
from seqopt.scene.imports.repair import Repaired
from seqopt.scene.library.common import JointLaw
from seqopt.scene.parts import Brick, Ground, Joint
from seqopt.scene.shape import Polyhedron, normal_of

_STUB = 0.05  # m; from a face on the ground to the fixed point behind it


@dataclass(frozen=True, eq=False, repr=False)
class _FlatFace(FrozenValue):
    """A convex face in its own plane.

    ``center`` (3,): centroid, m; ``axes`` (3, 3): rows are unit vectors: the normal, and the two
    principal axes of the area; ``corners`` (m, 2): from the centroid along the principal axes,
    counterclockwise, m; ``area``: m²; ``moments``: second moments of area about the principal axes,
    m⁴.
    """

    center: Floats
    axes: Floats
    corners: Floats
    area: float
    moments: tuple[float, float]


def flat_face(corners: Floats, normal: Floats | None = None) -> _FlatFace:
    """Return a face in its own plane.

    ``corners`` (m, 3): once around, m; what leaves their plane is projected onto it. ``normal``
    (3,): to which side the normal points; counterclockwise corners by default. Raises `SceneError`
    if it has no area, or crosses itself so much that it is none.

    Examples
    --------
    >>> face = flat_face(np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]))
    >>> face.area, face.axes[0].tolist(), [round(m, 4) for m in face.moments]
    (2.0, [0.0, 0.0, 1.0], [0.1667, 0.6667])
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
    area, shift, spread = _moments(flat)
    turned = _principal(spread)
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
    """Return the joint of two bricks over a face.

    ``bricks``: names; the face's normal points from the first into the second.
    """
    shift, turn = law.stiffness(face.area, face.moments)
    position, along, across = as_vectors(np.vstack([face.center, face.axes[:2]]))
    return Joint(
        bricks=bricks,
        position=position,
        along=along,
        across=across,
        translational_stiffness=shift,
        rotational_stiffness=turn,
        face=_pairs(face.corners),
    )


def face_ground(brick: int, face: _FlatFace, law: JointLaw, stub: float = _STUB) -> Ground:
    """Return the ground end of a brick over a face.

    ``brick``: name; the face's normal points into it. ``stub``: from the face to the fixed point
    behind it, m.
    """
    shift, turn = law.stiffness(face.area, face.moments)
    position, along, across = as_vectors(np.vstack([face.center, face.axes[:2]]))
    anchor: Vector = as_vectors((face.center - stub * face.axes[0])[None])[0]
    return Ground(
        brick=brick,
        position=position,
        along=along,
        across=across,
        translational_stiffness=shift,
        rotational_stiffness=turn,
        anchor=anchor,
        face=_pairs(face.corners),
    )


def _moments(flat: Floats) -> tuple[float, Floats, Floats]:
    """Return area, centroid (2,), and integrals of squares about it (2, 2) of a polygon (m, 2)."""
    after = np.roll(flat, -1, axis=0)
    turn = flat[:, 0] * after[:, 1] - flat[:, 1] * after[:, 0]
    area = 0.5 * float(turn.sum())
    center = turn @ (flat + after) / (6 * area)
    one, two = flat - center, after - center
    turn = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    both = one + two
    squares = (
        np.einsum("e,ea,eb->ab", turn, one, one)
        + np.einsum("e,ea,eb->ab", turn, two, two)
        + np.einsum("e,ea,eb->ab", turn, both, both)
    ) / 24
    return area, center, squares


def _principal(spread: Floats) -> Floats:
    """Return rotated axes (2, 2), rows, along which integrals of squares are largest and least."""
    first = np.linalg.eigh(spread)[1][:, 1]
    return np.array([first, [-first[1], first[0]]])


def _pairs(corners: Floats) -> tuple[tuple[float, float], ...]:
    return tuple((x, y) for x, y in corners.tolist())


_GAP = 0.05  # between faces that touch, over the thinnest block
_OFF = 0.05  # of a face from a block that it joins, over the size of the block
_ASIDE = 1e-2  # how far beside a face a point is that tells on which side of it a block lies
GROUND = -1
_DOWN = np.array([0.0, 0.0, -1.0])

_Shape = Polyhedron | Surface
_Held = tuple[tuple[int, int], _FlatFace]


@dataclass(frozen=True)
class Contacts:
    """Where blocks touch each other and the ground.

    ``faces`` (int, int): places of the blocks in the file, the ground is -1 and comes first;
    normals point into the second. ``joints``: those without a face. ``said``: where they come from.
    """

    faces: tuple[_Held, ...]
    joints: tuple[FileJoint, ...]
    said: tuple[str, ...]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Which touch each other."""
        return [*(pair for pair, _ in self.faces), *(joint.blocks for joint in self.joints)]


def find_contacts(
    content: Content, given: Given, blocks: Sequence[Repaired], bricks: Mapping[int, Brick]
) -> Contacts:
    """Return where blocks touch each other and the ground.

    ``content``: in m. ``blocks``: all of the file. ``bricks``: those that are built, by their
    places in the file; others are the ground. Raises `FileError` if shapely is not installed;
    `SceneError` if a face of the file does not lie on a block that it joins.
    """
    require_polygons("finding where blocks touch")
    solids, facets = [block.solid for block in blocks], [block.facets for block in blocks]
    thin = min(min(brick.dimensions) for brick in bricks.values())
    gap = _GAP * thin if given.gap is None else positive("gap", given.gap, "m")
    if content.faces and not given.detect:
        off = _off_blocks(content, facets, gap)
        found = [*_file_faces(content, solids)]
        said = [f"faces are those of the file: {len(content.faces)}", *off]
    elif content.joints and all(joint.translational for joint in content.joints):
        found, said = [], ["joints are those of a frame; none has a face"]
    else:
        touching = touching_faces(facets, gap, given.progress)
        found = [(f.blocks, flat_face(f.corners, f.normal)) for f in touching]
        said = [f"faces are found where blocks are no more than {1e3 * gap:.3g} mm apart"]
    faces = [held for pair, face in found for held in _on_ground(pair, face, bricks)]
    known = {frozenset(pair) for pair, _ in faces}
    joints = [joint for joint in content.joints if frozenset(joint.blocks) not in known]
    if joints and found:
        said.append(f"joints of the file between blocks without a face: {len(joints)}")
    everywhere = len(bricks) == len(solids)
    if everywhere and not any(GROUND in joint.blocks for joint in joints):
        faces += _standing(bricks, facets, gap)
        said.append("no supports are named: blocks with a face at the lowest level stand there")
    return Contacts(tuple(faces), tuple(joints), tuple(said))


def _on_ground(pair: tuple[int, int], face: _FlatFace, bricks: Mapping[int, Brick]) -> list[_Held]:
    """Return a face between blocks, supports among them as the ground; none between supports."""
    a, b = (i if i in bricks else GROUND for i in pair)
    if a == b == GROUND:
        return []
    if b == GROUND:
        turned = flat_face(face.center + face.corners @ face.axes[1:], -face.axes[0])
        return [((GROUND, a), turned)]
    return [((a, b), face)]


def _off_blocks(content: Content, facets: Sequence[Surface], gap: float) -> list[str]:
    """Say how far faces of a file lie off the blocks that they join; too far is an error."""
    shapely, farthest = import_module("shapely"), 0.0
    sides = {i: [*_sides(facets[i])] for i in {i for face in content.faces for i in face.blocks}}
    for held in content.faces:
        for i in held.blocks:
            away = np.full(len(held.corners), np.inf)
            for side, polygon in sides[i]:
                seen = (held.corners - side.center) @ side.axes.T
                beside = shapely.distance(polygon, shapely.points(seen[:, 1:]))
                away = np.minimum(away, np.hypot(seen[:, 0], beside))
            off = float(away.max(initial=0.0))
            if off > max(gap, _OFF * float(np.ptp(facets[i].points, axis=0).max())):
                a, b = (content.blocks[k].key for k in held.blocks)
                raise SceneError(
                    f"the face between blocks {a} and {b} lies {off:.3g} m off block "
                    f"{content.blocks[i].key}; look for faces anew (detect), or allow a wider gap"
                )
            farthest = max(farthest, off)
    if farthest <= gap:
        return []
    return [f"faces of the file lie up to {1e3 * farthest:.3g} mm off their blocks"]


def _sides(solid: Surface) -> Iterator[tuple[_FlatFace, Any]]:
    """Yield the sides of a block in their mean planes, and as polygons there."""
    shapely = import_module("shapely")
    for face in solid.faces:
        flat = flat_face(solid.points[list(face)])
        yield flat, shapely.make_valid(shapely.Polygon(flat.corners))


def _file_faces(content: Content, solids: Sequence[_Shape]) -> Iterator[_Held]:
    """Yield the faces of a file, in convex pieces, their normals into the second block."""
    shapely = import_module("shapely")
    for held in content.faces:
        a, b = held.blocks
        if a == b or len(held.corners) < 3:
            continue
        plane = flat_face(held.corners)
        polygon = shapely.make_valid(shapely.Polygon(plane.corners))
        parts = [p for p in getattr(polygon, "geoms", [polygon]) if p.geom_type == "Polygon"]
        for piece in convex_pieces(parts):
            corners = plane.center + piece @ plane.axes[1:]
            yield (a, b), flat_face(corners, _into(corners, plane.axes[0], solids[a], solids[b]))


def _into(corners: Floats, normal: Floats, first: _Shape, second: _Shape) -> Floats:
    """Return the normal of a face that points from the first block into the second."""
    middle = corners.mean(axis=0)
    step = _ASIDE * np.linalg.norm(np.ptp(corners, axis=0)) * normal
    ahead = _holds(second, middle + step) + _holds(first, middle - step)
    behind = _holds(second, middle - step) + _holds(first, middle + step)
    if ahead == behind:  # a thin block, or one that is not where its face is
        toward = second.points.mean(axis=0) - first.points.mean(axis=0)
        return normal if toward @ normal >= 0 else -normal
    return normal if ahead > behind else -normal


def _holds(solid: _Shape, point: Floats) -> bool:
    return isinstance(solid, Polyhedron) and solid.contains(point)


def _standing(bricks: Mapping[int, Brick], solids: Sequence[_Shape], gap: float) -> Iterator[_Held]:
    """Yield the faces of blocks at the lowest level, their normals into the blocks."""
    level = min(float(solids[i].points[:, 2].min()) for i in bricks)
    shapely = import_module("shapely")
    for i in bricks:
        low = []
        for face in solids[i].faces:
            corners = solids[i].points[list(face)]
            flat = flat_face(corners)
            if flat.axes[0] @ _DOWN > OPPOSED and corners[:, 2].max() <= level + gap:
                low.append(shapely.Polygon(corners[:, :2]))
        for piece in convex_pieces(low) if low else ():
            height = np.full((len(piece), 1), level)
            yield (GROUND, i), flat_face(np.hstack([piece, height]), -_DOWN)
