"""The judge of instances: a path recomputed arc by arc, and bounds checked by arithmetic alone."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seqopt._files import parse_json, read_text
from seqopt.arrays import Floats, Ints
from seqopt.errors import ProblemError, SolverError
from seqopt.graph.instance import PEAK, SUM, TAIL, TIME, Instance, _Target, _target_sums
from seqopt.judge._claims import ABOVE, Claim, first_stage, next_stage, proven, within_caps
from seqopt.judge._twin import twin_of
from seqopt.judge.certificate import TOLERANCE, Certificate
from seqopt.problem.problem import Measure
from seqopt.scene._checks import as_float, short

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
    claims = [claims] if isinstance(claims, Mapping | Claim) else claims
    if isinstance(claims, str) or not isinstance(claims, Sequence):
        raise ProblemError(f"{said}: bounds are {short(claims)}; give a list, one for every goal")
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
        return parse_json(text, where, ProblemError)
    words = re.split(r"[\s,;]+", text.strip())
    what = words[0].lower().rstrip(":").removesuffix("s") + "s"
    numbers = words[1:] if what in WHAT else words
    for word in numbers:
        if not re.fullmatch(r"[0-9]{1,18}", word):
            raise ProblemError(f"{where}: {short(word)} is no number of a node; give 0, 1, 2 …")
    return {what if what in WHAT else "nodes": [int(word) for word in numbers]}


def _whole(given: Any, where: str) -> Ints:
    """Return whole numbers from 0."""
    found = _array(given)
    if found is None or found.ndim != 1 or not len(found) or (found % 1).any():
        raise ProblemError(f"{where}: give a list of whole numbers")
    return found.astype(np.int64)


def _array(given: Any) -> np.ndarray | None:
    """Return numbers as an array, none of them beyond what whole numbers hold; None if not all are.

    Nothing but numbers counts as one, nor does a list whose rows differ in length.
    """
    try:
        found = np.asarray(given)
    except (TypeError, ValueError, OverflowError, RecursionError):
        return None
    if found.dtype.kind not in "iuf" or not (np.abs(found) < 2.0**63).all():  # NaN is none
        return None
    return found


def _values(instance: Instance, given: Any, where: str) -> tuple[float | None, ...]:
    """Return claimed values in the order of goals, None where none is claimed."""
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
    """Return numbers (n,), infinite where there is none."""
    if isinstance(given, str | bytes | Mapping) or not isinstance(given, Iterable):
        raise ProblemError(f"{where}: give a list of numbers")
    found = np.array([np.inf if v is None else as_float(v) for v in given], dtype=float)
    if np.isnan(found).any():
        raise ProblemError(f"{where}: give a list of numbers; NaN and text are none")
    return found


def _claim(given: Any, where: str) -> Claim:
    """Return a claim of a mapping, or of a number alone."""
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
    arrays = {
        name: None if given.get(name) is None else _floats(given[name], f"{where}, {name}")
        for name in ("potentials", "weights")
    }
    shares = None if given.get("shares") is None else _table(given["shares"], f"{where}, shares")
    cut = None if given.get("cut") is None else _whole(given["cut"], f"{where}, cut")
    labels = None if given.get("labels") is None else _labels(given["labels"], f"{where}, labels")
    number = None if value is None else float(_floats([value], where)[0])
    named = {str(n): float(_floats([p], f"{where}, prices")[0]) for n, p in prices.items()}
    return Claim(number, **arrays, cut=cut, prices=named, shares=shares, labels=labels)


def _table(given: Any, where: str) -> Floats:
    """Return rows of numbers; one row may be given alone."""
    found = _array(given)
    if found is None or not 1 <= found.ndim <= 2:
        raise ProblemError(f"{where}: give rows of as many numbers each")
    return np.atleast_2d(found.astype(float))


def _labels(given: Any, where: str) -> tuple[Ints, Floats]:
    """Return labels: nodes and a row of numbers for each."""
    if not isinstance(given, Mapping) or {*given} != {"nodes", "values"}:
        raise ProblemError(f"{where}: give nodes and values")
    return _whole(given["nodes"], f"{where}, nodes"), _table(given["values"], f"{where}, values")


BELOW = 1e-9  # by how much a path must be better, over the size of the value


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
        ``potentials``, ``cut``, ``prices``, ``weights``, ``shares``, ``labels``.

    Returns
    -------
    Certificate
        Values, and what no path stays below: by what is given; where nothing is, by potentials, a
        cut or prices that the judge finds itself. A bound without proof counts as claimed.

    Raises
    ------
    FileError, ProblemError
        If a file or an entry cannot be read.
    SolverError
        If the path does not lead from node 0 to an end, exceeds a cap or is worth something else
        than is claimed; or if a bound is higher than what is to prove it.

    Examples
    --------
    >>> import seqopt
    >>> instance = seqopt.compile_instance(seqopt.optimize("arch25").problem)
    >>> plan = seqopt.solve(instance)
    >>> proof = seqopt.judge_instance(instance, plan.nodes)
    >>> round(proof.objective, 5), proof.gap
    (657.46456, 0.0)
    """
    answer = as_answer(instance, solution, bounds)
    path = _walked(instance, answer)
    values = tuple(_value(instance, goal, path) for goal in instance.goals)
    for goal, value, claimed in zip(instance.goals, values, answer.values, strict=False):
        if claimed is not None and not abs(value - claimed) <= TOLERANCE * abs(value):
            raise SolverError(f"{goal.name} is {value:.9g}, not {claimed:.9g} as claimed")
    spent = _spent(instance, path)
    found = _bounds(instance, values, answer.bounds)
    gaps = [
        max((v - b) / (abs(v) or 1.0) for v, b in zip(values, each, strict=True)) for each in found
    ]
    return Certificate(values, found[0], gaps[0], gaps[1], spent, instance.nodes)


class _Walk(NamedTuple):
    """A path: its arcs, and where times are asked when its last act ends."""

    arcs: Ints
    ends: float


def _walked(instance: Instance, answer: Answer) -> _Walk:
    """Return a path that leads from the start to an end, or say where it breaks."""
    acts = None
    if answer.what == "acts":
        if instance.timed is None:
            raise SolverError("acts: no times are asked of this instance; give nodes or arcs")
        acts = _in_range(answer.numbers, len(instance.timed.move), "act")
        arcs = instance.timed.move[acts]
    elif answer.what == "arcs":
        arcs = _in_range(answer.numbers, instance.arcs, "arc")
    else:
        arcs = _arcs_of(instance, _in_range(answer.numbers, instance.nodes, "node"))
    at = 0
    for step, arc in enumerate(arcs.tolist(), start=1):
        if instance.source[arc] != at:
            where = f"{instance.source[arc]} to {instance.target[arc]}"
            raise SolverError(
                f"step {step}: arc {arc} leads from {where}; the path is at node {at}"
            )
        at = int(instance.target[arc])
    if not instance.ends[at]:
        raise SolverError(f"the path stops at node {at}, where none may end")
    ends = 0.0
    if instance.timed is not None and instance.asks_time:
        twin = twin_of(Measure.MAKESPAN)
        ends = np.nan if twin is None else twin.path_value(instance.timed, arcs, acts)
    return _Walk(arcs, ends)


def _in_range(numbers: Ints, count: int, what: str) -> Ints:
    wrong = numbers[(numbers < 0) | (numbers >= count)]
    if len(wrong):
        raise SolverError(f"{what} {wrong[0]} does not exist; they are 0 to {count - 1}")
    return numbers


def _arcs_of(instance: Instance, nodes: Ints) -> Ints:
    """Return the arcs between nodes, the first of those side by side; the start may be left out."""
    if len(nodes) and nodes[0] == 0:
        nodes = nodes[1:]
    before = np.concatenate([[0], nodes[:-1]]).astype(np.int64)
    codes = instance.source.astype(np.int64) * instance.nodes + instance.target
    wanted = before * instance.nodes + nodes
    at = np.searchsorted(codes, wanted)
    for step, (place, code) in enumerate(zip(at.tolist(), wanted.tolist(), strict=True), start=1):
        if place == len(codes) or codes[place] != code:
            first, second = divmod(code, instance.nodes)
            raise SolverError(f"step {step}: no arc leads from node {first} to node {second}")
    return np.asarray(at)


def _value(instance: Instance, goal: _Target, path: _Walk) -> float:
    own: Floats = instance.amounts[path.arcs][:, list(goal.columns)]
    worth = {
        SUM: lambda: float(own.sum()),
        PEAK: lambda: float(own.max(initial=0.0)),
        TAIL: lambda: _target_sums(goal, own.sum(axis=0)),
        TIME: lambda: path.ends,
    }
    return worth[goal.kind]()


def _spent(instance: Instance, path: _Walk) -> dict[str, float]:
    """Return what a path takes of caps; a `SolverError` names one that it exceeds."""
    out = {}
    for cap in instance.caps:
        own = path.ends
        if cap.column is not None:
            own = float(instance.amounts[path.arcs, cap.column].sum())
        if not own <= cap.most + TOLERANCE * abs(cap.most):
            raise SolverError(f"{cap.name} is {own:.9g}, more than the {cap.most:g} allowed")
        out[cap.name] = own
    return out


def _bounds(
    instance: Instance, values: Sequence[float], claims: Sequence[Claim]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return what is proven of every goal, and what is claimed."""
    if len(claims) > len(values):
        raise SolverError(f"there are {len(claims)} bounds for {len(values)} goals")
    stage, out, said = first_stage(instance), list[float](), list[float]()
    for k, (goal, value) in enumerate(zip(instance.goals, values, strict=True)):
        claim = claims[k] if k < len(claims) else Claim()
        bound = proven(instance, stage, goal, claim, value)
        if _lays_down(instance, claim) and bound < value - BELOW * abs(value):
            bound = max(bound, within_caps(instance, value, claim.prices))
        bare = claim.potentials is None and claim.cut is None
        bare &= claim.weights is None and claim.shares is None and not claim.prices
        bare &= claim.labels is None
        _require_modest(goal, claim, (value, bound), bare=bare)
        if not bound < value - BELOW * abs(value):
            bound = value
        out.append(bound)
        claimed = claim.value if bare and claim.value is not None else bound
        said.append(min(value, max(bound, claimed)))
        stage = next_stage(stage, goal, value)
    return tuple(out), tuple(said)


def _lays_down(instance: Instance, claim: Claim) -> bool:
    """Return whether partial paths may say more than prices do."""
    one = len(instance.goals) == 1 and instance.goals[0].kind == SUM
    columns = all(cap.column is not None for cap in instance.caps)
    known = claim.potentials is None and bool(instance.caps)
    return one and columns and known and instance.is_layered


def _require_modest(goal: _Target, claim: Claim, found: tuple[float, float], *, bare: bool) -> None:
    """Raise an error if a bound is above the value of a path, or above what is to prove it."""
    value, bound = found
    if bound > value + ABOVE * abs(value):
        raise SolverError(f"{goal.name}: the bound {bound:.9g} is above the path's {value:.9g}")
    if claim.value is None:
        return
    if claim.value > value + ABOVE * abs(value):
        raise SolverError(
            f"{goal.name}: a bound of {claim.value:.9g} is claimed; the path takes {value:.9g}"
        )
    if not bare and claim.value > bound + ABOVE * abs(value):
        raise SolverError(
            f"{goal.name}: a bound of {claim.value:.9g} is claimed, and {bound:.9g} is proven"
        )
