"""Bricks as boxes: how far they are apart, and whether two of them overlap.

Two boxes are apart if a plane passes between them, parallel to a face of either or to an edge of
each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints, Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import frames, short, whole
from seqopt.scene.parts import Brick
from seqopt.scene.shape import Polyhedron


def block_brick(
    name: int, shape: Polyhedron, density: float, *, nodes: tuple[int, int] | None = None
) -> Brick:
    """Return a brick of any shape, placed by its second node.

    ``shape``: where it is in the scene, m. ``nodes``: twice the name, and one more, by default;
    they are where `Polyhedron.nodes` says.
    """
    if not isinstance(shape, Polyhedron):
        raise SceneError(f"brick {short(name)}: shape is {short(shape)}; give a Polyhedron")
    own = replace(shape, vertices=as_vectors(shape.points - shape.centroid))
    x, y, z = own.extents(own.axes).tolist()
    at, first, second = as_vectors(np.vstack([shape.centroid, own.axes[:2]]))
    numbers = nodes or (2 * whole("brick: its name", name), 2 * name + 1)
    return Brick(
        name=name,
        position=at,
        length_axis=first,
        width_axis=second,
        dimensions=(x, y, z),
        density=density,
        nodes=numbers,
        placing_node=numbers[-1],
        shape=own,
        node_offsets=own.nodes(),
    )


def spring_fields(
    position: Floats, along: Floats, across: Floats, stiffness: tuple[Vector, Vector]
) -> dict[str, Any]:
    """Return the fields of a joint or ground end; stiffnesses are N/m, then N m/rad."""
    names = ("position", "along", "across", "translational_stiffness", "rotational_stiffness")
    return dict(zip(names, (*map(as_vector, (position, along, across)), *stiffness), strict=True))


def as_vectors(points: Floats) -> tuple[Vector, ...]:
    """Return the rows of an array (k, 3) as tuples."""
    return tuple((x, y, z) for x, y, z in points.tolist())


def as_vector(values: Floats) -> Vector:
    """Return three numbers of an array as a tuple."""
    x, y, z = values.tolist()
    return x, y, z


def vertices_of(brick: Brick) -> tuple[Floats, Sequence[Sequence[int]]]:
    """Return the vertices (V, 3) of a brick in the scene, m, and its faces among them."""
    if brick.shape is not None:
        return np.asarray(brick.shape.points + np.array(brick.position)), brick.shape.faces
    half = 0.5 * np.array(brick.dimensions)[:, None] * brick.frame
    return np.asarray(np.array(brick.position) + BOX_CORNERS @ half), BOX_FACES


BOX_CORNERS = np.array([*product((-1.0, 1.0), repeat=3)])
BOX_FACES = ((0, 1, 3, 2), (6, 7, 5, 4), (4, 5, 1, 0), (2, 3, 7, 6), (0, 2, 6, 4), (5, 7, 3, 1))


_PARALLEL = 1e-9  # sine of an angle between edges treated as zero
_DEEPEST = 1e-6  # depth that is rounding, over the smallest dimension


@dataclass(frozen=True, eq=False, repr=False)
class Boxes(FrozenValue):
    """Where bricks are and how large, as arrays."""

    place: Floats  # (n, 3); centroids, m
    frame: Floats  # (n, 3, 3); rows are unit vectors along length, width and thickness
    half: Floats  # (n, 3); half of each dimension, m

    def corners(self) -> Floats:
        """Return where the corners are, (n, 8, 3), m."""
        return np.asarray(self.place[:, None] + (BOX_CORNERS * self.half[:, None]) @ self.frame)


def boxes(bricks: Sequence[Brick]) -> Boxes:
    """Return bricks as boxes."""
    length = np.array([brick.length_axis for brick in bricks]).reshape(-1, 3)
    width = np.array([brick.width_axis for brick in bricks]).reshape(-1, 3)
    return Boxes(
        place=np.array([brick.position for brick in bricks]).reshape(-1, 3),
        frame=frames(length, width),
        half=0.5 * np.array([brick.dimensions for brick in bricks]).reshape(-1, 3),
    )


def _separations(bricks: Sequence[Brick]) -> tuple[Ints, Floats]:
    """Return how far bricks are apart that are near each other, as pairs (P, 2) and m (P,).

    Along the direction in which they are farthest apart: at most their distance, negative where
    they interpenetrate.
    """
    from scipy.spatial import KDTree  # noqa: PLC0415  # slow to import, and not always needed

    shapes = boxes(bricks)
    longest = 2 * float(np.linalg.norm(shapes.half, axis=1).max(initial=0.0))
    near = KDTree(shapes.place).query_pairs(longest, output_type="ndarray")
    pairs = near[np.lexsort(near.T[::-1])].astype(np.int64)
    a, b = pairs.T
    first, second = shapes.frame[a], shapes.frame[b]
    normal = np.cross(first[:, :, None], second[:, None, :]).reshape(len(first), 9, 3)
    size = np.linalg.norm(normal, axis=2, keepdims=True)
    normal = np.where(size > _PARALLEL, normal / np.maximum(size, _PARALLEL), 0.0)
    axes = np.concatenate([first, second, normal], axis=1)
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
    """Require bricks that interpenetrate by at most ``deepest`` of the smallest dimension."""
    pairs, distance = _separations(bricks)
    thin = min(min(brick.dimensions) for brick in bricks)
    if distance.min(initial=0.0) < -deepest * thin:
        i, j = pairs[distance.argmin()]
        raise SceneError(
            f"{where}: bricks {bricks[i].name} and {bricks[j].name} interpenetrate by "
            f"{-1e3 * distance.min():.3g} mm; {remedy}"
        )
