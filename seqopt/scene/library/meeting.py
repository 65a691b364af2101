"""Where bricks look at each other: their faces, how these overlap, and what lies between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.scene.boxes import Boxes, boxes
from seqopt.scene.library.contact_area import ContactAreas, contact_areas
from seqopt.scene.parts import Brick

Pairs = Sequence[tuple[int, int]]


@dataclass(frozen=True, eq=False, repr=False)
class Faces(FrozenValue):
    """The faces of boxes that look at others.

    Attributes
    ----------
    which, axis : (P,) int
        Box, and the axis across its face.
    out : (P, 3) float
        Unit vectors outward.
    """

    which: Ints
    axis: Ints
    out: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Meeting(FrozenValue):
    """Where pairs of boxes look at each other.

    Attributes
    ----------
    faces : tuple of 2 Faces
        Of the first boxes and of the second.
    along : (P, 3) float
        Mean normals, from the first box to the second.
    sides : (P, 2, 3) float
        Unit vectors across them; the first is most nearly an edge of the first box.
    shared : ContactAreas
        Overlaps of the faces, seen along the normals.
    """

    faces: tuple[Faces, Faces]
    along: Floats
    sides: Floats
    shared: ContactAreas


def meeting(shapes: Boxes, pairs: Pairs, normals: Floats | None = None) -> Meeting:
    """Return where boxes look at each other.

    Parameters
    ----------
    shapes : Boxes
    pairs : sequence of (int, int)
        At least one.
    normals : (P, 3) float, optional
        About at right angles to the faces; by default these are the ones that look at each other
        most.
    """
    a, b = np.array(pairs, dtype=np.int64).T
    step = shapes.place[b] - shapes.place[a]
    axes = _facing(shapes, a, b) if normals is None else _across(shapes, a, b, normals)
    one, other = _towards(shapes, a, axes[0], step), _towards(shapes, b, axes[1], -step)
    along = _unit(one.out - other.out)
    across = shapes.frame[a, (one.axis + 1) % 3]
    across = _unit(across - along * (along * across).sum(axis=1, keepdims=True))
    sides = np.stack([across, np.cross(along, across)], axis=1)
    shared = contact_areas(_corners(shapes, one, sides), _corners(shapes, other, sides))
    return Meeting((one, other), along, sides, shared)


def shares(bricks: Sequence[Brick], pairs: Pairs, normals: Floats) -> Floats:
    """Return how much of the smaller of two faces the other one covers.

    Parameters
    ----------
    bricks : sequence of Brick
    pairs : sequence of (int, int)
        Which of them may touch.
    normals : (P, 3) float
        About at right angles to the faces.

    Returns
    -------
    (P,) float
        From 0 to 1.
    """
    if not pairs:
        return np.zeros(0)
    shapes = boxes(bricks)
    found = meeting(shapes, pairs, normals)
    row = np.arange(len(pairs))
    whole = [
        4 * half[row, (face.axis + 1) % 3] * half[row, (face.axis + 2) % 3]
        for face in found.faces
        for half in (shapes.half[face.which],)
    ]
    return np.asarray(found.shared.area / np.minimum(*whole))


def widths(shapes: Boxes, found: Meeting) -> tuple[Floats, Floats, Floats]:
    """Return where faces are along the normals, in the middle of their overlaps.

    Returns
    -------
    start, end : (P,) float
        Of the first faces and of the second, m from the origin's plane.
    taper : (P,) float
        How much farther apart they are at the ends of the overlap, m, at most.
    """
    middle = (found.shared.centroid[:, None, :] @ found.sides)[:, 0]
    start, end = (_height(shapes, face, found.along, middle) for face in found.faces)
    slopes = [
        (found.sides @ face.out[:, :, None])[..., 0] / (found.along * face.out).sum(axis=1)[:, None]
        for face in found.faces
    ]
    area = np.maximum(found.shared.area, np.finfo(float).tiny)[:, None]
    reach = np.sqrt(3 * found.shared.moments[:, ::-1] / area)  # half the sides of a rectangle
    return start, end, np.asarray((np.abs(slopes[1] - slopes[0]) * reach).sum(axis=1))


def _across(shapes: Boxes, a: Ints, b: Ints, normals: Floats) -> tuple[Ints, Ints]:
    """Return the axes of first and second boxes that are most nearly along given directions."""
    one, other = (np.abs(shapes.frame[i] @ normals[:, :, None])[..., 0] for i in (a, b))
    return one.argmax(axis=1), other.argmax(axis=1)


def _facing(shapes: Boxes, a: Ints, b: Ints) -> tuple[Ints, Ints]:
    """Return the axes across the faces of first and second boxes that look at each other.

    Of the three faces of the first that look at the second, each with the one of the second that is
    most nearly parallel to it, it is those beyond which the other box lies farthest, in its size.
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


def _towards(shapes: Boxes, which: Ints, axis: Ints, step: Floats) -> Faces:
    """Return the faces across some axes that look along steps (P, 3)."""
    normal = shapes.frame[which, axis]
    return Faces(which, axis, np.sign((normal * step).sum(axis=1))[:, None] * normal)


def _corners(shapes: Boxes, face: Faces, sides: Floats) -> Floats:
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


def _height(shapes: Boxes, face: Faces, along: Floats, point: Floats) -> Floats:
    """Return how far along directions (P, 3) from points (P, 3) faces lie, (P,)."""
    half = shapes.half[face.which, face.axis]
    away = ((shapes.place[face.which] - point) * face.out).sum(axis=1) + half
    return np.asarray(away / (along * face.out).sum(axis=1))


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
