"""Polygons united and cut into convex pieces, by shapely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.checks import short

SLIVER = 1e-6  # by which the hull of what is convex may be larger, over its area
GRAIN = 1e-9  # length to which corners are rounded, over the size of what overlaps


def convex_pieces(polygons: Sequence[Any]) -> Iterator[Floats]:
    """Yield the convex pieces of a union of polygons.

    Yields
    ------
    (m, 2) float
        Corners counterclockwise, m.

    Raises
    ------
    SceneError
        If polygons are too degenerate to be cut.
    """
    try:
        yield from _pieces(import_module("shapely"), polygons)
    except import_module("shapely.errors").ShapelyError as error:
        raise SceneError(f"a face where blocks touch cannot be cut: {short(error, 80)}") from error


def _pieces(shapely: Any, polygons: Sequence[Any]) -> Iterator[Floats]:
    """Yield the convex pieces of a union of polygons, without a word where that fails."""
    size = max((max(abs(x) for x in polygon.bounds) for polygon in polygons), default=1.0)
    whole = shapely.unary_union(list(polygons), grid_size=GRAIN * size).simplify(GRAIN * size)
    for part in getattr(whole, "geoms", [whole]):
        if part.geom_type != "Polygon" or part.is_empty:
            continue
        if _is_convex(part):
            yield _corners(part)
            continue
        triangles = [*shapely.constrained_delaunay_triangles(part).geoms]
        yield from map(_corners, _merged(triangles, GRAIN * size))


def _merged(pieces: list[Any], grain: float) -> list[Any]:
    """Return convex polygons united as long as two of them have a convex union."""
    pieces = sorted(pieces, key=lambda piece: -piece.area)
    i = 0
    while i < len(pieces):
        for j in range(i + 1, len(pieces)):
            if pieces[i].intersection(pieces[j]).length <= grain:
                continue
            union = pieces[i].union(pieces[j], grid_size=grain).simplify(grain)
            if union.geom_type == "Polygon" and _is_convex(union):
                pieces[i] = union
                del pieces[j]
                break
        else:
            i += 1
    return pieces


def _is_convex(polygon: Any) -> bool:
    hull = polygon.convex_hull.area
    return not polygon.interiors and bool(hull - polygon.area <= SLIVER * hull)


def _corners(polygon: Any) -> Floats:
    """Return the corners of the hull of a polygon that is convex but for rounding."""
    hull = import_module("shapely").geometry.polygon.orient(polygon.convex_hull)
    return np.array(hull.exterior.coords)[:-1]
