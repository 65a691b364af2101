"""Bricks of any shape from their vertices and faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from seqopt.arrays import Floats, Vector
from seqopt.errors import SceneError
from seqopt.scene.checks import short, vector, whole
from seqopt.scene.parts import Brick
from seqopt.scene.shape import Polyhedron, rows

_Numbers = tuple[int, int] | None
_Places = tuple[Vector, Vector] | None


def block_brick(
    name: int, shape: Polyhedron, density: float, *, nodes: _Numbers = None, grips: _Places = None
) -> Brick:
    """Return a brick of any shape.

    ``shape``: where it is in the scene, m. ``density``: kg/m³. ``nodes``: numbers of its nodes;
    twice the name, and one more, by default. ``grips``: where these are, in the scene, m;
    `Polyhedron.nodes` by default. Result: placed by its second node.

    Examples
    --------
    >>> corners = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 3))
    >>> wedge = Polyhedron(corners, ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
    >>> round(block_brick(1, wedge, 2400.0).mass)
    1200
    """
    if not isinstance(shape, Polyhedron):
        raise SceneError(f"brick {short(name)}: shape is {short(shape)}; give a Polyhedron")
    own = replace(shape, vertices=as_vectors(shape.points - shape.centroid))
    x, y, z = own.extents(own.axes).tolist()
    at, first, second = as_vectors(np.vstack([shape.centroid, own.axes[:2]]))
    held = own.nodes() if grips is None else _from(shape.centroid, name, grips)
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
        node_offsets=held,
    )


def _from(center: Floats, name: int, grips: _Places) -> tuple[Vector, Vector]:
    """Return where grips are from a center."""
    where = f"brick {name}: grips"
    found = [vector(where, row) for row in rows(where, grips or ())]
    if len(found) != 2:
        raise SceneError(f"{where} are {short(grips)}; give two points")
    first, second = as_vectors(np.array(found) - center)
    return first, second


def as_vectors(points: Floats) -> tuple[Vector, ...]:
    """Return the rows of an array as tuples. ``points`` (k, 3)."""
    return tuple((x, y, z) for x, y, z in points.tolist())


def as_vector(values: Floats) -> Vector:
    """Return three numbers of an array as a tuple. ``values`` (3,)."""
    x, y, z = values.tolist()
    return x, y, z


def vertices_of(brick: Brick) -> tuple[Floats, Sequence[Sequence[int]]]:
    """Return the vertices of a brick, box or not, and its faces.

    Results: ``vertices`` (V, 3): in the scene, m; ``faces``: places among them, counterclockwise
    from outside.
    """
    if brick.shape is not None:
        return np.asarray(brick.shape.points + np.array(brick.position)), brick.shape.faces
    half = 0.5 * np.array(brick.dimensions)[:, None] * brick.frame
    return np.asarray(np.array(brick.position) + BOX_CORNERS @ half), BOX_FACES


BOX_CORNERS = np.array([[a, b, c] for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)])
BOX_FACES = ((0, 1, 3, 2), (6, 7, 5, 4), (4, 5, 1, 0), (2, 3, 7, 6), (0, 2, 6, 4), (5, 7, 3, 1))
