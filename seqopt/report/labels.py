"""Where numbers stand in a picture so that they cover neither lines nor each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Floats

POINTS = 9.0  # from a mark to the middle of its number
SHARE = 0.026  # of the picture's size that this is, about
WIDE = 1.5  # of a number over its height
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
    around = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
    ends = np.asarray(segments, dtype=float).reshape(-1, 2, 2)
    placed: list[Floats] = []
    out = []
    for mark in marks:
        spots = mark + reach * around
        room = _from_lines(spots, ends)
        for other in placed:
            apart = np.linalg.norm((spots - other) / [WIDE, 1.0], axis=1)
            room = np.minimum(room, apart)
        best = int(room.argmax())
        placed.append(spots[best])
        x, y = (POINTS * around[best]).tolist()
        out.append((x, y))
    return out


def _from_lines(spots: Floats, ends: Floats) -> Floats:
    """Return how far spots (n, 2) are from the nearest of lines between ends (E, 2, 2)."""
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    away = spots[:, None] - start
    length = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    share = np.clip((away * along).sum(axis=2) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(away - share[..., None] * along, axis=2).min(axis=1))
