"""Bare solutions and bounds as they come: files, texts, lists and mappings."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seqopt._files import read_text
from seqopt.arrays import Floats, Ints
from seqopt.errors import ProblemError
from seqopt.graph.instances.instance import Instance
from seqopt.plan.judge._bare._claims import Claim
from seqopt.scene._checks import short

WHAT = ("nodes", "arcs", "acts")
KEYS = ("value", "potentials", "cut", "prices", "weights", "shares", "labels")


class Answer(NamedTuple):
    """A path as numbers of ``nodes``, ``arcs`` or ``acts``, and what is claimed of it."""

    what: str
    numbers: Ints
    values: tuple[float | None, ...]
    bounds: tuple[Claim, ...]


def as_answer(instance: Instance, solution: Any, bounds: Any) -> Answer:
    """Return a solution with its bounds; a `ProblemError` names an entry that cannot be read."""
    found, where = _loaded(solution)
    if isinstance(found, Mapping):
        if unknown := {*found} - {*WHAT, "values", "bounds", "instance"}:
            known = f"{', '.join(WHAT)}, values and bounds"
            raise ProblemError(f"{where}: {min(map(str, unknown))} is none of {known}")
        named = [what for what in WHAT if what in found]
        if len(named) != 1:
            raise ProblemError(f"{where}: give one of {', '.join(WHAT)}")
        what, numbers = named[0], found[named[0]]
        own = found.get("bounds", ())
        values = found.get("values", ())
    else:
        what, numbers, own, values = "nodes", found, (), ()
    claims, said = (own, where) if _is_empty(bounds) else _loaded(bounds)
    if isinstance(claims, Mapping):
        claims = claims.get("bounds", claims)
    claims = [claims] if isinstance(claims, Mapping) else claims
    return Answer(
        what,
        _whole(numbers, f"{where}, {what}"),
        _values(instance, values, where),
        tuple(_claim(each, f"{said}, bound {k}") for k, each in enumerate(claims, start=1)),
    )


def _is_empty(bounds: Any) -> bool:
    return isinstance(bounds, Sequence) and not len(bounds)


def _loaded(given: Any) -> tuple[Any, str]:
    """Return what a file or a text holds, or what is given; and what to call it."""
    if isinstance(given, Path):
        return _parsed(read_text(given), str(given)), str(given)
    if isinstance(given, str):
        return _parsed(given, "the solution"), "the solution"
    return given, "the solution"


def _parsed(text: str, where: str) -> Any:
    """Return what a text holds: JSON, or numbers after a word that says of what."""
    if text.lstrip()[:1] in ("{", "["):
        try:
            return json.loads(text)
        except ValueError as error:
            raise ProblemError(f"{where}: it is no JSON ({error})") from None
    words = re.split(r"[\s,;]+", text.strip())
    what = words[0].lower().rstrip(":").removesuffix("s") + "s"
    numbers = words[1:] if what in WHAT else words
    for word in numbers:
        if not re.fullmatch(r"\d+", word):
            raise ProblemError(f"{where}: {short(word)} is no number of a node; give 0, 1, 2 …")
    return {what if what in WHAT else "nodes": [int(word) for word in numbers]}


def _whole(given: Any, where: str) -> Ints:
    """Return whole numbers from 0."""
    try:
        found = np.asarray(given)
        whole = found.astype(np.int64)
    except (TypeError, ValueError, OverflowError):
        raise ProblemError(f"{where}: give a list of whole numbers") from None
    if found.ndim != 1 or not len(found) or not np.array_equal(found, whole):
        raise ProblemError(f"{where}: give a list of whole numbers")
    return whole


def _values(instance: Instance, given: Any, where: str) -> tuple[float | None, ...]:
    """Return claimed values in the order of goals, None where none is claimed."""
    names = [goal.name for goal in instance.goals]
    if isinstance(given, Mapping):
        if unknown := {*given} - {*names}:
            raise ProblemError(f"{where}: {min(unknown)} is no goal; give {', '.join(names)}")
        return tuple(float(given[n]) if n in given else None for n in names)
    return tuple(_floats(given, f"{where}, values").tolist())


def _floats(given: Any, where: str) -> Floats:
    """Return numbers (n,), infinite where there is none."""
    try:
        found = np.array([np.inf if v is None else float(v) for v in given], dtype=float)
    except (TypeError, ValueError):
        raise ProblemError(f"{where}: give a list of numbers") from None
    if np.isnan(found).any():
        raise ProblemError(f"{where}: NaN is no number")
    return found


def _claim(given: Any, where: str) -> Claim:
    """Return a claim of a mapping, or of a number alone."""
    if isinstance(given, int | float):
        given = {"value": given}
    if isinstance(given, Claim):
        return given
    if not isinstance(given, Mapping):
        raise ProblemError(f"{where}: {short(given)} is no bound; give {', '.join(KEYS)}")
    if unknown := {*given} - {*KEYS}:
        raise ProblemError(f"{where}: {min(map(str, unknown))} is none of {', '.join(KEYS)}")
    value, prices = given.get("value"), given.get("prices", {})
    if not isinstance(prices, Mapping):
        raise ProblemError(f"{where}, prices: give them by name of a cap, or of a sum before")
    arrays = {
        name: None if given.get(name) is None else _floats(given[name], f"{where}, {name}")
        for name in ("potentials", "weights")
    }
    shares = None if given.get("shares") is None else _table(given["shares"], f"{where}, shares")
    cut = None if given.get("cut") is None else _whole(given["cut"], f"{where}, cut")
    labels = None if given.get("labels") is None else _labels(given["labels"], f"{where}, labels")
    number = None if value is None else float(_floats([value], where)[0])
    return Claim(number, **arrays, cut=cut, prices=dict(prices), shares=shares, labels=labels)


def _table(given: Any, where: str) -> Floats:
    """Return rows of numbers; one row may be given alone."""
    try:
        return np.atleast_2d(np.array(given, dtype=float))
    except (TypeError, ValueError):
        raise ProblemError(f"{where}: give rows of as many numbers each") from None


def _labels(given: Any, where: str) -> tuple[Ints, Floats]:
    """Return labels: nodes and a row of numbers for each."""
    if not isinstance(given, Mapping) or {*given} != {"nodes", "values"}:
        raise ProblemError(f"{where}: give nodes and values")
    return _whole(given["nodes"], f"{where}, nodes"), _table(given["values"], f"{where}, values")
