"""Which box hides which: the order in which boxes are drawn so that the nearer cover the farther.

Sorting faces by depth fails where a long one lies beside a short one. Of two convex bodies that a
plane parts, the one on the viewer's side of it is drawn last; among the bodies that hide each other
in the picture this gives an order, unless they do so in a circle. Where several planes part two
bodies and disagree, neither hides the other: bricks that are corbelled touch along an edge, where
any of the planes alone could name the wrong one.
"""

from __future__ import annotations

import heapq
from itertools import combinations

import numpy as np

from seqopt.arrays import Floats, Ints

EDGES = ((0, 4), (0, 2), (0, 1))  # corners of a box along its length, width and thickness
EVEN = 1e-9  # share of a direction toward the viewer that is none
TOUCH = 1e-6  # share of a box's size up to which boxes that touch are parted


def drawing_order(corners: Floats, toward: Floats) -> list[int]:
    """Return boxes from the farthest to the nearest.

    Parameters
    ----------
    corners : (n, 8, 3) float
        Of boxes, as `seqopt.scene.boxes.Boxes.corners` numbers them; they may be sheared, m.
    toward : (3, 3) float
        Unit vectors to the right, up and toward the viewer.

    Returns
    -------
    list of int
        Indices. Boxes that hide each other in a circle, or share room, stand in the order of their
        middles.

    Examples
    --------
    >>> low, high = np.zeros((8, 3)), np.zeros((8, 3))
    >>> low[4:, 0] = low[[2, 3, 6, 7], 1] = low[1::2, 2] = 1.0
    >>> high = low + [0.0, 0.0, 1.0]
    >>> drawing_order(np.array([high, low]), np.eye(3))
    [1, 0]
    """
    seen = corners @ toward.T
    pairs = _overlapping(seen[..., :2])
    behind: list[set[int]] = [set() for _ in corners]
    hides: list[list[int]] = [[] for _ in corners]
    for (i, j), side in zip(pairs.tolist(), _in_front(seen, pairs).tolist(), strict=True):
        if side:
            far, near = (i, j) if side > 0 else (j, i)
            behind[near].add(far)
            hides[far].append(near)
    return _sorted_by_depth(seen[..., 2].mean(axis=1).tolist(), behind, hides)


def _sorted_by_depth(
    depth: list[float], behind: list[set[int]], hides: list[list[int]]
) -> list[int]:
    """Return all in an order, the farthest first; a circle starts at its farthest."""
    ready = [(depth[i], i) for i, waits in enumerate(behind) if not waits]
    heapq.heapify(ready)
    order, left = [], dict.fromkeys(range(len(depth)))
    while left:
        i = heapq.heappop(ready)[1] if ready else min(left, key=lambda k: depth[k])
        if i not in left:
            continue
        del left[i]
        order.append(i)
        for near in hides[i]:
            behind[near].discard(i)
            if not behind[near] and near in left:
                heapq.heappush(ready, (depth[near], near))
    return order


def _overlapping(seen: Floats) -> Ints:
    """Return the pairs (P, 2) whose rectangles around them overlap in the picture."""
    low, high = seen.min(axis=1), seen.max(axis=1)
    over = (low[:, None] < high[None]).all(axis=2)
    return np.argwhere(np.triu(over & over.T, 1)).astype(np.int64)


def _in_front(seen: Floats, pairs: Ints) -> Ints:
    """Return 1 where the second box of a pair lies in front of the first, -1 behind it, else 0."""
    a, b = pairs.T
    edges = np.stack([seen[:, j] - seen[:, i] for i, j in EDGES], axis=1)
    normals = np.stack(
        [np.cross(edges[:, i], edges[:, j]) for i, j in combinations(range(3), 2)], 1
    )
    across = np.cross(edges[a][:, :, None], edges[b][:, None]).reshape(-1, 9, 3)
    axes = np.concatenate([normals[a], normals[b], across], axis=1)
    size = np.linalg.norm(axes, axis=2, keepdims=True)
    axes = np.divide(axes, size, out=np.zeros_like(axes), where=size > EVEN * size.max(initial=1.0))
    first, second = (axes @ seen[which].transpose(0, 2, 1) for which in (a, b))
    ahead = second.min(axis=2) - first.max(axis=2)  # how far the second lies along each axis
    behind = first.min(axis=2) - second.max(axis=2)
    known = np.linalg.norm(axes, axis=2) > 0.5  # not the product of edges that are parallel
    apart = np.where(known, np.maximum(ahead, behind), -np.inf)
    touch = TOUCH * np.linalg.norm(edges[a], axis=2).max(axis=1, keepdims=True)
    parts = apart >= np.minimum(apart.max(axis=1, keepdims=True), -touch)
    sign = np.where(ahead >= behind, 1, -1)
    facing = np.where(np.abs(axes[..., 2]) > EVEN, sign * np.sign(axes[..., 2]), 0)
    nearest = np.where(parts, facing, 2).min(axis=1)
    farthest = np.where(parts, facing, -2).max(axis=1)
    return np.asarray(np.where(nearest == farthest, nearest, 0).astype(np.int64))
