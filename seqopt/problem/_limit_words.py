"""Limits in words, the same on the command line and in Python: ``F_largest=300``."""

from __future__ import annotations

import math
from collections.abc import Sequence

from seqopt._registry import registered
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.filters import Filter
from seqopt.problem.requirements import LIFTED, LINEAR_RANGE, Limit, as_limits, payload_limits
from seqopt.responses._choices import CHOICE_RESPONSES
from seqopt.responses.quantities import TOLERANCE
from seqopt.scene.scene import Scene

LARGEST = 1e100  # number: products of larger ones overflow
NAMES = (*CHOICE_RESPONSES, TOLERANCE)
_LENGTHS = {"mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9, "m": 1.0}


def number_word(text: str, where: str, *, zero: bool = False) -> float:
    """Return a positive number, or zero too; ``where`` is the argument, for messages."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value <= LARGEST and not (zero and value == 0):
        most = f" up to {LARGEST:g}" if value > LARGEST else ""
        raise ProblemError(f"{where}: {text!r} is not a positive number{' or zero' * zero}{most}")
    return value


def length_word(text: str, where: str) -> float:
    """Return a positive length, m, from words such as ``0.4mm``; ``where``: for messages."""
    unit = next((unit for unit in _LENGTHS if text.endswith(unit)), "")
    return number_word(text.removesuffix(unit), where) * _LENGTHS.get(unit, 1.0)


def split_word(text: str) -> tuple[str, str]:
    """Return a response, whose brackets may hold anything, and the number after ``=``, if any."""
    end = text.rfind("]") + 1
    name, _, number = text[end:].partition("=")
    return text[:end] + name, number


def parse_limits(
    given: Sequence[str | Limit | Filter] | str | Limit | Filter, scene: Scene, where: str = "limit"
) -> tuple[Limit | Filter, ...]:
    """Return limits and filters that are given as such, or in words.

    Words are ``payload``, of the scene's robots, ``RESPONSE=VALUE``, SI units,
    ``linear_range=SHARE``, or ``any`` to lift it, and names of filters that were registered.
    ``where``: for messages.
    """
    several = (given,) if isinstance(given, str | Limit | Filter) else given
    if not isinstance(several, Sequence):
        return as_limits(several)
    out: list[Limit | Filter] = []
    for each in several:
        if isinstance(each, Filter):
            out.append(each)
        elif not isinstance(each, str):
            out += as_limits([each])
        elif each == "payload":
            out += payload_limits(scene)
        elif "=" not in each and each in (own := registered(Filter)):
            out.append(own[each])
        else:
            out.append(_limit_of(each, where))
    return tuple(out)


def _limit_of(text: str, where: str) -> Limit:
    """Return a limit from ``NAME=VALUE``."""
    (name, value), said = split_word(text), f"{where} {text}"
    if name == "payload":
        raise ProblemError(f"{said}: give payload alone, and values with --payload")
    if name == LINEAR_RANGE and value == LIFTED:
        return Limit(name, math.inf)
    if name == LINEAR_RANGE:
        try:
            return Limit(name, number_word(value, said))
        except ProblemError as error:
            hint = f"give a share of it, as 0.5, or {LIFTED} to lift it"
            raise ProblemError(f"{error}; {hint}") from None
    if name not in (*NAMES, "F_each") and not name.startswith("F_"):
        names = ("payload", *NAMES, LINEAR_RANGE)
        hint = did_you_mean(name, names)
        raise ProblemError(f"{where} {name} does not exist{hint}; give {', '.join(names)}, F_ROBOT")
    return Limit(name, (length_word if name == TOLERANCE else number_word)(value, said))
