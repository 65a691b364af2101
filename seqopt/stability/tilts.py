"""How far an assembly can be pulled sideways, whatever the direction.

The pulls that are survived form a convex set: forces for two pulls mix to forces for what lies
between them. So what is survived in a few directions bounds from below what is in all others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seqopt.arrays import Floats, Vector
from seqopt.stability.limit_analysis import Case, Sense
from seqopt.stability.prover import Proven, Prover

DIRECTIONS = 8  # in which an assembly is pulled sideways, evenly spread
FINE = 8 * DIRECTIONS  # where these leave open what a grip set survives
MORE = 8  # directions at most that are added where the bound for all others is least
NEAR = 5e-3  # share of the least pull by which the bound may fall short before any is added


def sideways(fixed: Case, up: Vector, count: int = DIRECTIONS) -> list[Case]:
    """Return the cases of the largest sideways acceleration.

    Parameters
    ----------
    fixed : Case
        Whose strengths do not grow with z.
    up : Vector
        Unit vector against gravity.
    count : int, optional
        Of directions, evenly spread.

    Returns
    -------
    list of Case
        One per direction.
    """
    return [_pulled(fixed, up, angle) for angle in 2 * np.pi * np.arange(count) / count]


def safe_pull(prove: Prover, fixed: Case, up: Vector) -> tuple[list[Proven], float]:
    """Return the largest sideways accelerations, and one that is survived in every direction.

    Where the bound is least a direction is added, until it falls short of the least pull found by
    no more than `NEAR`, or `MORE` have been.

    Parameters
    ----------
    prove : Prover
    fixed : Case
        Whose strengths do not grow with z.
    up : Vector
        Unit vector against gravity.

    Returns
    -------
    pulls : list of Proven
        Of `sideways`, then of the directions added.
    worst : float
        NaN if forces prove too few.
    """
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    pulls = [prove(case) for case in sideways(fixed, up)]
    while True:
        held = np.array([pull.held for pull in pulls])
        worst, angle = in_every_direction(angles, held)
        short = worst < (1 - NEAR) * np.fmin.reduce(held)
        if not short or len(pulls) == DIRECTIONS + MORE or np.isnan(held[DIRECTIONS:]).any():
            return pulls, worst
        angles = np.append(angles, angle)
        pulls.append(prove(_pulled(fixed, up, angle)))


def in_every_direction(angles: Floats, pulls: Floats) -> tuple[float, float]:
    """Return the pull that is survived in every direction, by what is in some.

    Parameters
    ----------
    angles, pulls : (n,) float
        Directions, rad, and what is survived there; NaN where that is not known.

    Returns
    -------
    pull, angle : float
        The least and where it is; NaN if those known leave half of all directions out.

    Examples
    --------
    >>> pull, angle = in_every_direction(np.pi / 2 * np.arange(4), np.array([1, 1, 3, 3]))
    >>> round(pull, 4), round(angle, 4)
    (0.7071, 0.7854)
    """
    order = np.argsort(angles[np.isfinite(pulls)])
    angles, pulls = (part[np.isfinite(pulls)][order] for part in (angles, pulls))
    turns = np.diff(angles, append=angles[:1] + 2 * np.pi)
    if len(angles) < 3 or turns.max() >= np.pi:
        return np.nan, np.nan
    ends = pulls[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    along = np.roll(ends, -1, axis=0) - ends
    size = np.maximum(np.square(along).sum(axis=1), np.finfo(float).tiny)
    share = np.clip(-(ends * along).sum(axis=1) / size, 0.0, 1.0)
    nearest = ends + share[:, None] * along
    distance = np.linalg.norm(nearest, axis=1)
    worst = int(distance.argmin())
    x, y = nearest[worst]
    return float(distance[worst]), float(np.arctan2(y, x) % (2 * np.pi))


def _pulled(fixed: Case, up: Vector, angle: float) -> Case:
    """Return the case of the largest acceleration in a direction."""
    axis = np.array(up)
    first = np.eye(3)[np.abs(axis).argmin()]
    first = first - axis * (axis @ first)
    first /= np.linalg.norm(first)
    x, y, z = (np.cos(angle) * first + np.sin(angle) * np.cross(axis, first)).tolist()
    return replace(fixed, sense=Sense.LARGEST, pull=(x, y, z))
