"""Joints where the faces of bricks meet, and ground ends under them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Floats, Vector
from seqopt.errors import SceneError
from seqopt.scene.boxes import Boxes, boxes
from seqopt.scene.library.law import JointLaw
from seqopt.scene.library.meeting import Meeting, Pairs, meeting, widths
from seqopt.scene.parts import THICKEST, Brick, Ground, Joint

STUB = 0.05  # m; of a ground end that does not say


def joints_between(
    bricks: Sequence[Brick], pairs: Pairs, law: JointLaw, normals: Floats | None = None
) -> tuple[Joint, ...]:
    """Return the joints of bricks, each where the faces that look at each other overlap.

    Parameters
    ----------
    bricks : sequence of Brick
    pairs : sequence of (int, int)
        Which of them touch.
    law : JointLaw
    normals : (P, 3) float, optional
        About at right angles to the faces; by default these are the ones that look at each other
        most.

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
    shapes = boxes(bricks)
    found = meeting(shapes, pairs, normals)
    _require_overlap(bricks, pairs, found)
    place, thick = _between(shapes, pairs, found)
    faces = zip(found.shared.area.tolist(), found.shared.moments.tolist(), strict=True)
    stiff = [law.stiffness(area, (about, across)) for area, (about, across) in faces]
    rows = zip(pairs, place, found.along, found.sides[:, 0], stiff, thick, strict=True)
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
    """
    x, y, z = values.tolist()
    return x, y, z


def _require_overlap(bricks: Sequence[Brick], pairs: Pairs, found: Meeting) -> None:
    """Raise an error that names the first two bricks whose faces share nothing."""
    apart = np.flatnonzero(found.shared.area == 0)
    if len(apart):
        i, j = pairs[apart[0]]
        raise SceneError(
            f"joint ({bricks[i].name}, {bricks[j].name}): the faces of its bricks do not overlap; "
            "move the bricks to each other"
        )


def _between(shapes: Boxes, pairs: Pairs, found: Meeting) -> tuple[Floats, list[float]]:
    """Return the points (P, 3) halfway between faces, and the widths of joints that are thick."""
    start, end, taper = widths(shapes, found)
    middle = (found.shared.centroid[:, None, :] @ found.sides)[:, 0]
    place = middle + 0.5 * (start + end)[:, None] * found.along
    thin = 2 * shapes.half[np.array(pairs)].min(axis=(1, 2))
    widest = end - start + taper
    thick: list[float] = np.where(widest > THICKEST * thin, widest, 0.0).tolist()
    return place, thick
