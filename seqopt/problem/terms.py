"""Terms of criteria: names of responses with weights and scales."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Real
from typing import Any, TypeVar

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import ProblemError
from seqopt.problem.scales import SceneFacts
from seqopt.responses.quantities import robot_response
from seqopt.scene.checks import short

Term = tuple[Any, ...]  # a name and its numbers
Number = TypeVar("Number")


def scale_of(facts: SceneFacts, response: str, given: float | None) -> float:
    """Return the scale of a response: that which is given, or the scene's.

    Result: SI units. Raises `ProblemError` if none is given and the scene's methods give none.
    """
    if given is not None:
        return given
    scales = facts.reference
    if response not in scales:
        raise ProblemError(f"{response} has no scale of its own; give one, or take F_largest")
    return scales[response] or 1.0  # what every method keeps at zero


def named(name: str, facts: SceneFacts, given: Sequence[float | None]) -> str:
    """Return the name of a criterion, which says where its scales are not those of fixed methods.

    ``given``: its scales before it was posed, None where it takes them from the scene.
    """
    return name + facts.basis if None in given else name


def known(number: Number | None, criterion: str) -> Number:
    """Return a number that must not be open any more.

    ``criterion``: whose number it is. Result: the number. Raises `ProblemError` if it is None: the
    criterion was not posed for a scene.
    """
    if number is None:
        raise ProblemError(f"criterion {criterion}: it is not posed for a scene; use seqopt.pose")
    return number


def present(values: Floats) -> Floats:
    """Return the values, or zeros where the robot does not grip in any choice.

    ``values`` ((C,) or (C, D) float). Result ((C,) or (C, D) float).
    """
    return np.zeros_like(values) if np.isnan(values).all() else values


def spell_out(terms: tuple[Term, ...], robots: Sequence[str]) -> tuple[Term, ...]:
    """Return terms in which ``F_each`` stands once for every robot; all numbers are positive.

    ``robots``: their names. Raises `ProblemError` if there is no term, or a number of one is not
    positive and finite.
    """
    if not terms:
        raise ProblemError("a criterion of no response; name at least one, as T_max")
    out: list[Term] = []
    for term in terms:
        for number in term[1:]:
            if number is not None and not (isinstance(number, Real) and 0 < float(number) < np.inf):
                raise ProblemError(
                    f"criterion: {term[0]} has the weight, scale or rounding "
                    f"{short(number)}; give a positive number"
                )
        names = [robot_response(robot) for robot in robots] if term[0] == "F_each" else [term[0]]
        out += [(name, *term[1:]) for name in names]
    return tuple(out)


def equal(*names: str) -> tuple[tuple[str, float], ...]:
    """Return equally weighted terms of a `RankSum`.

    ``*names``: responses. Result (tuple of (str, float)): each with weight 1.
    """
    return tuple((name, 1.0) for name in names)
