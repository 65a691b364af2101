"""Where a robot reaches: anywhere, one side of the structure, or a sphere."""

from __future__ import annotations

import math
from dataclasses import dataclass

from seqopt.arrays import Vector
from seqopt.errors import SceneError
from seqopt.scene.checks import UNIT_TOLERANCE, dot, positive, short, vector


@dataclass(frozen=True)
class Anywhere:
    """A mobile robot: every node is within reach."""

    def covers(self, point: Vector) -> bool:
        """Return whether a point is within reach.

        Parameters
        ----------
        point : Vector
            m.
        """
        return True


@dataclass(frozen=True, kw_only=True)
class Side:
    """A robot beside the structure reaches every point of a half-space.

    Parameters
    ----------
    toward : Vector
        Unit vector that points to the robot's side.
    point : Vector
        A point of the plane that bounds the reach, m.

    Raises
    ------
    SceneError
        If ``toward`` is not a unit vector or a number is not finite.
    """

    toward: Vector
    point: Vector

    def __post_init__(self) -> None:
        object.__setattr__(self, "toward", vector("reach: toward", self.toward))
        object.__setattr__(self, "point", vector("reach: point", self.point))
        if abs(dot(self.toward, self.toward) - 1) > UNIT_TOLERANCE:
            raise SceneError(f"reach: toward is {list(self.toward)}; give a unit vector")

    def covers(self, point: Vector) -> bool:
        """Return whether a point is within reach.

        Parameters
        ----------
        point : Vector
            m.
        """
        return dot(self.toward, point) >= dot(self.toward, self.point)


@dataclass(frozen=True, kw_only=True)
class Sphere:
    """A robot at a fixed base reaches every point within a radius.

    Parameters
    ----------
    center : Vector
        m.
    radius : float
        m.

    Raises
    ------
    SceneError
        If the radius is not a positive number or the center is not finite.

    Examples
    --------
    >>> import seqopt
    >>> seqopt.Sphere(center=(0.0, 0.0, 0.5), radius=1.0).covers((0.0, 0.9, 0.5))
    True
    """

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", vector("reach: center", self.center))
        object.__setattr__(self, "radius", positive("reach: radius", self.radius, "m"))

    def covers(self, point: Vector) -> bool:
        """Return whether a point is within reach.

        Parameters
        ----------
        point : Vector
            m.
        """
        return math.dist(self.center, point) <= self.radius


Reach = Anywhere | Side | Sphere


def as_reach(where: str, given: Reach | str) -> Reach:
    """Return a reach; ``"anywhere"`` is one too.

    Parameters
    ----------
    where : str
        What it is, for the message.
    given : Reach or str

    Raises
    ------
    SceneError
        If it is something else.
    """
    if isinstance(given, str) and given == "anywhere":
        return Anywhere()
    if not isinstance(given, Anywhere | Side | Sphere):
        raise SceneError(f"{where} is {short(given)}; give Anywhere(), Side(...) or Sphere(...)")
    return given
