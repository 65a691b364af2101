"""Solutions of instances from any source: read, and checked by arithmetic alone."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import parse_json, read_text
from seqopt.errors import ProblemError
from seqopt.instances._files import read_instance
from seqopt.instances._judge import Answer, Claim, judge_path
from seqopt.instances.model import Instance
from seqopt.judge.certificate import Certificate
from seqopt.scene._checks import short

WHAT = ("nodes", "arcs", "acts")
KEYS = ("value", "prices", "weights", "shares", "labels")


def judge_instance(
    instance: Instance | Path | str,
    solution: Path | str | Sequence[int] | Mapping[str, Any],
    bounds: Path | str | Sequence[Any] | Mapping[str, Any] | None = None,
) -> Certificate:
    """Check a bare solution of an instance, and bounds with what is to prove them.

    Parameters
    ----------
    instance : Instance, pathlib.Path or str
        File of seqopt instance; in Python also the instance.
    solution : pathlib.Path, str, sequence of int or mapping
        File with the nodes of a path, or after the word arcs its arcs, after acts its acts: text,
        CSV or JSON; in Python also what it holds, as text, nodes or a mapping with ``nodes``,
        ``arcs`` or ``acts`` and, if they are to be checked, values and bounds.
    bounds : pathlib.Path, str, sequence or mapping, optional
        JSON file with a ``value`` for every goal, the most important first, and what proves it:
        ``prices``, ``weights``, ``shares``, ``labels``; in Python also what it holds (default: the
        judge looks for a proof itself).

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
    graph = read_instance(instance) if isinstance(instance, Path | str) else instance
    found, where = _loaded(solution)
    held = found if isinstance(found, Mapping) else {"nodes": found}
    _require_known(where, held, (*WHAT, "values", "bounds", "instance"))
    named = [what for what in WHAT if what in held]
    if len(named) != 1:
        raise ProblemError(f"{where}: give one of {', '.join(WHAT)}")
    own = bounds is None or (isinstance(bounds, Sequence) and not len(bounds))
    claims, said = (held.get("bounds", ()), where) if own else _loaded(bounds)
    if isinstance(claims, Mapping):
        claims = claims.get("bounds", [claims])
    if isinstance(claims, str) or not isinstance(claims, Sequence):
        raise ProblemError(f"{said}: bounds are {short(claims)}; give a list, one for every goal")
    names, values = [goal.name for goal in graph.goals], held.get("values", ())
    if isinstance(values, Mapping):
        _require_known(f"{where}, values", values, names)
        values = [values.get(name, np.inf) for name in names]
    known = _numbers(f"{where}, values", values).tolist()
    if len(known) > len(names):
        raise ProblemError(f"{where}: {len(known)} values for {len(names)} goals; leave some out")
    answer = Answer(
        named[0],
        _numbers(f"{where}, {named[0]}", held[named[0]], whole=True),
        tuple(value if np.isfinite(value) else None for value in known),
        tuple(_claim(f"{said}, bound {k}", each) for k, each in enumerate(claims, start=1)),
    )
    return judge_path(graph, answer)


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


def _require_known(where: str, given: Mapping[Any, Any], known: Sequence[str]) -> None:
    if unknown := {*map(str, given)} - {*known}:
        raise ProblemError(f"{where}: {min(unknown)} is none of {', '.join(known)}")


def _numbers(where: str, given: Any, *, whole: bool = False, rows: bool = False) -> Any:
    """Return numbers (n,), infinite for missing ones, not empty if ``whole``; or ``rows`` (m, n).

    Booleans, texts and ragged lists are no numbers, and neither is NaN.
    """
    lists = isinstance(given, Sequence) and not isinstance(given, str) and not rows and not whole
    try:
        found = np.asarray([np.inf if v is None else v for v in given] if lists else given)
    except (TypeError, ValueError, OverflowError, RecursionError):
        found = np.array("")
    flat = found.ndim == 1 or (rows and found.ndim == 2)
    if found.size and (not flat or found.dtype.kind not in "iuf" or np.isnan(found).any()):
        raise ProblemError(f"{where} is {short(given)}: give numbers; NaN and text are none")
    if whole:
        if not len(found) or not (np.abs(found) < 2.0**63).all() or (found % 1).any():
            raise ProblemError(f"{where}: give a list of whole numbers")
        return found.astype(np.int64)
    return np.atleast_2d(found.astype(float)) if rows else found.astype(float)


def _claim(where: str, given: Any) -> Claim:
    """Parse a claim from a mapping or a number."""
    given = {"value": given} if isinstance(given, Real) else given
    if not isinstance(given, Mapping):
        raise ProblemError(f"{where}: {short(given)} is no bound; give {', '.join(KEYS)}")
    _require_known(where, given, KEYS)
    held = {name: value for name, value in given.items() if value is not None}
    prices, labels = held.get("prices", {}), held.get("labels")
    if not isinstance(prices, Mapping):
        raise ProblemError(f"{where}, prices: give them by name of a cap, or of a sum before")
    if labels is not None:
        if not isinstance(labels, Mapping) or {*labels} != {"nodes", "values"}:
            raise ProblemError(f"{where}, labels: give nodes and values")
        nodes = _numbers(f"{where}, labels, nodes", labels["nodes"], whole=True)
        labels = nodes, _numbers(f"{where}, labels, values", labels["values"], rows=True)
    arrays = {
        name: _numbers(f"{where}, {name}", held[name], rows=name == "shares")
        for name in ("weights", "shares")
        if name in held
    }
    values = _numbers(where, [*prices.values(), *([held["value"]] if "value" in held else [])])
    return Claim(
        value=float(values[-1]) if "value" in held else None,
        prices=dict(zip(map(str, prices), values.tolist(), strict=False)),
        labels=labels,
        **arrays,
    )
