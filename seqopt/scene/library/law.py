"""The stiffness of a joint as a function of the face over which its bricks meet."""

from __future__ import annotations

from dataclasses import dataclass

from seqopt.arrays import Vector
from seqopt.scene.checks import vector


@dataclass(frozen=True, kw_only=True)
class JointLaw:
    """The stiffness of a joint per area of the face over which its bricks meet.

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
