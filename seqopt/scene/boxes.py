"""Bricks as solids: how far boxes are apart, and which bricks interpenetrate.

Two boxes are apart if a plane passes between them, parallel to a face of either or to an edge of
each. How deep other solids interpenetrate is known to `seqopt.exchange`, from which they come.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from seqopt._registry import Later, required
from seqopt.arrays import Floats, Ints, Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import as_vector, as_vectors, short, whole
from seqopt.scene.parts import Brick
from seqopt.scene.shape import Polyhedron

spatial = Later("scipy.spatial")  # slow to import


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


def _spring_fields(
    position: Floats, along: Floats, across: Floats, stiffness: tuple[Vector, Vector]
) -> dict[str, Any]:
    """Return the fields of a joint or ground end; stiffnesses are N/m, then N m/rad."""
    names = ("position", "along", "across", "translational_stiffness", "rotational_stiffness")
    return dict(zip(names, (*map(as_vector, (position, along, across)), *stiffness), strict=True))


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


def _boxes(bricks: Sequence[Brick]) -> tuple[Floats, Floats, Floats]:
    """Return centroids (n, 3), frames (n, 3, 3) and halves of dimensions (n, 3) of bricks, m."""
    place = np.array([brick.position for brick in bricks]).reshape(-1, 3)
    frame = np.array([brick.frame for brick in bricks]).reshape(-1, 3, 3)
    return place, frame, 0.5 * np.array([brick.dimensions for brick in bricks]).reshape(-1, 3)


def box_corners(bricks: Sequence[Brick]) -> Floats:
    """Return where the corners of bricks are, each as a box, (n, 8, 3), m."""
    place, frame, half = _boxes(bricks)
    return np.asarray(place[:, None] + (BOX_CORNERS * half[:, None]) @ frame)


def _separations(bricks: Sequence[Brick]) -> tuple[Ints, Floats]:
    """Return how far bricks are apart that are near each other, as pairs (P, 2) and m (P,).

    Along the direction in which they are farthest apart: at most their distance, negative where
    they interpenetrate.
    """
    place, frame, half = _boxes(bricks)
    longest = 2 * float(np.linalg.norm(half, axis=1).max(initial=0.0))
    near = spatial.KDTree(place).query_pairs(longest, output_type="ndarray")
    pairs = near[np.lexsort(near.T[::-1])].astype(np.int64)
    a, b = pairs.T
    first, second = frame[a], frame[b]
    normal = np.cross(first[:, :, None], second[:, None, :]).reshape(len(first), 9, 3)
    size = np.linalg.norm(normal, axis=2, keepdims=True)
    normal = np.where(size > _PARALLEL, normal / np.maximum(size, _PARALLEL), 0.0)
    axes = np.concatenate([first, second, normal], axis=1)
    apart = np.abs(axes @ (place[b] - place[a])[:, :, None])[:, :, 0]
    for which in (a, b):
        spread = np.abs(axes @ frame[which].transpose(0, 2, 1))
        apart -= (spread @ half[which][:, :, None])[:, :, 0]
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


TOLERATED = 0.05  # depth that rounding and mortar explain, over the smallest dimension


def overlapping(bricks: Sequence[Brick]) -> list[tuple[int, int, float]]:
    """Return the names of bricks that interpenetrate by more than `TOLERATED`, and depths, m.

    The deepest come first.
    """
    thin = np.array([min(brick.dimensions) for brick in bricks])
    if all(brick.shape is None for brick in bricks):
        pairs, apart = _separations(bricks)
        deep = -apart > TOLERATED * thin[pairs].min(axis=1)
        found = [(i, j, -d) for (i, j), d in zip(pairs[deep], apart[deep].tolist(), strict=True)]
    else:
        shapes = [
            Polyhedron(as_vectors(points), tuple(map(tuple, faces)))
            for points, faces in map(vertices_of, bricks)
        ]
        overlaps = required("find_overlaps")(shapes, (TOLERATED * thin).tolist())
        found = [(*each.pair, each.depth) for each in overlaps]
    found.sort(key=lambda held: -held[2])
    return [(bricks[i].name, bricks[j].name, depth) for i, j, depth in found]
