"""Solutions of instances from any source: read, and checked by arithmetic alone.

Paths are checked arc by arc, bounds with their proofs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import parse_json, read_text
from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import ProblemError, SolverError
from seqopt.graph.graph import PEAK, TAIL, TIME, _Target, _target_sums, tied
from seqopt.instances._files import read_instance
from seqopt.instances.model import Instance
from seqopt.judge.arithmetic import ABOVE, Labelled, Stage, _peak_bound, _sum_bound, least_within
from seqopt.judge.certificate import TOLERANCE, Certificate, _path_twin, limit_below
from seqopt.scene._checks import short

WHAT = ("nodes", "arcs", "acts")
KEYS = ("value", "prices", "weights", "shares", "labels")


@dataclass(frozen=True, eq=False, repr=False)
class Claim(FrozenValue):
    """A claimed lower bound and its proof; without a value, the bound that the proof gives.

    ``prices``: multipliers, by name of a cap or of a sum before; ``weights``: of columns of a tail;
    ``shares`` (L, 1 + k): of the time of all, then of a robot of every kind; ``labels``: nodes
    (N,), and (N, 1 + c + q) when the last act ended, since when robots are free, zero where they
    hold, and sums that are limited.
    """

    value: float | None = None
    prices: Mapping[str, float] = field(default_factory=dict)
    weights: Floats | None = None
    shares: Floats | None = None
    labels: Labelled | None = None


class OverCapError(SolverError):
    """A path takes more of a cap than is allowed."""


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
    claims, source = (held.get("bounds", ()), where) if own else _loaded(bounds)
    if isinstance(claims, Mapping):
        claims = claims.get("bounds", [claims])
    if isinstance(claims, str) or not isinstance(claims, Sequence):
        raise ProblemError(f"{source}: bounds are {short(claims)}; give a list, one for every goal")
    names, values = [goal.name for goal in graph.goals], held.get("values", ())
    if isinstance(values, Mapping):
        _require_known(f"{where}, values", values, names)
        values = [values.get(name, np.inf) for name in names]
    known = _numbers(f"{where}, values", values).tolist()
    if len(known) > len(names):
        raise ProblemError(f"{where}: {len(known)} values for {len(names)} goals; leave some out")
    numbers = _numbers(f"{where}, {named[0]}", held[named[0]], whole=True)
    bounds = [_claim(f"{source}, bound {k}", each) for k, each in enumerate(claims, start=1)]
    claimed = [value if np.isfinite(value) else None for value in known]
    return judge_path(graph, named[0], numbers, claimed, bounds)


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


def judge_path(
    instance: Instance,
    what: str,
    numbers: Ints,
    known: Sequence[float | None],
    bounds: Sequence[Claim],
) -> Certificate:
    """Check a path, and bounds with their proofs, as `judge_instance`.

    ``what``: whether its numbers are of ``nodes``, ``arcs`` or ``acts``; ``known``: its values.
    """
    arcs, acts = _walked(instance, what, numbers)
    sums, ends = instance.amounts[arcs].sum(axis=0), 0.0
    if instance.timed is not None and instance.asks_time:
        twin = _path_twin()
        ends = np.nan if twin is None else twin.path_value(instance.timed, arcs, acts)
    values, spent = list[float](), dict[str, float]()
    for goal in instance.goals:
        own = sums[list(goal.columns)]
        if goal.kind == PEAK:
            own = instance.amounts[arcs][:, list(goal.columns)].max(initial=0.0)
        value = _target_sums(goal, own) if goal.kind == TAIL else np.sum(own)
        values.append(ends if goal.kind == TIME else float(value))
    for goal, value, claimed in zip(instance.goals, values, known, strict=False):
        if claimed is not None and not abs(value - claimed) <= TOLERANCE * abs(value):
            raise SolverError(f"{goal.name} is {value:.9g}, not {claimed:.9g} as claimed")
    for cap in instance.caps:
        spent[cap.name] = took = ends if cap.column is None else float(sums[cap.column])
        if not took <= cap.most + TOLERANCE * abs(cap.most):
            raise OverCapError(f"{cap.name} is {took:.9g}, more than the {cap.most:g} allowed")
    found = _bounds(instance, values, bounds)
    gaps = [
        max((v - b) / (abs(v) or 1.0) for v, b in zip(values, each, strict=True)) for each in found
    ]
    return Certificate(tuple(values), found[0], gaps[0], gaps[1], spent, instance.nodes)


def _walked(instance: Instance, what: str, numbers: Ints) -> tuple[Ints, Ints | None]:
    """Return arcs from the start to an end, and acts if these are given; or say where it breaks."""
    timed = instance.timed
    if what == "acts" and timed is None:
        raise SolverError("acts: no times are asked of this instance; give nodes or arcs")
    counts = {"arcs": instance.arcs, "nodes": instance.nodes}
    count = len(timed.move) if what == "acts" and timed is not None else counts[what]
    if len(wrong := numbers[(numbers < 0) | (numbers >= count)]):
        raise SolverError(f"{what[:-1]} {wrong[0]} does not exist; they are 0 to {count - 1}")
    arcs, at = _arcs_of(instance, numbers) if what == "nodes" else numbers, 0
    if what == "acts" and timed is not None:
        arcs = timed.move[numbers]
    for step, arc in enumerate(arcs.tolist(), start=1):
        if instance.source[arc] != at:
            where = f"{instance.source[arc]} to {instance.target[arc]}"
            raise SolverError(
                f"step {step}: arc {arc} leads from {where}; the path is at node {at}"
            )
        at = int(instance.target[arc])
    if not instance.ends[at]:
        raise SolverError(f"the path stops at node {at}, where none may end")
    return arcs, numbers if what == "acts" else None


def _arcs_of(instance: Instance, nodes: Ints) -> Ints:
    """Return the arcs between nodes, of those side by side the least; the start may be left out."""
    if len(nodes) and nodes[0] == 0:
        nodes = nodes[1:]
    before = np.concatenate([[0], nodes[:-1]]).astype(np.int64)
    codes = instance.source.astype(np.int64) * instance.nodes + instance.target
    wanted = before * instance.nodes + nodes
    order = np.arange(len(codes))
    if (np.diff(codes) == 0).any():
        order = np.lexsort((*instance.asked.amounts.T[::-1], codes))
    at = np.searchsorted(codes, wanted)
    for step, (place, code) in enumerate(zip(at.tolist(), wanted.tolist(), strict=True), start=1):
        if place == len(codes) or codes[place] != code:
            first, second = divmod(code, instance.nodes)
            raise SolverError(f"step {step}: no arc leads from node {first} to node {second}")
    return np.asarray(order[at])


def _bounds(
    instance: Instance, values: Sequence[float], claims: Sequence[Claim]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the proven and the claimed lower bounds of all goals.

    Raises `SolverError` if a claimed bound is above the value of a path, or above the proven one.
    """
    if len(claims) > len(values):
        raise SolverError(f"there are {len(claims)} bounds for {len(values)} goals")
    caps = [(c.name, c.column, tied(c.most)) for c in instance.caps if c.column is not None]
    stage, out, said = Stage(instance.graph, tuple(caps)), list[float](), list[float]()
    for k, (goal, value) in enumerate(zip(instance.goals, values, strict=True)):
        claim, slack = claims[k] if k < len(claims) else Claim(), ABOVE * abs(value)
        bound = proven(instance, stage, goal, claim, value)
        proofs = claim.weights, claim.shares, claim.labels
        bare = not claim.prices and all(proof is None for proof in proofs)
        high, claimed = f"a bound of {claim.value or 0:.9g} is claimed", claim.value
        if bound > value + slack:
            raise SolverError(f"{goal.name}: the bound {bound:.9g} is above the path's {value:.9g}")
        if claimed is not None and claimed > value + slack:
            raise SolverError(f"{goal.name}: {high}; the path takes {value:.9g}")
        if claimed is not None and not bare and claimed > bound + slack:
            raise SolverError(f"{goal.name}: {high}, and {bound:.9g} is proven")
        out.append(bound if bound < limit_below(value) else value)
        low = claimed if bare and claimed is not None else out[-1]
        said.append(min(value, max(out[-1], low)))
        stage = stage.after(goal, value)
    return tuple(out), tuple(said)


def proven(instance: Instance, stage: Stage, goal: _Target, claim: Claim, value: float) -> float:
    """Return the lower bound of a goal by the proof of a claim, or by the judge's own without one.

    ``value``: of a path; no higher bound is sought. Where sums are capped the judge finds
    multipliers itself, from those claimed on; where paths have a node on every level, partial paths
    close what these leave open.

    Raises `SolverError` where a multiplier, a weight or a share is dual infeasible.
    """
    known = [name for name, *_ in stage.limited]
    for name, price in claim.prices.items():
        if name not in known:
            text = ", ".join(known) or "there are none"
            raise SolverError(f"price of {name!r}: it is no cap or sum before; give {text}")
        if not price >= 0 or not np.isfinite(price):
            raise SolverError(f"price of {name!r} is {price:g}; give a number from 0")
    prices = [claim.prices.get(name, 0.0) for name in known]
    if goal.kind == PEAK:
        return _peak_bound(stage, goal, claim.value if claim.prices else None, prices)
    if goal.kind == TIME:
        twin = _path_twin()
        return -np.inf if twin is None else twin.claimed(instance, stage, claim, prices)
    count, weights = len(goal.columns), claim.weights
    if weights is None or goal.kind != TAIL:
        weights = np.full(count, 1 / count)
    elif weights.shape != (count,) or not (weights >= 0).all():
        raise SolverError(f"weights: give {count} numbers from 0")
    elif weights.sum() > 1 + 1e-9 or weights.max() > goal.most * (1 + 1e-9):
        raise SolverError(
            f"weights: they add up to {weights.sum():.9g}, the largest is {weights.max():.9g}; at "
            f"most 1 in all and {goal.most:.9g} each prove a bound"
        )
    costs = stage.graph.amounts[:, list(goal.columns)] @ weights
    if goal.kind == TAIL or not stage.limited:
        return _sum_bound(stage, costs, prices)
    limited, labels = stage.caps(), instance.is_layered
    return least_within(stage.graph, costs, limited, value, prices, labels=labels)
