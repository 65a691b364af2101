"""Solutions of instances from any source: read, and checked by arithmetic alone."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import parse_json, read_text
from seqopt.arrays import Floats, Ints
from seqopt.errors import ProblemError
from seqopt.graph.instance import Instance
from seqopt.judge.arithmetic import Answer, Claim, judge_path
from seqopt.judge.certificate import Certificate
from seqopt.scene._checks import as_float, short

WHAT = ("nodes", "arcs", "acts")
KEYS = ("value", "prices", "weights", "shares", "labels")


def judge_instance(instance: Instance, solution: Any, bounds: Any = ()) -> Certificate:
    """Check a bare solution of an instance, and bounds with what is to prove them.

    Parameters
    ----------
    instance : Instance
        From `seqopt.read_instance` or `seqopt.compile_instance`.
    solution : path, str, sequence of int or mapping
        A file (JSON, CSV or plain text), or what it holds: the nodes of a path, or a mapping with
        ``nodes``, ``arcs`` or ``acts`` and, if they are to be checked, ``values`` and ``bounds``.
    bounds : path, sequence or mapping, optional
        For every goal, the most important first, a mapping: ``value`` and what proves it:
        ``prices``, ``weights``, ``shares``, ``labels``.

    Returns
    -------
    Certificate
        Values and lower bounds: by what is given; where nothing is, by potentials, a cut or
        multipliers that the judge finds itself. A bound without proof counts as claimed.

    Raises
    ------
    FileError, ProblemError
        If a file or an entry cannot be read.
    SolverError
        If the path does not lead from node 0 to an end, exceeds a cap or has other values
        than claimed; or if a bound exceeds the one that its multipliers prove.

    Examples
    --------
    >>> import seqopt
    >>> instance = seqopt.compile_instance(seqopt.optimize("arch25").problem)
    >>> plan = seqopt.solve(instance)
    >>> proof = seqopt.judge_instance(instance, plan.nodes)
    >>> round(proof.objective, 5), proof.gap
    (657.46456, 0.0)
    """
    return judge_path(instance, as_answer(instance, solution, bounds))


def as_answer(instance: Instance, solution: Any, bounds: Any) -> Answer:
    """Parse a solution with its bounds; raise a `ProblemError` that names an invalid entry."""
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
    none = isinstance(bounds, Sequence) and not len(bounds)
    claims, said = (own, where) if none else _loaded(bounds)
    if isinstance(claims, Mapping):
        claims = claims.get("bounds", claims)
    claims = [claims] if isinstance(claims, Mapping | Claim) else claims
    if isinstance(claims, str) or not isinstance(claims, Sequence):
        raise ProblemError(f"{said}: bounds are {short(claims)}; give a list, one for every goal")
    return Answer(
        what,
        _whole(numbers, f"{where}, {what}"),
        _values(instance, values, where),
        tuple(_claim(each, f"{said}, bound {k}") for k, each in enumerate(claims, start=1)),
    )


def _loaded(given: Any) -> tuple[Any, str]:
    """Return the content of a file or a text, or a given value; and its name in messages.

    A text is JSON, or numbers after a word that names their kind.
    """
    where = str(given) if isinstance(given, Path) else "the solution"
    text = read_text(given) if isinstance(given, Path) else given
    if not isinstance(text, str):
        return given, where
    if text.lstrip()[:1] in ("{", "["):
        return parse_json(text, where, ProblemError), where
    words = re.split(r"[\s,;]+", text.strip())
    what = words[0].lower().rstrip(":").removesuffix("s") + "s"
    numbers = words[1:] if what in WHAT else words
    for word in numbers:
        if not re.fullmatch(r"[0-9]{1,18}", word):
            raise ProblemError(f"{where}: {short(word)} is no number of a node; give 0, 1, 2 …")
    return {what if what in WHAT else "nodes": [int(word) for word in numbers]}, where


def _whole(given: Any, where: str) -> Ints:
    """Return an integer array (n,), not empty; raise a `ProblemError` for other values."""
    found = _array(given)
    if found is None or found.ndim != 1 or not len(found) or (found % 1).any():
        raise ProblemError(f"{where}: give a list of whole numbers")
    return found.astype(np.int64)


def _array(given: Any) -> np.ndarray | None:
    """Return an array of numbers below 2**63 in size; None for other values.

    Booleans, strings and ragged lists are no numbers.
    """
    try:
        found = np.asarray(given)
    except (TypeError, ValueError, OverflowError, RecursionError):
        return None
    if found.dtype.kind not in "iuf" or not (np.abs(found) < 2.0**63).all():  # NaN is none
        return None
    return found


def _values(instance: Instance, given: Any, where: str) -> tuple[float | None, ...]:
    """Return claimed values by goal, None without a claim."""
    names = [goal.name for goal in instance.goals]
    if isinstance(given, Mapping):
        if unknown := {*given} - {*names}:
            first = min(map(str, unknown))
            raise ProblemError(f"{where}: {first} is no goal; give {', '.join(names)}")
        return tuple(
            float(_floats([given[n]], f"{where}, values, {n}")[0]) if n in given else None
            for n in names
        )
    found = _floats(given, f"{where}, values")
    if len(found) > len(names):
        raise ProblemError(f"{where}: {len(found)} values for {len(names)} goals; leave some out")
    return tuple(found.tolist())


def _floats(given: Any, where: str) -> Floats:
    """Return numbers (n,), infinite for missing ones."""
    if isinstance(given, str | bytes | Mapping) or not isinstance(given, Iterable):
        raise ProblemError(f"{where}: give a list of numbers")
    found = np.array([np.inf if v is None else as_float(v) for v in given], dtype=float)
    if np.isnan(found).any():
        raise ProblemError(f"{where}: give a list of numbers; NaN and text are none")
    return found


def _claim(given: Any, where: str) -> Claim:
    """Parse a claim from a mapping or a number."""
    if isinstance(given, Real):
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
    weights = given.get("weights")
    weights = None if weights is None else _floats(weights, f"{where}, weights")
    shares = None if given.get("shares") is None else _table(given["shares"], f"{where}, shares")
    labels = None
    if (found := given.get("labels")) is not None:
        said = f"{where}, labels"
        if not isinstance(found, Mapping) or {*found} != {"nodes", "values"}:
            raise ProblemError(f"{said}: give nodes and values")
        nodes, rows = _whole(found["nodes"], f"{said}, nodes"), found["values"]
        labels = nodes, _table(rows, f"{said}, values")
    number = None if value is None else float(_floats([value], where)[0])
    named = {str(n): float(_floats([p], f"{where}, prices")[0]) for n, p in prices.items()}
    return Claim(number, prices=named, weights=weights, shares=shares, labels=labels)


def _table(given: Any, where: str) -> Floats:
    """Return rows of numbers (m, n); a single row may be one-dimensional."""
    found = _array(given)
    if found is None or not 1 <= found.ndim <= 2:
        raise ProblemError(f"{where}: give rows of as many numbers each")
    return np.atleast_2d(found.astype(float))
