"""Where numbers stand in a picture so that they cover neither lines nor each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Floats

POINTS = 9.0  # from a mark to the middle of its number
SHARE = 0.026  # of the picture's size that this is, about
ANGLES = np.radians(np.arange(0, 360, 15))


def aside(marks: Floats, segments: Sequence[Floats]) -> list[tuple[float, float]]:
    """Return how far beside its mark every label stands, in points.

    Each takes the direction in which the nearest line, mark or label before it is farthest.

    Parameters
    ----------
    marks : (n, 2) float
        Where the marks are, in the unit of the picture.
    segments : sequence of (2, 2) float
        Lines of the picture.

    Returns
    -------
    list of tuple of float
        To the right and up.
    """
    reach = SHARE * float(np.ptp(marks, axis=0).max())
    share = np.linspace(0, 1, 9)[:, None]
    lines = np.concatenate([one[0] + share * (one[1] - one[0]) for one in segments])
    around = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
    placed: list[Floats] = []
    out = []
    for mark in marks:
        taken = np.concatenate([lines, *(other[None] + _word(reach) for other in placed)])
        spots = mark + reach * around
        room = np.linalg.norm(spots[:, None] - taken, axis=2).min(axis=1)
        best = int(room.argmax())
        placed.append(spots[best])
        x, y = (POINTS * around[best]).tolist()
        out.append((x, y))
    return out


def _word(reach: float) -> Floats:
    """Return points (3, 2) across a label of two digits, about its middle."""
    return reach * np.array([[-0.6, 0.0], [0.0, 0.0], [0.6, 0.0]])
