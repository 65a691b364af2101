"""Checked vectors and numbers: the atoms of a scene."""

from __future__ import annotations

import math
from collections.abc import Iterable

from seqopt.arrays import Vector
from seqopt.errors import SceneError

UNIT_TOLERANCE = 1e-9  # how far a direction may be from unit length, or a pair from a right angle


def vector(where: str, values: Iterable[float], at_least: float = -math.inf) -> Vector:
    """Return three finite floats, or raise a `SceneError` that names the place and the value."""
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError) as error:
        raise SceneError(f"{where} is {values!r}; give three numbers") from error
    if not all(math.isfinite(c) and c >= at_least for c in (x, y, z)):
        bound = "" if at_least == -math.inf else f", each at least {at_least:g}"
        raise SceneError(f"{where} is {[x, y, z]}; give three finite numbers{bound}")
    return x, y, z


def positive(where: str, value: float, unit: str) -> float:
    """Return a positive finite float, or raise a `SceneError`."""
    if not (isinstance(value, int | float) and math.isfinite(value) and value > 0):
        raise SceneError(f"{where} is {value!r}; give a positive number of {unit}")
    return float(value)


def axes(where: str, first: Iterable[float], second: Iterable[float]) -> tuple[Vector, Vector]:
    """Return two unit vectors at right angles, or raise a `SceneError`."""
    a, b = vector(where, first), vector(where, second)
    if max(abs(dot(a, a) - 1), abs(dot(b, b) - 1), abs(dot(a, b))) > UNIT_TOLERANCE:
        raise SceneError(f"{where} are {list(a)} and {list(b)}; give perpendicular unit vectors")
    return a, b


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
