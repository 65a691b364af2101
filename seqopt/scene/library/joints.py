"""Joints where the faces of bricks meet, ground ends under them, and how stiff both are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, Ints, Vector
from seqopt.errors import SceneError
from seqopt.scene.boxes import Boxes, boxes
from seqopt.scene.checks import vector
from seqopt.scene.library.contact_area import ContactAreas, contact_areas
from seqopt.scene.parts import THICKEST, Brick, Ground, Joint

STUB = 0.05  # m; of a ground end that does not say


@dataclass(frozen=True, kw_only=True)
class JointLaw:
    """How stiff a joint is, by the area where its faces meet.

    Parameters
    ----------
    translational : Vector
        Along the joint's normal and across it twice, N/m per m².
    rotational : Vector, optional
        About the same axes, N m/rad per m². By default what a bed of the translational stiffness
        over the face resists: it grows with the face's second moments of area.

    Raises
    ------
    SceneError
        If a number is not finite or negative.

    Examples
    --------
    >>> law = JointLaw(translational=(1.5e9, 1.5e8, 1.5e8))
    >>> [f"{k:.4g}" for k in law.stiffness(0.02, (2e-5, 7e-5))[0]]
    ['3e+07', '3e+06', '3e+06']
    """

    translational: Vector
    rotational: Vector | None = None

    def __post_init__(self) -> None:
        for name in ("translational", "rotational"):
            if (values := getattr(self, name)) is not None:
                checked = vector(f"joint law: {name}", values, at_least=0.0)
                object.__setattr__(self, name, checked)

    def stiffness(self, area: float, moments: tuple[float, float]) -> tuple[Vector, Vector]:
        """Return the stiffness of a joint over a face.

        Parameters
        ----------
        area : float
            m².
        moments : tuple of 2 float
            Second moments of area about the two axes across the normal, m⁴.

        Returns
        -------
        translational, rotational : Vector
            N/m and N m/rad.
        """
        normal, one, other = self.translational
        first, second = moments
        turning = (one * first + other * second, normal * first, normal * second)
        if self.rotational is not None:
            turn, bend, tilt = self.rotational
            turning = (area * turn, area * bend, area * tilt)
        return (area * normal, area * one, area * other), turning


MASONRY = JointLaw(
    translational=(1.5e9, 1.5e8, 1.5e8)
)  # of the domes that Bruun et al. built later


@dataclass(frozen=True)
class _Faces:
    """The faces (P) of boxes that look at others: which axis, and its direction outward."""

    which: Ints
    axis: Ints
    out: Floats


def joints_between(
    bricks: Sequence[Brick], pairs: Sequence[tuple[int, int]], law: JointLaw
) -> tuple[Joint, ...]:
    """Return the joints of bricks, each where the faces that look at each other overlap.

    Parameters
    ----------
    bricks : sequence of Brick
    pairs : sequence of (int, int)
        Which of them touch.
    law : JointLaw

    Returns
    -------
    tuple of Joint
        Each in the middle of the overlap and halfway between the faces; its axes are the mean
        normal of the faces, from the first brick to the second, and that edge of the first that is
        most nearly at right angles to it. One that is thick where the faces are farthest apart says
        so.

    Raises
    ------
    SceneError
        If faces do not overlap where they look at each other.
    """
    if not pairs:
        return ()
    shapes, (a, b) = boxes(bricks), np.array(pairs, dtype=np.int64).T
    one, other = _facing(shapes, a, b)
    along = _unit(one.out - other.out)
    across = shapes.frame[a, (one.axis + 1) % 3]
    across = _unit(across - along * (along * across).sum(axis=1, keepdims=True))
    sides = np.stack([across, np.cross(along, across)], axis=1)
    faces = contact_areas(_corners(shapes, one, sides), _corners(shapes, other, sides))
    apart = np.flatnonzero(faces.area == 0)
    if len(apart):
        i, j = pairs[apart[0]]
        raise SceneError(
            f"joint ({bricks[i].name}, {bricks[j].name}): the faces of its bricks do not overlap; "
            "move the bricks to each other"
        )
    middle = (faces.centroid[:, None, :] @ sides)[:, 0]
    start, end = _height(shapes, one, along, middle), _height(shapes, other, along, middle)
    place = middle + 0.5 * (start + end)[:, None] * along
    thin = 2 * np.minimum(shapes.half[a].min(axis=1), shapes.half[b].min(axis=1))
    widest = end - start + _taper(one, other, along, sides, faces)
    thick = np.where(widest > THICKEST * thin, widest, 0.0).tolist()
    stiff = [
        law.stiffness(area, (about, across))
        for area, (about, across) in zip(faces.area.tolist(), faces.moments.tolist(), strict=True)
    ]
    rows = zip(pairs, place, along, across, stiff, thick, strict=True)
    return tuple(
        Joint(
            bricks=(bricks[i].name, bricks[j].name),
            position=as_vector(at),
            along=as_vector(normal),
            across=as_vector(side),
            translational_stiffness=shift,
            rotational_stiffness=turn,
            thickness=width or None,
        )
        for (i, j), at, normal, side, (shift, turn), width in rows
    )


def ground_under(brick: Brick, down: Floats, law: JointLaw, stub: float = STUB) -> Ground:
    """Return the ground end on the face of a brick that looks down most.

    Parameters
    ----------
    brick : Brick
    down : (3,) float
        Direction to the ground.
    law : JointLaw
    stub : float, optional
        Distance from the face to the fixed point behind it, m.

    Returns
    -------
    Ground
        In the middle of the face; its normal points into the brick.
    """
    shapes = boxes([brick])
    frame, half = shapes.frame[0], shapes.half[0]
    i = int(np.abs(frame @ down).argmax())
    out = np.sign(frame[i] @ down) * frame[i]
    place = shapes.place[0] + half[i] * out
    wide, deep = 2 * float(half[(i + 1) % 3]), 2 * float(half[(i + 2) % 3])
    area = wide * deep
    shift, turn = law.stiffness(area, (area * deep**2 / 12, area * wide**2 / 12))
    return Ground(
        brick=brick.name,
        position=as_vector(place),
        along=as_vector(-out),
        across=as_vector(frame[(i + 1) % 3]),
        translational_stiffness=shift,
        rotational_stiffness=turn,
        anchor=as_vector(place + stub * out),
    )


def as_vector(values: Floats) -> Vector:
    """Return three numbers of an array as a tuple.

    Parameters
    ----------
    values : (3,) float

    Returns
    -------
    Vector
    """
    x, y, z = values.tolist()
    return x, y, z


def _facing(shapes: Boxes, a: Ints, b: Ints) -> tuple[_Faces, _Faces]:
    """Return the faces of first and second boxes that look at each other.

    Of the three faces of the first that look at the second, each with the one of the second that is
    most nearly parallel to it, it is those beyond which the other box lies farthest, in its size.
    """
    step = shapes.place[b] - shapes.place[a]
    turned = shapes.frame[a] @ shapes.frame[b].transpose(0, 2, 1)
    partner = np.abs(turned).argmax(axis=2)
    first = _beyond(shapes, a, b)
    second = np.take_along_axis(_beyond(shapes, b, a), partner, axis=1)
    axis = (first + second).argmax(axis=1)
    row = np.arange(len(a))
    return (
        _towards(shapes, a, axis, step),
        _towards(shapes, b, partner[row, axis], -step),
    )


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


def _taper(one: _Faces, other: _Faces, along: Floats, sides: Floats, faces: ContactAreas) -> Floats:
    """Return how much wider joints are at their ends than in the middle, (P,), at most."""
    slopes = [
        (sides @ face.out[:, :, None])[:, :, 0] / (along * face.out).sum(axis=1)[:, None]
        for face in (one, other)
    ]
    reach = np.sqrt(3 * faces.moments[:, ::-1] / faces.area[:, None])  # of a rectangle
    return np.asarray((np.abs(slopes[1] - slopes[0]) * reach).sum(axis=1))


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
