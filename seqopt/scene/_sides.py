"""The order that builds course by course, from both ends of each to its middle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Vector


def from_both_sides(names: Sequence[int], places: Sequence[Vector], up: Vector) -> tuple[int, ...]:
    """Return names of bricks, at some places, in that order."""
    where, high = np.array(places), np.array(up)
    level = where - np.outer(where @ high, high)
    axis = np.linalg.svd(level - level.mean(axis=0))[2][0]  # along which it is longest
    along = np.round(level @ axis * np.sign(axis[np.abs(axis).argmax()]), 6)
    courses, course = np.unique(np.round(where @ high, 6), return_inverse=True)
    ends = [along[course == k] for k in range(len(courses))]
    middle = np.array([0.5 * (each.min() + each.max()) for each in ends])[course]
    rank = np.lexsort((along, np.round(-np.abs(along - middle), 6), course))
    return tuple(names[k] for k in rank)
