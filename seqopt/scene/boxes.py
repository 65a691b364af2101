"""Bricks as boxes: how far they are apart, and whether two of them overlap.

Two boxes are apart if a plane passes between them, and if one does, then one that is parallel to a
face of either or to an edge of each. The largest distance over these 15 directions is negative for
boxes that interpenetrate: the shortest way to part them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import SceneError
from seqopt.scene.parts import Brick

_PARALLEL = 1e-9  # sine of an angle between edges treated as zero
_DEEPEST = 1e-6  # depth that is rounding, over the smallest dimension


@dataclass(frozen=True, eq=False, repr=False)
class Boxes(FrozenValue):
    """Where bricks are and how large, as arrays."""

    place: Floats  # (n, 3); centroids, m
    frame: Floats  # (n, 3, 3); rows are unit vectors along length, width and thickness
    half: Floats  # (n, 3); half of each dimension, m

    def corners(self) -> Floats:
        """Return where the corners are. Result (n, 8, 3): m."""
        signs = np.array(list(product((-1.0, 1.0), repeat=3)))
        return np.asarray(self.place[:, None] + (signs * self.half[:, None]) @ self.frame)


def boxes(bricks: Sequence[Brick]) -> Boxes:
    """Return bricks as boxes."""
    length = np.array([brick.length_axis for brick in bricks]).reshape(-1, 3)
    width = np.array([brick.width_axis for brick in bricks]).reshape(-1, 3)
    return Boxes(
        place=np.array([brick.position for brick in bricks]).reshape(-1, 3),
        frame=np.stack([length, width, np.cross(length, width)], axis=1),
        half=0.5 * np.array([brick.dimensions for brick in bricks]).reshape(-1, 3),
    )


def separations(bricks: Sequence[Brick]) -> tuple[Ints, Floats]:
    """Return how far bricks are apart that are near each other.

    Results: ``pairs`` (P, 2): indices of the bricks whose centroids are no farther apart than the
    longest diagonal. ``distance`` (P,): m, along the direction in which they are farthest apart: no
    more than their distance, and the same where faces look at each other; negative where they
    interpenetrate.

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> pairs, distance = separations(load_scene("arch25").bricks)
    >>> bool((distance > 0).all())
    True
    """
    from scipy.spatial import KDTree  # noqa: PLC0415  # slow to import, and not always needed

    shapes = boxes(bricks)
    longest = 2 * float(np.linalg.norm(shapes.half, axis=1).max(initial=0.0))
    near = KDTree(shapes.place).query_pairs(longest, output_type="ndarray")
    pairs = near[np.lexsort(near.T[::-1])].astype(np.int64)
    a, b = pairs.T
    first, second = shapes.frame[a], shapes.frame[b]
    axes = np.concatenate([first, second, _edge_normals(first, second)], axis=1)
    step = shapes.place[b] - shapes.place[a]
    apart = np.abs(axes @ step[:, :, None])[:, :, 0]
    for which in (a, b):
        spread = np.abs(axes @ shapes.frame[which].transpose(0, 2, 1))
        apart -= (spread @ shapes.half[which][:, :, None])[:, :, 0]
    real = np.linalg.norm(axes, axis=2) > _PARALLEL
    return pairs, np.where(real, apart, -np.inf).max(axis=1, initial=-np.inf)


def require_apart(
    where: str, bricks: Sequence[Brick], remedy: str, deepest: float = _DEEPEST
) -> None:
    """Require bricks of which no two interpenetrate.

    ``deepest``: by how much they may, over the smallest dimension.
    """
    pairs, distance = separations(bricks)
    thin = min(min(brick.dimensions) for brick in bricks)
    if distance.min(initial=0.0) < -deepest * thin:
        i, j = pairs[distance.argmin()]
        raise SceneError(
            f"{where}: bricks {bricks[i].name} and {bricks[j].name} interpenetrate by "
            f"{-1e3 * distance.min():.3g} mm; {remedy}"
        )


def _edge_normals(first: Floats, second: Floats) -> Floats:
    """Return unit vectors across an edge of each of two boxes, (P, 9, 3); zero if they agree."""
    normal = np.cross(first[:, :, None], second[:, None, :]).reshape(len(first), 9, 3)
    size = np.linalg.norm(normal, axis=2, keepdims=True)
    return np.asarray(np.where(size > _PARALLEL, normal / np.maximum(size, _PARALLEL), 0.0))
