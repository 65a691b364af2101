"""The space between two bricks that a joint fills, and whether the bricks can touch there.

Faces are projected onto the plane of their joint before their overlap is taken, so that bricks
meters apart, or one inside the other, would have a contact like any others. What lies between the
faces is the joint's thickness: none where bricks are laid dry, at most `THICKEST` of the smallest
dimension of the bricks, or what the joint itself says. Faces that are not quite parallel meet in
places; everything is measured in the middle of the overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.parts import THICKEST, Brick

OVERLAP = 0.05  # by which bricks may interpenetrate, over their smallest dimension
BESIDE = 0.5  # by which a joint's position may lie beside the faces, over the same


@dataclass(frozen=True)
class JointSpace:
    """Where a joint lies between the faces of its bricks.

    Attributes
    ----------
    name : str
    bricks : tuple of Brick
        One on the ground, or two.
    ends : tuple of 2 float
        Where the faces of the first body and of the last are along the joint's normal, from its
        plane and in the middle of the overlap, m.
    beside : float
        How far its position lies outside the overlap, m; negative inside.
    thickness : float
        What the scene says, m; NaN if it does not.
    """

    name: str
    bricks: tuple[Brick, ...]
    ends: tuple[float, float]
    beside: float
    thickness: float

    def require_touching(self) -> None:
        """Raise an error unless the bricks touch through the joint.

        Raises
        ------
        SceneError
            If they are too far apart, interpenetrate, or the joint lies elsewhere.
        """
        size = min(min(brick.dimensions) for brick in self.bricks)
        apart, slack = self.ends[1] - self.ends[0], OVERLAP * size
        inside = max(self.ends[0], -self.ends[1])
        if apart < -slack:
            raise SceneError(
                f"joint {self.name}: its bricks interpenetrate by {-1e3 * apart:.3g} mm, more than "
                f"{1e3 * slack:.3g} mm; move them apart"
            )
        if inside > slack:
            raise SceneError(
                f"joint {self.name}: its plane lies {1e3 * inside:.3g} mm inside a brick; "
                "move its position between the faces"
            )
        most = THICKEST * size if np.isnan(self.thickness) else self.thickness + slack
        if apart > most:
            raise SceneError(
                f"joint {self.name}: there are {1e3 * apart:.3g} mm between its faces, more than "
                f"{1e3 * most:.3g} mm; move the bricks together or give the joint its thickness"
            )
        if self.beside > BESIDE * size:
            raise SceneError(
                f"joint {self.name}: its position lies {1e3 * self.beside:.3g} mm beside the faces "
                "that it joins; move it between them"
            )


def face_distance(brick: Brick, normal: Floats, point: Floats) -> float:
    """Return how far along a normal the face of a brick lies that looks against it.

    Parameters
    ----------
    brick : Brick
    normal : (3,) float
        Unit vector that points into the brick.
    point : (3,) float
        From where, m.

    Returns
    -------
    float
        m; negative if the point lies inside.
    """
    length, width = np.array(brick.length_axis), np.array(brick.width_axis)
    frame = np.stack([length, width, np.cross(length, width)])
    i = int(np.abs(frame @ normal).argmax())
    outward = -np.sign(frame[i] @ normal) * frame[i]
    face = np.array(brick.position) + 0.5 * brick.dimensions[i] * outward
    return float((face - point) @ outward / (normal @ outward))


def distance_beside(polygon: Floats) -> float:
    """Return how far the origin lies outside a convex polygon.

    Parameters
    ----------
    polygon : (m, 2) float
        Corners counterclockwise, m.

    Returns
    -------
    float
        m; negative inside. Of the lines of its edges: beside a corner it is somewhat farther.
    """
    edge = np.roll(polygon, -1, axis=0) - polygon
    size = np.linalg.norm(edge, axis=1)
    real = size > 0
    out = polygon[real, 1] * edge[real, 0] - polygon[real, 0] * edge[real, 1]
    return float((out / size[real]).max())
