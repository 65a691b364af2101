"""The judge of paths through instances: arc by arc, and bounds with their proofs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import SolverError
from seqopt.graph.graph import PEAK, TAIL, TIME, _Target, _target_sums, tied
from seqopt.instances.model import Instance
from seqopt.judge.arithmetic import ABOVE, Labelled, Stage, _peak_bound, _sum_bound, least_within
from seqopt.judge.certificate import TOLERANCE, Certificate, _path_twin, limit_below


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


class Answer(NamedTuple):
    """A path as numbers of ``nodes``, ``arcs`` or ``acts``, and its claimed values."""

    what: str
    numbers: Ints
    values: tuple[float | None, ...]
    bounds: tuple[Claim, ...]


class OverCapError(SolverError):
    """A path takes more of a cap than is allowed."""


def judge_path(instance: Instance, answer: Answer) -> Certificate:
    """Check a path through an instance, and bounds with their proofs.

    Result: values, and lower bounds: by the proofs given; without any by potentials, a cut or
    multipliers that the judge finds itself. A bound without proof counts as claimed.
    Raises `SolverError` if the path does not lead from node 0 to an end, exceeds a cap or is worth
    something else than is claimed; or if a bound is higher than what is to prove it.
    """
    arcs, acts = _walked(instance, answer)
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
    for goal, value, claimed in zip(instance.goals, values, answer.values, strict=False):
        if claimed is not None and not abs(value - claimed) <= TOLERANCE * abs(value):
            raise SolverError(f"{goal.name} is {value:.9g}, not {claimed:.9g} as claimed")
    for cap in instance.caps:
        spent[cap.name] = took = ends if cap.column is None else float(sums[cap.column])
        if not took <= cap.most + TOLERANCE * abs(cap.most):
            raise OverCapError(f"{cap.name} is {took:.9g}, more than the {cap.most:g} allowed")
    found = _bounds(instance, values, answer.bounds)
    gaps = [
        max((v - b) / (abs(v) or 1.0) for v, b in zip(values, each, strict=True)) for each in found
    ]
    return Certificate(tuple(values), found[0], gaps[0], gaps[1], spent, instance.nodes)


def _walked(instance: Instance, answer: Answer) -> tuple[Ints, Ints | None]:
    """Return arcs from the start to an end, and acts if these are given; or say where it breaks."""
    timed, numbers, what = instance.timed, answer.numbers, answer.what
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
            said = ", ".join(known) or "there are none"
            raise SolverError(f"price of {name!r}: it is no cap or sum before; give {said}")
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
