"""What generators and imports share: how stiff joints are, checked numbers, robots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from seqopt.arrays import Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import MOST_BRICKS, check, finite, kind_of, stiffness
from seqopt.scene.arch import STANDARD_GRAVITY
from seqopt.scene.parts import Brick, Robot


@dataclass(frozen=True, kw_only=True)
class JointLaw:
    """The stiffness of a joint per area of the face over which its bricks meet.

    ``translational``: along the joint's normal and across it twice, N/m per m². Rotations are
    resisted as by a bed of this stiffness over the face, with its second moments of area. Raises
    `SceneError` if a number is not finite or negative.

    Examples
    --------
    >>> law = JointLaw(translational=(1.5e9, 1.5e8, 1.5e8))
    >>> [f"{k:.4g}" for k in law.stiffness(0.02, (2e-5, 7e-5))[0]]
    ['3e+07', '3e+06', '3e+06']
    """

    translational: Vector

    def __post_init__(self) -> None:
        check(self, "joint law", translational=stiffness)

    def stiffness(self, area: float, moments: tuple[float, float]) -> tuple[Vector, Vector]:
        """Return the stiffness of a joint over a face, N/m and N m/rad.

        ``area``: m²; ``moments``: second moments of area about the two axes across the normal, m⁴.
        """
        normal, one, other = self.translational
        first, second = moments
        turning = (one * first + other * second, normal * first, normal * second)
        return (area * normal, area * one, area * other), turning

    def over_rectangle(self, width: float, depth: float) -> tuple[Vector, Vector]:
        """Return the stiffness of a joint over a rectangle; sides in m."""
        area = width * depth
        return self.stiffness(area, (area * depth**2 / 12, area * width**2 / 12))


# of the domes that Bruun et al. built later
MASONRY = JointLaw(translational=(1.5e9, 1.5e8, 1.5e8))
DOWN = np.array([0.0, 0.0, -1.0])


_joint_width = partial(finite, least=0.0, wanted="a positive number of m, or 0")
a_law = partial(kind_of, kind=JointLaw)


def _mobile_robots(bricks: Sequence[Brick], count: int = 3) -> tuple[Robot, ...]:
    """Return robots that reach everything, each of which can bear all bricks."""
    weight = STANDARD_GRAVITY * math.fsum(brick.mass for brick in bricks)
    return tuple(Robot(name=f"rob{i}", payload=weight) for i in range(1, count + 1))


def _few_enough(where: str, bricks: int) -> None:
    """Require a structure of at most `MOST_BRICKS`."""
    if bricks > MOST_BRICKS:
        raise SceneError(f"{where}: {bricks} bricks; give numbers that make at most {MOST_BRICKS}")
