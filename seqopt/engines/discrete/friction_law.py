"""What the points of a joint's bed carry: springs until a bond breaks, then contact and friction.

A bond breaks where tension exceeds the strength or shear exceeds cohesion and friction, and is then
lost for good. What is broken carries compression and shear up to friction; it slips along the shear
and keeps its slip, as long as it is closed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats
from seqopt.contact.mortar import Mortar

EXCESS = 1e-9  # stress above a limit that counts as none, over the stress scale


@dataclass(frozen=True)
class Points:
    """The springs of P points of a bed.

    Attributes
    ----------
    area : (P,) float
        m².
    normal, tangential : (P,) float
        Stiffness, N/m.
    mortar : Mortar
    stress_scale : float
        Pa.
    """

    area: Floats
    normal: Floats
    tangential: Floats
    mortar: Mortar
    stress_scale: float

    def trial(self, opening: Floats, slip: Floats) -> Floats:
        """Return the forces (P, 3) of unbroken springs that have slipped, compression first, N."""
        stiffness = np.stack([self.normal, self.tangential, self.tangential], axis=1)
        force = -stiffness * opening
        force[:, 1:] += self.tangential[:, None] * slip
        return force

    def slipped(self, opening: Floats, force: Floats) -> Floats:
        """Return the slip (P, 2) that is left when points carry forces (P, 3), m."""
        return np.asarray(opening[:, 1:] + force[:, 1:] / self.tangential[:, None])

    def exceeds(self, force: Floats) -> np.ndarray:
        """Return at which points (P,) bonds do not hold forces (P, 3)."""
        mortar, margin = self.mortar, EXCESS * self.stress_scale
        normal, shear = force[:, 0] / self.area, np.linalg.norm(force[:, 1:], axis=1) / self.area
        return np.asarray(
            (-normal > mortar.tensile_strength + margin)
            | (shear > mortar.cohesion + mortar.friction * normal + margin)
        )

    def forces(self, opening: Floats, slip: Floats, broken: np.ndarray) -> tuple[Floats, Floats]:
        """Return forces (P, 3) on the second bodies for openings (P, 3), and how fast they fall.

        The second array (P, 3, 3) is minus the derivative of the forces.
        """
        force = self.trial(opening, slip)
        slope = np.zeros((len(force), 3, 3))
        slope[:, 0, 0] = self.normal
        slope[:, 1, 1] = slope[:, 2, 2] = self.tangential
        size = np.linalg.norm(force[:, 1:], axis=1)
        limit = self.mortar.friction * np.maximum(force[:, 0], 0.0)
        slips = np.flatnonzero(broken & (size > limit))
        along = force[slips, 1:] / size[slips, None]
        share = limit[slips] / size[slips] * self.tangential[slips]
        slope[slips, 1:, 1:] = share[:, None, None] * (
            np.eye(2) - along[:, :, None] * along[:, None, :]
        )
        slope[slips, 1:, 0] = self.mortar.friction * self.normal[slips, None] * along
        force[slips, 1:] = limit[slips, None] * along
        apart = broken & (force[:, 0] <= 0)
        force[apart], slope[apart] = 0.0, 0.0
        return force, slope
