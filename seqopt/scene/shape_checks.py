"""Checks of a block that is not a box: its shape, and where robots hold it."""

from __future__ import annotations

import math

import numpy as np

from seqopt.arrays import Vector
from seqopt.errors import SceneError
from seqopt.scene.checks import short, vector
from seqopt.scene.polygon import rows
from seqopt.scene.shape import Polyhedron

SAME_PLACE = 1e-6  # distance treated as zero, over the size of a block


def two_points(where: str, given: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
    """Return where the nodes of a block are if they are two places.

    Parameters
    ----------
    where : str
        The block, for messages.
    given : tuple of 2 Vector
        m.

    Returns
    -------
    tuple of 2 Vector

    Raises
    ------
    SceneError
        If they are not two different points.
    """
    found = [vector(f"{where}: node_offsets", row) for row in rows(f"{where}: node_offsets", given)]
    if len(found) != 2 or found[0] == found[1]:
        raise SceneError(f"{where}: node_offsets are {short(given)}; give two different points")
    return found[0], found[1]


def check_shape(where: str, shape: object, dimensions: Vector, axes: tuple[Vector, Vector]) -> None:
    """Require a shape about the centroid that extends as far as the dimensions say.

    Parameters
    ----------
    where : str
        The block, for messages.
    shape : Polyhedron
    dimensions : Vector
        m.
    axes : tuple of 2 Vector
        Unit vectors along length and width.

    Raises
    ------
    SceneError
        If it is not such a shape.
    """
    size = max(dimensions)
    if not isinstance(shape, Polyhedron):
        raise SceneError(f"{where}: shape is {short(shape)}; give a Polyhedron")
    off = math.hypot(*shape.centroid.tolist())
    if not off <= SAME_PLACE * size:
        raise SceneError(
            f"{where}: the centroid of its shape is {off:.3g} m from its position; give vertices "
            "from the centroid"
        )
    length, width = np.array(axes[0]), np.array(axes[1])
    extents = shape.extents(np.stack([length, width, np.cross(length, width)]))
    if not np.allclose(extents, dimensions, rtol=0.0, atol=SAME_PLACE * size):
        raise SceneError(
            f"{where}: dimensions are {list(dimensions)}, and its shape extends "
            f"{[float(f'{e:.6g}') for e in extents]} along its axes; give these"
        )
