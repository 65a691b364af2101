"""Checked vectors and numbers: the atoms of a scene."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from typing import TypeVar

from seqopt.arrays import Vector
from seqopt.errors import SceneError

_Part = TypeVar("_Part")
LARGEST_NUMBER = 10**15  # of a brick or node: what arrays of numbers hold without loss
_TURNS = {*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x2028, 0x2029}  # turn or break lines
UNIT_TOLERANCE = 1e-9  # how far a direction may be from unit length, or a pair from a right angle


def steers(sign: str) -> bool:
    """Return whether a character steers a terminal or is half of one, and is none to be read.

    ``sign``: one character. Result: for control characters, lone surrogates, and what turns or
    breaks lines.
    """
    code = ord(sign)
    return code < 0x20 or 0x7F <= code < 0xA0 or 0xD800 <= code < 0xE000 or code in _TURNS


def printable(where: str, value: str) -> str:
    """Return a name that can be printed and written.

    Raises `SceneError` if it is no text, or holds what steers a terminal or half a character.
    """
    if not isinstance(value, str) or any(map(steers, value)):
        raise SceneError(f"{where}: its name is {short(value)}; give text of printable characters")
    return value


def whole(where: str, value: int) -> int:
    """Return a whole number, as bricks and nodes have for names.

    Raises `SceneError` if it is none, or larger than `LARGEST_NUMBER`.
    """
    try:
        number = int(value) if isinstance(value, float) else operator.index(value)
    except (TypeError, ValueError, OverflowError):
        number = LARGEST_NUMBER + 1
    if number != value or isinstance(value, bool) or abs(number) > LARGEST_NUMBER:
        raise SceneError(
            f"{where} is {short(value)}; give a whole number up to {LARGEST_NUMBER:.0e}"
        )
    return number


def wholes(where: str, values: Iterable[int]) -> tuple[int, ...]:
    """Return whole numbers.

    Raises `SceneError` if there are none to go through, or one is not whole.
    """
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise SceneError(f"{where} is {short(values)}; give whole numbers")
    return tuple(whole(where, value) for value in values)


def parts(where: str, values: Iterable[_Part], kind: type[_Part]) -> tuple[_Part, ...]:
    """Return parts of a scene if all are of one kind.

    Raises `SceneError` if one is of another kind, or there is nothing to go through.
    """
    found = tuple(values) if isinstance(values, Iterable) else (values,)
    for value in found:
        if not isinstance(value, kind):
            raise SceneError(f"{where}: give each as {kind.__name__}(...), not {short(value)}")
    return found


def short(value: object, most: int = 60) -> str:
    """Return a representation of a value that fits a line. ``most``: characters."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python writes
        text = "a number of thousands of digits"
    return text if len(text) <= most else f"{text[: most - 1]}…"


def vector(where: str, values: Iterable[float], at_least: float = -math.inf) -> Vector:
    """Return three finite floats.

    ``at_least``: the least value that is allowed. Raises `SceneError` if there are not three, or
    one is not finite or too small.
    """
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"{where} is {short(values)}; give three numbers") from error
    if not all(math.isfinite(c) and c >= at_least for c in (x, y, z)):
        bound = "" if at_least == -math.inf else f", each at least {at_least:g}"
        raise SceneError(f"{where} is {[x, y, z]}; give three finite numbers{bound}")
    return x, y, z


def positive(where: str, value: float, unit: str) -> float:
    """Return a positive finite float.

    Raises `SceneError` if it is no number, not finite or not positive.
    """
    try:
        number = float(value) if isinstance(value, int | float) else math.nan
    except OverflowError:
        number = math.inf
    if not 0 < number < math.inf:
        raise SceneError(f"{where} is {short(value)}; give a positive number of {unit}")
    return number


def axes(where: str, first: Iterable[float], second: Iterable[float]) -> tuple[Vector, Vector]:
    """Return two unit vectors at right angles.

    Raises `SceneError` if one is not of unit length, or they are not at right angles, to
    `UNIT_TOLERANCE`.
    """
    a, b = vector(where, first), vector(where, second)
    if max(abs(dot(a, a) - 1), abs(dot(b, b) - 1), abs(dot(a, b))) > UNIT_TOLERANCE:
        raise SceneError(f"{where} are {list(a)} and {list(b)}; give perpendicular unit vectors")
    return a, b


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def finite(where: str, value: float) -> float:
    """Return a finite float. Raises `SceneError` if it is no number or not finite."""
    try:
        number = float(value) if isinstance(value, int | float) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise SceneError(f"{where} is {short(value)}; give a finite number")
    return number
