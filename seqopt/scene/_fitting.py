"""Which numbers fit where those that words give make no scene: near ones, each of them tried."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from seqopt.errors import SceneError

PATIENCE = 3.0  # s
COUNTS = range(1, 61)  # how far from a number that is given others are tried
SHARES = [1.04**k for k in range(1, 37)]  # of a length, up to four times and a quarter of it
DIGITS = 3
WHOLE = ("length", "height")  # of whole bricks: their own error says which are


def which_fit(make: Callable[[Mapping[str, Any]], object], given: Mapping[str, Any]) -> str:
    """Return the nearest number, by name, with which words make a scene; as the end of a line.

    ``make``: makes it of the numbers by name; each number is changed alone.
    """
    end = time.perf_counter() + PATIENCE

    def fits(name: str, value: Any) -> bool:
        try:
            make({**given, name: value})
        except (SceneError, OverflowError, ValueError):
            return False
        return True

    found = []
    for name, value in given.items():
        for other in () if name in WHOLE else _near(value):
            if time.perf_counter() > end:
                break
            if fits(name, other):
                found.append(f"{name}={_said(_nearest(name, value, other, fits))}")
                break
    return f"; it fits with {' or '.join(found)}" if found else ""


def _near(value: Any) -> Iterator[Any]:
    """Yield values near one, the nearest first."""
    if isinstance(value, int):
        yield from (value + sign * k for k in COUNTS for sign in (1, -1) if value + sign * k > 0)
    elif isinstance(value, float):
        yield from (_rounded(value * each) for share in SHARES for each in (1 / share, share))
    elif isinstance(value, tuple):  # three lengths, of which the first is that of a brick
        yield from ((other, *value[1:]) for other in _near(value[0]))


def _nearest(name: str, value: Any, other: Any, fits: Callable[[str, Any], bool]) -> Any:
    """Return the value nearest to one that does not fit, up to its digits, from one that does."""
    if isinstance(value, tuple):
        rest = value[1:]
        return (_nearest(name, value[0], other[0], lambda n, v: fits(n, (v, *rest))), *rest)
    while isinstance(value, float):
        middle = _rounded((value + other) / 2)
        if middle in (value, other):
            break
        value, other = (value, middle) if fits(name, middle) else (middle, other)
    return other


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _said(value: Any) -> str:
    return "x".join(f"{each:g}" for each in value) if isinstance(value, tuple) else f"{value:g}"
