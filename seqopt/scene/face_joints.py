"""Joints and ground ends over given faces: stiffness from area and material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Vector
from seqopt.errors import SceneError
from seqopt.scene.blocks import as_vectors
from seqopt.scene.checks import short
from seqopt.scene.library.law import JointLaw
from seqopt.scene.parts import Ground, Joint
from seqopt.scene.shape import normal_of

STUB = 0.05  # m; from a face on the ground to the fixed point behind it


@dataclass(frozen=True, eq=False, repr=False)
class FlatFace(FrozenValue):
    """A convex face in its own plane.

    Attributes
    ----------
    center : (3,) float
        Centroid, m.
    axes : (3, 3) float
        Rows are unit vectors: the normal, and the two principal axes of the area.
    corners : (m, 2) float
        From the centroid along the principal axes, counterclockwise, m.
    area : float
        m².
    moments : tuple of 2 float
        Second moments of area about the principal axes, m⁴.
    """

    center: Floats
    axes: Floats
    corners: Floats
    area: float
    moments: tuple[float, float]


def flat_face(corners: Floats, normal: Floats | None = None) -> FlatFace:
    """Return a face in its own plane.

    Parameters
    ----------
    corners : (m, 3) float
        Once around, m; what leaves their plane is projected onto it.
    normal : (3,) float, optional
        To which side the normal points; counterclockwise corners by default.

    Raises
    ------
    SceneError
        If it has no area, or crosses itself so much that it is none.

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
    return FlatFace(
        center=np.asarray(middle + (turned @ shift) @ sides),
        axes=np.vstack([across, sides]),
        corners=np.asarray((flat - shift) @ turned.T),
        area=area,
        moments=(float(turned[1] @ spread @ turned[1]), float(turned[0] @ spread @ turned[0])),
    )


def face_joint(bricks: tuple[int, int], face: FlatFace, law: JointLaw) -> Joint:
    """Return the joint of two bricks over a face.

    Parameters
    ----------
    bricks : tuple of 2 int
        Names; the face's normal points from the first into the second.
    face : FlatFace
    law : JointLaw
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


def face_ground(brick: int, face: FlatFace, law: JointLaw, stub: float = STUB) -> Ground:
    """Return the ground end of a brick over a face.

    Parameters
    ----------
    brick : int
        Name; the face's normal points into it.
    face : FlatFace
    law : JointLaw
    stub : float, optional
        From the face to the fixed point behind it, m.
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
