"""Checked polygons: the faces over which bodies touch."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TypeVar

from seqopt.errors import SceneError
from seqopt.scene.checks import short, vector

Part = TypeVar("Part")
STRAIGHT = 1e-9  # by how much a convex polygon may turn back, over the square of its longest edge


def rows(where: str, values: Iterable[Part]) -> tuple[Part, ...]:
    """Return what there is to go through.

    Parameters
    ----------
    where : str
        What it is, for the message.
    values : iterable

    Raises
    ------
    SceneError
        If it is no list.
    """
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise SceneError(f"{where} is {short(values)}; give a list")
    return tuple(values)


def convex_polygon(
    where: str, corners: Iterable[Iterable[float]]
) -> tuple[tuple[float, float], ...]:
    """Return the corners of a convex polygon, counterclockwise.

    Parameters
    ----------
    where : str
        What it is, for the message.
    corners : iterable of iterable of float
        Two coordinates each, once around, m.

    Returns
    -------
    tuple of tuple of 2 float

    Raises
    ------
    SceneError
        If there are fewer than three, one is not finite, or they are no convex polygon with an
        area.
    """
    points = []
    for corner in rows(where, corners):
        x, y, _ = vector(f"{where}: a corner", (*rows(f"{where}: a corner", corner), 0.0))
        points.append((x, y))
    edges = [(u - x, v - y) for (x, y), (u, v) in zip(points, points[1:] + points[:1], strict=True)]
    turns = [a * d - b * c for (a, b), (c, d) in zip(edges, edges[1:] + edges[:1], strict=True)]
    size = max((a * a + b * b for a, b in edges), default=0.0)
    slack = STRAIGHT * size
    angle = math.fsum(
        math.atan2(turn, a * c + b * d)
        for turn, (a, b), (c, d) in zip(turns, edges, edges[1:] + edges[:1], strict=True)
    )
    if len(points) < 3 or not max(turns) > slack or min(turns) < -slack or angle > 3 * math.pi:
        raise SceneError(
            f"{where} is {short(points)}; give three corners or more of a convex polygon, "
            "counterclockwise"
        )
    return tuple(points)
