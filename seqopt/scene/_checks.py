"""Checked vectors and numbers, the atoms of a scene, and numbers near those that make none."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from functools import partial
from numbers import Real
from typing import Any, TypeVar

import numpy as np

from seqopt.arrays import Floats, Vector
from seqopt.errors import SceneError, did_you_mean


def units(vectors: Floats) -> Floats:
    """Return the unit vectors along vectors (..., m)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def frames(first: Floats, second: Floats) -> Floats:
    """Return right-handed axes (..., 3, 3), as rows, from the first two of them (..., 3)."""
    return np.stack([first, second, np.cross(first, second)], axis=-2)


def as_vectors(points: Floats) -> tuple[Vector, ...]:
    """Return the rows of an array (k, 3) as tuples."""
    return tuple((x, y, z) for x, y, z in points.tolist())


def as_vector(values: Floats) -> Vector:
    """Return three numbers of an array as a tuple."""
    x, y, z = values.tolist()
    return x, y, z


Reader = tuple[Callable[[str], Any], str]  # how text is read, or ValueError; what is wanted


def in_words(
    where: str, parts: Iterable[str], known: Mapping[str, Reader], example: str = ""
) -> dict[str, Any]:
    """Return values by name from parts ``name=value``, each name once.

    ``known``: how the value of each name is read; ``example``: ends messages about names.
    """
    found: dict[str, Any] = {}
    for part in parts:
        key, _, text = part.strip().partition("=")
        if key not in known or key in found:
            why = f"is none of its numbers{did_you_mean(key, known)}"
            what = "is given twice" if key in found else why
            raise SceneError(f"{where}: {key!r} {what}; give {', '.join(known)}{example}")
        read, wanted = known[key]
        try:
            found[key] = read(text)
        except ValueError:
            raise SceneError(f"{where}: {key} is {short(text)}; give {wanted}") from None
    return found


_Part = TypeVar("_Part")
LARGEST_NUMBER = 10**15  # of a brick or node: what arrays of numbers hold without loss
LETTERS = "VLR"  # how bricks of an arch lie
MOST_BRICKS = 20_000  # of a generated scene
_TURNS = {*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x2028, 0x2029}  # turn or break lines


def steers(sign: str) -> bool:
    """Return whether a character steers a terminal, turns or breaks lines, or is half of one."""
    code = ord(sign)
    return code < 0x20 or 0x7F <= code < 0xA0 or 0xD800 <= code < 0xE000 or code in _TURNS


def settle(value: object, **content: object) -> None:
    """Set fields of a frozen value; its dictionary, if asked for, would slow every later access."""
    for name, part in content.items():
        object.__setattr__(value, name, part)


def check(value: Any, where: str, **checks: Callable[[str, Any], object]) -> None:
    """Set fields of a frozen value to results of checks, which get the name of the field.

    A field whose default is None may be left out: then it is not checked.
    """
    known = {field.name: field.default for field in fields(value)}
    for name, checked in checks.items():
        given = getattr(value, name)
        if given is not None or known[name] is not None:
            settle(value, **{name: checked(f"{where}: {name}", given)})


def one_of(where: str, value: str | None, known: Iterable[str]) -> str:
    """Return a word that is among those that are known."""
    if not isinstance(value, str) or value not in known:
        raise SceneError(f"{where} is {short(value)}; give one of {', '.join(known)}")
    return value


def letters(where: str, pattern: str) -> str:
    """Return a pattern that is made of `LETTERS`."""
    if not isinstance(pattern, str) or not pattern or {*pattern} - {*LETTERS}:
        raise SceneError(f"{where} is {short(pattern)}; give letters of {', '.join(LETTERS)}")
    return pattern


def kind_of(where: str, value: object, kind: type[_Part]) -> _Part:
    """Return a value of a class."""
    if not isinstance(value, kind):
        raise SceneError(f"{where} is {short(value)}; give a {kind.__name__}")
    return value


def printable(where: str, value: str) -> str:
    """Return a name that can be printed and written, without control characters."""
    if not isinstance(value, str) or any(map(steers, value)):
        raise SceneError(f"{where}: its name is {short(value)}; give text of printable characters")
    return value


UNIT = 1e-9  # how far a direction may be from unit length, or a pair from a right angle


def unit_axes(value: object, where: str, first: str, second: str) -> None:
    """Require two fields that are unit vectors at right angles."""
    where = f"{where}: {first} and {second}"
    a, b = (vector(where, getattr(value, name)) for name in (first, second))
    size, other, cosine = (
        math.fsum(x * y for x, y in zip(*pair, strict=True)) for pair in ((a, a), (b, b), (a, b))
    )
    if max(abs(size - 1), abs(other - 1), abs(cosine)) > UNIT:
        raise SceneError(f"{where} are {list(a)} and {list(b)}; give perpendicular unit vectors")
    settle(value, **{first: a, second: b})


def whole(where: str, value: int) -> int:
    """Return a whole number up to `LARGEST_NUMBER`, as bricks and nodes have for names."""
    try:
        number = int(value) if isinstance(value, float) else operator.index(value)
    except (TypeError, ValueError, OverflowError):
        number = LARGEST_NUMBER + 1
    if number != value or isinstance(value, bool) or abs(number) > LARGEST_NUMBER:
        raise SceneError(
            f"{where} is {short(value)}; give a whole number up to {LARGEST_NUMBER:.0e}"
        )
    return number


def whole_between(where: str, value: int, least: int, most: int = MOST_BRICKS) -> int:
    """Return a whole number, of no type of decimals, between limits."""
    try:
        number = least - 1 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = least - 1
    if not least <= number <= most:
        raise SceneError(f"{where} is {short(value)}; give a whole number from {least} to {most}")
    return number


def rows(where: str, values: Iterable[_Part], what: str = "a list") -> tuple[_Part, ...]:
    """Return the items of an iterable; text is refused."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise SceneError(f"{where} is {short(values)}; give {what}")
    return tuple(values)


def wholes(where: str, values: Iterable[int]) -> tuple[int, ...]:
    """Return whole numbers, as `whole` returns one."""
    return tuple(whole(where, value) for value in rows(where, values, "whole numbers"))


def short(value: object, most: int = 60) -> str:
    """Return a representation of a value that fits a line. ``most``: characters."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python writes
        text = "a number of thousands of digits"
    return text if len(text) <= most else f"{text[: most - 1]}…"


def vector(where: str, values: Iterable[float], at_least: float = -math.inf) -> Vector:
    """Return three finite floats, none below ``at_least``."""
    try:
        given = [*values]
        x, y, z = map(as_float, given)
    except (TypeError, ValueError) as error:
        raise SceneError(f"{where} is {short(values)}; give three numbers") from error
    if not all(math.isfinite(c) and c >= at_least for c in (x, y, z)):
        bound = "" if at_least == -math.inf else f", each at least {at_least:g}"
        raise SceneError(f"{where} is {short(given)}; give three finite numbers{bound}")
    return x, y, z


def sizes(where: str, values: Iterable[float]) -> Vector:
    """Return three positive lengths, m."""
    x, y, z = (length(where, side) for side in vector(where, values))
    return x, y, z


def as_float(value: object) -> float:
    """Return a number as a float: NaN if it is none, infinity if it is too large."""
    try:
        real = isinstance(value, Real) and not isinstance(value, bool)
        return float(value) if real else math.nan  # type: ignore[arg-type]
    except OverflowError:
        return math.inf


def finite(
    where: str, value: float, least: float = -math.inf, wanted: str = "a finite number"
) -> float:
    """Return a finite float, at least ``least``. ``wanted``: accepted values, for messages."""
    number = as_float(value)
    if not math.isfinite(number) or number < least:
        raise SceneError(f"{where} is {short(value)}; give {wanted}")
    return number


def positive(where: str, value: float, unit: str) -> float:
    """Return a positive finite float."""
    return finite(where, value, math.ulp(0.0), f"a positive number of {unit}")


not_negative = partial(finite, least=0.0, wanted="a number that is not negative")
stiffness = partial(vector, at_least=0.0)
length, density = partial(positive, unit="m"), partial(positive, unit="kg/m³")
