"""Where two faces overlap: the area, its centroid and its second moments, for many pairs at once.

The edge of the overlap of two convex polygons is what of each one's edge lies inside the other.
Area and moments are sums over these pieces (Green's theorem), so the pieces need no order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, FrozenValue

ON_EDGE = 1e-12  # distance treated as zero, over the size of the faces
PARALLEL = 1e-12  # sine of an angle between edges treated as zero


@dataclass(frozen=True, eq=False, repr=False)
class ContactAreas(FrozenValue):
    """The overlaps of P pairs of faces.

    Attributes
    ----------
    area : (P,) float
        m²; 0 where faces do not overlap.
    centroid : (P, 2) float
        m.
    moments : (P, 2) float
        Second moments of area about the two axes through the centroid, m⁴.
    """

    area: Floats
    centroid: Floats
    moments: Floats


def contact_areas(first: Floats, second: Floats) -> ContactAreas:
    """Return the overlaps of convex polygons.

    Parameters
    ----------
    first, second : (P, m, 2) float
        Corners, counterclockwise, m.

    Examples
    --------
    >>> square = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
    >>> half = contact_areas(square, square + [0.5, 0.0])
    >>> half.area, half.centroid
    (array([0.5]), array([[0.75, 0.5 ]]))
    """
    near = first.mean(axis=1, keepdims=True)
    one, other = first - near, second - near
    slack = ON_EDGE * np.abs(one).max(initial=0.0)  # an edge that both have is counted once
    start, end = (
        np.concatenate(parts, axis=1)
        for parts in zip(_inside(one, other, slack), _inside(other, one, -slack), strict=True)
    )
    turn = _cross(start, end)
    area = 0.5 * turn.sum(axis=1)
    real = area > slack**2
    size = np.where(real, area, 1.0)[:, None]
    centroid = (turn[:, :, None] * (start + end)).sum(axis=1) / (6 * size)
    start, end = start - centroid[:, None], end - centroid[:, None]
    squares = start**2 + start * end + end**2
    moments = (_cross(start, end)[:, :, None] * squares).sum(axis=1)[:, ::-1] / 12
    return ContactAreas(
        np.where(real, area, 0.0),
        centroid + near[:, 0],
        np.where(real[:, None], moments, 0.0),
    )


def _inside(polygon: Floats, other: Floats, slack: float) -> tuple[Floats, Floats]:
    """Return where the part of each edge that lies in another polygon starts and ends, (P, m, 2).

    A part of no length starts and ends in one point.
    """
    start, step = polygon, np.roll(polygon, -1, axis=1) - polygon
    side = np.roll(other, -1, axis=1) - other
    side = side / np.linalg.norm(side, axis=2, keepdims=True)
    height = _cross(side[:, None], start[:, :, None] - other[:, None])  # (P, m, m)
    slope = _cross(side[:, None], step[:, :, None])
    flat = np.abs(slope) <= PARALLEL * np.linalg.norm(step, axis=2)[:, :, None]
    crossing = -height / np.where(flat, 1.0, slope)
    outside = flat & (height + slack < 0)
    enters = np.where(outside, np.inf, np.where(flat | (slope < 0), 0.0, crossing))
    leaves = np.where(flat | (slope > 0), 1.0, crossing)
    low = np.maximum(enters.max(axis=2), 0.0)
    high = np.maximum(np.minimum(leaves.min(axis=2), 1.0), 0.0)
    low = np.minimum(low, high)
    return start + low[:, :, None] * step, start + high[:, :, None] * step


def _cross(first: Floats, second: Floats) -> Floats:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])
