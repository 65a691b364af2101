"""The directions in which a structure is loaded and moves: all of space, or those of a plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from seqopt.arrays import Floats


@dataclass(frozen=True)
class Basis:
    """The directions in which a structure is loaded and moves.

    Attributes
    ----------
    force, moment : (d, 3), (m, 3) float
        Unit vectors of forces and translations, of moments and rotations.
    """

    force: Floats
    moment: Floats

    @cached_property
    def wrench(self) -> Floats:
        """Both as rows, (k, 6) with k = d + m."""
        return linalg.block_diag(self.force, self.moment)

    def embedded(self, rows: Floats) -> Floats:
        """Return wrenches or twists (..., k, n) of the basis with all their parts, (..., 6, n)."""
        return rows if self is SPACE else np.asarray(self.wrench.T @ rows)

    def levers(self, arms: Floats) -> Floats:
        """Return the moments of unit forces at arms (..., 3), (..., m, d), m."""
        turns = np.cross(self.force[None], self.moment[:, None])  # (r × f) · n = r · (f × n)
        return np.asarray(
            (arms @ turns.reshape(-1, 3).T).reshape(*arms.shape[:-1], *turns.shape[:2])
        )


SPACE = Basis(np.eye(3), np.eye(3))
