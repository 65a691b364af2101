"""JSON of other programs, read strictly: anything unexpected is an error of one line."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.checks import short

Entry = dict[str, Any]
LARGEST = 1e15  # number: products of coordinates beyond lose all digits


def parse_json(text: str, source: str) -> Any:
    """Return a JSON document.

    Raises `SceneError` if it is no JSON, nested too deep, or holds numbers that no float can be.
    """
    try:
        return json.loads(text, parse_constant=_refuse)
    except json.JSONDecodeError as error:
        raise SceneError(f"{source}: not JSON, line {error.lineno}: {error.msg}") from error
    except RecursionError as error:
        raise SceneError(f"{source}: nested too deep for an assembly; give one") from error
    except SceneError as error:
        raise SceneError(f"{source}: {error}") from error
    except ValueError as error:  # an integer of thousands of digits
        raise SceneError(f"{source}: a number has too many digits; give fewer") from error


def _refuse(name: str) -> float:
    raise SceneError(f"{name} stands where a number should; give finite numbers")


def mapping(where: str, value: object) -> Entry:
    """Return an object of a document."""
    if not isinstance(value, dict):
        raise SceneError(f"{where} is {short(value)}; an object is expected")
    return value


def entry(where: str, holder: object, *keys: str) -> Any:
    """Return what stands under the first of some keys that there is.

    Raises `SceneError` if there is none of them, or the holder is no object.
    """
    found = mapping(where, holder)
    for key in keys:
        if key in found:
            return found[key]
    raise SceneError(f"{where}: {' or '.join(keys)} is missing")


def listing(where: str, value: object, most: int = 10**7) -> list[Any]:
    """Return a list of a document.

    ``most``: entries that it may have. Raises `SceneError` if it is something else, or longer.
    """
    if not isinstance(value, list):
        raise SceneError(f"{where} is {short(value)}; a list is expected")
    if len(value) > most:
        raise SceneError(f"{where} has {len(value)} entries; {most} is the most")
    return value


def number(where: str, value: object) -> float:
    """Return a finite number of a document, up to `LARGEST`."""
    try:
        found = float(value) if isinstance(value, int | float) else math.nan
    except OverflowError:
        found = math.inf
    if not abs(found) <= LARGEST or isinstance(value, bool):
        raise SceneError(
            f"{where} is {short(value)}; a finite number up to {LARGEST:g} is expected"
        )
    return found


def point(where: str, value: object) -> Floats:
    """Return a point of a document: three numbers, as they are or in an object of COMPAS.

    Result (3,).
    """
    plain = value
    while isinstance(plain, dict):
        plain = entry(where, plain, "data", "value", "point")
    row = listing(where, plain)
    if len(row) != 3:
        raise SceneError(f"{where} is {short(value)}; three numbers are expected")
    return np.array([number(where, x) for x in row])
