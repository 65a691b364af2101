"""Checked vectors and numbers: the atoms of a scene."""

from __future__ import annotations

import math
from collections.abc import Iterable

from seqopt.arrays import Vector
from seqopt.errors import SceneError

UNIT_TOLERANCE = 1e-9  # how far a direction may be from unit length, or a pair from a right angle


def vector(where: str, values: Iterable[float], at_least: float = -math.inf) -> Vector:
    """Return three finite floats.

    Parameters
    ----------
    where : str
        What the numbers are, for the message.
    values : iterable of float
    at_least : float, optional
        The least value that is allowed.

    Returns
    -------
    Vector

    Raises
    ------
    SceneError
        If there are not three, or one is not finite or too small.
    """
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError) as error:
        raise SceneError(f"{where} is {values!r}; give three numbers") from error
    if not all(math.isfinite(c) and c >= at_least for c in (x, y, z)):
        bound = "" if at_least == -math.inf else f", each at least {at_least:g}"
        raise SceneError(f"{where} is {[x, y, z]}; give three finite numbers{bound}")
    return x, y, z


def positive(where: str, value: float, unit: str) -> float:
    """Return a positive finite float.

    Parameters
    ----------
    where : str
        What the number is, for the message.
    value : float
    unit : str
        Of the number, for the message.

    Returns
    -------
    float

    Raises
    ------
    SceneError
        If it is no number, not finite or not positive.
    """
    if not (isinstance(value, int | float) and math.isfinite(value) and value > 0):
        raise SceneError(f"{where} is {value!r}; give a positive number of {unit}")
    return float(value)


def axes(where: str, first: Iterable[float], second: Iterable[float]) -> tuple[Vector, Vector]:
    """Return two unit vectors at right angles.

    Parameters
    ----------
    where : str
        What the vectors are, for the message.
    first, second : iterable of float

    Returns
    -------
    tuple of 2 Vector

    Raises
    ------
    SceneError
        If one is not of unit length, or they are not at right angles, to `UNIT_TOLERANCE`.
    """
    a, b = vector(where, first), vector(where, second)
    if max(abs(dot(a, a) - 1), abs(dot(b, b) - 1), abs(dot(a, b))) > UNIT_TOLERANCE:
        raise SceneError(f"{where} are {list(a)} and {list(b)}; give perpendicular unit vectors")
    return a, b


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product.

    Parameters
    ----------
    a, b : Vector

    Returns
    -------
    float
    """
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
