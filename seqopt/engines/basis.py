"""The directions in which a structure is loaded and moves: in space, or in a plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import SupportsIndex

import numpy as np
from scipy import linalg

from seqopt.arrays import Floats, FrozenValue, frozen


@dataclass(frozen=True, eq=False, repr=False)
class Basis(FrozenValue):
    """The directions in which a structure is loaded and moves.

    ``force``, ``moment`` (d, 3), (m, 3): unit vectors of forces and translations, of moments and
    rotations.
    """

    force: Floats
    moment: Floats

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[object, ...]:
        # where a copy arrives, all of space must be the one that others are compared with
        return "SPACE" if self is SPACE else super().__reduce_ex__(protocol)

    @cached_property
    def wrench(self) -> Floats:
        """Both as rows, (k, 6) with k = d + m."""
        return frozen(linalg.block_diag(self.force, self.moment))

    def levers(self, arms: Floats) -> Floats:
        """Return the moments of unit forces at the ends of arms.

        ``arms`` (..., 3). Result (..., m, d).
        """
        sizes = len(self.moment), len(self.force)
        return np.asarray((arms @ self._turns.T).reshape(*arms.shape[:-1], *sizes))

    @cached_property
    def _turns(self) -> Floats:
        """What arms are multiplied by, (md, 3): (r × f) · n = r · (f × n)."""
        return frozen(np.cross(self.force[None], self.moment[:, None]).reshape(-1, 3))


SPACE = Basis(np.eye(3), np.eye(3))
"""All of space: d = m = 3."""
