"""What the points of a joint's bed carry: springs until a bond breaks, then contact and friction.

A bond breaks where tension exceeds the strength or shear exceeds cohesion and friction, and is then
lost for good. What is broken carries compression and shear up to friction; it slips along the shear
and keeps its slip, as long as it is closed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue
from seqopt.contact.mortar import Mortar

EXCESS = 1e-9  # stress above a limit that counts as none, over the stress scale


@dataclass(frozen=True, eq=False, repr=False)
class Points(FrozenValue):
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
        """Return the forces of unbroken springs that have slipped.

        Parameters
        ----------
        opening : (P, 3) float
            m.
        slip : (P, 2) float
            m.

        Returns
        -------
        (P, 3) float
            Compression first, N.
        """
        stiffness = np.stack([self.normal, self.tangential, self.tangential], axis=1)
        force = -stiffness * opening
        force[:, 1:] += self.tangential[:, None] * slip
        return force

    def slipped(self, opening: Floats, force: Floats) -> Floats:
        """Return the slip that is left when points carry forces.

        Parameters
        ----------
        opening : (P, 3) float
            m.
        force : (P, 3) float
            N.

        Returns
        -------
        (P, 2) float
            m.
        """
        return np.asarray(opening[:, 1:] + force[:, 1:] / self.tangential[:, None])

    def exceeds(self, force: Floats) -> Bools:
        """Return at which points bonds do not hold forces.

        Parameters
        ----------
        force : (P, 3) float
            N.

        Returns
        -------
        (P,) bool
        """
        mortar, margin = self.mortar, EXCESS * self.stress_scale
        normal, shear = force[:, 0] / self.area, np.linalg.norm(force[:, 1:], axis=1) / self.area
        return np.asarray(
            (-normal > mortar.tensile_strength + margin)
            | (shear > mortar.cohesion + mortar.friction * normal + margin)
        )

    def forces(self, opening: Floats, slip: Floats, broken: Bools) -> tuple[Floats, Floats]:
        """Return forces on the second bodies, and how fast they fall.

        Parameters
        ----------
        opening : (P, 3) float
            m.
        slip : (P, 2) float
            m.
        broken : (P,) bool
            Where the bond is lost.

        Returns
        -------
        force : (P, 3) float
            N.
        slope : (P, 3, 3) float
            Minus its derivative by the opening, N/m.
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
