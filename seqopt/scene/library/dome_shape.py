"""The numbers that shape a dome."""

from __future__ import annotations

import math
from dataclasses import dataclass

from seqopt.errors import SceneError
from seqopt.scene.checks import positive, short
from seqopt.scene.library.herringbone import REPEAT
from seqopt.scene.library.law import MASONRY, JointLaw
from seqopt.scene.library.laying import few_enough, joint_width, whole_number

BONDS = ("running", "herringbone")
LENGTHS = ("span", "rise", "opening", "thickness")


@dataclass(frozen=True, kw_only=True)
class DomeShape:
    """The numbers that shape a dome, a cap of a sphere with an opening; lengths in m.

    Parameters
    ----------
    courses : int
        Rows from the ground to the opening, equally high.
    around : int
        Bricks in the lowest course. In running bond courses have fewer the higher they are; in
        herringbone all have as many cells, twice this number, and it must be even.
    bond : str
        ``running`` or ``herringbone``.
    span, rise : float
        Diameter at the ground and height over it, of the surface through the bricks' middles,
        before the opening is cut.
    opening : float
        Diameter of the opening.
    thickness : float
        Of the bricks, at right angles to the surface.
    gap : float
        Least width of the joints, on the inside; boxes on a sphere leave more elsewhere.
    density : float
        kg/m³.
    law : JointLaw
        How stiff joints are.

    Raises
    ------
    SceneError
        Naming the number that cannot be.

    Examples
    --------
    >>> DomeShape(courses=8, around=24).rise
    1.0
    """

    courses: int
    around: int
    bond: str = "running"
    span: float = 2.0
    rise: float = 1.0
    opening: float = 0.5
    thickness: float = 0.08
    gap: float = 0.005
    density: float = 2000.0
    law: JointLaw = MASONRY

    def __post_init__(self) -> None:
        _set(self, "courses", whole_number("dome: courses", self.courses, 1))
        _set(self, "around", whole_number("dome: around", self.around, 3))
        few_enough("dome", self.courses * self.around)
        for name in LENGTHS:
            _set(self, name, positive(f"dome: {name}", getattr(self, name), "m"))
        _set(self, "gap", joint_width("dome: gap", self.gap))
        if self.bond not in BONDS:
            raise SceneError(f"dome: bond is {short(self.bond)}; give one of {', '.join(BONDS)}")
        if self.bond == "herringbone" and 2 * self.around % REPEAT:
            raise SceneError(
                f"dome: around is {self.around}; give an even number, so that herringbone closes"
            )
        if self.rise > 0.5 * self.span:
            raise SceneError(
                f"dome: rise is {self.rise:g} m; give at most half of the span, {0.5 * self.span:g}"
            )
        if self.opening >= self.span:
            raise SceneError(
                f"dome: opening is {self.opening:g} m; give less than the span, {self.span:g}"
            )

    @property
    def radius(self) -> float:
        """Radius of the sphere, m."""
        return (0.25 * self.span**2 + self.rise**2) / (2 * self.rise)

    def latitude(self, row: float) -> float:
        """Return the angle above the horizontal at which a row begins, seen from the center.

        Parameters
        ----------
        row : float
            From 0 at the ground.

        Returns
        -------
        float
            rad.
        """
        first, last = (math.acos(0.5 * d / self.radius) for d in (self.span, self.opening))
        return first + (last - first) * row / self.courses


def _set(value: object, name: str, content: object) -> None:
    object.__setattr__(value, name, content)
