"""Unit vectors, and the right-handed axes that two of them make."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats


def units(vectors: Floats) -> Floats:
    """Return the unit vectors along vectors (..., m)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def frames(first: Floats, second: Floats) -> Floats:
    """Return right-handed axes (..., 3, 3), as rows, from the first two of them (..., 3)."""
    return np.stack([first, second, np.cross(first, second)], axis=-2)
