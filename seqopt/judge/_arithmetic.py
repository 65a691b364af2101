"""The judge of paths: one is recomputed arc by arc, and bounds are checked by arithmetic alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph.instance import PEAK, TAIL, TIME, Instance, _Target, _target_sums
from seqopt.judge._claims import ABOVE, Claim, first_stage, next_stage, proven
from seqopt.judge._twin import path_twin
from seqopt.judge.certificate import TOLERANCE, Certificate


class Answer(NamedTuple):
    """A path as numbers of ``nodes``, ``arcs`` or ``acts``, and what is claimed of it."""

    what: str
    numbers: Ints
    values: tuple[float | None, ...]
    bounds: tuple[Claim, ...]


class OverCapError(SolverError):
    """A path takes more of a cap than is allowed."""


BELOW = 1e-9  # by how much a path must be better, over the size of the value


def judge_path(instance: Instance, answer: Answer) -> Certificate:
    """Check a path through an instance, and bounds with what is to prove them.

    Result: values, and lower bounds: by the proofs given; without any by potentials, a cut or
    multipliers that the judge finds itself. A bound without proof counts as claimed.
    Raises `SolverError` if the path does not lead from node 0 to an end, exceeds a cap or is worth
    something else than is claimed; or if a bound is higher than what is to prove it.
    """
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
    """Arcs of a path, and its makespan in an instance in time."""

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
        twin = path_twin()
        ends = np.nan if twin is None else twin.path_value(instance.timed, arcs, acts)
    return _Walk(arcs, ends)


def _in_range(numbers: Ints, count: int, what: str) -> Ints:
    wrong = numbers[(numbers < 0) | (numbers >= count)]
    if len(wrong):
        raise SolverError(f"{what} {wrong[0]} does not exist; they are 0 to {count - 1}")
    return numbers


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


def _value(instance: Instance, goal: _Target, path: _Walk) -> float:
    own: Floats = instance.amounts[path.arcs][:, list(goal.columns)]
    if goal.kind in (TIME, PEAK):
        return path.ends if goal.kind == TIME else float(own.max(initial=0.0))
    return _target_sums(goal, own.sum(axis=0)) if goal.kind == TAIL else float(own.sum())


def _spent(instance: Instance, path: _Walk) -> dict[str, float]:
    """Return the use of caps by a path; a `SolverError` names one that it exceeds."""
    out = {}
    for cap in instance.caps:
        own = path.ends
        if cap.column is not None:
            own = float(instance.amounts[path.arcs, cap.column].sum())
        if not own <= cap.most + TOLERANCE * abs(cap.most):
            raise OverCapError(f"{cap.name} is {own:.9g}, more than the {cap.most:g} allowed")
        out[cap.name] = own
    return out


def _bounds(
    instance: Instance, values: Sequence[float], claims: Sequence[Claim]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the proven and the claimed lower bounds of all goals."""
    if len(claims) > len(values):
        raise SolverError(f"there are {len(claims)} bounds for {len(values)} goals")
    stage, out, said = first_stage(instance), list[float](), list[float]()
    for k, (goal, value) in enumerate(zip(instance.goals, values, strict=True)):
        claim = claims[k] if k < len(claims) else Claim()
        bound = proven(instance, stage, goal, claim, value)
        proofs = claim.potentials, claim.cut, claim.weights, claim.shares, claim.labels
        bare = not claim.prices and all(proof is None for proof in proofs)
        _require_modest(goal, claim, (value, bound), bare=bare)
        if not bound < value - BELOW * abs(value):
            bound = value
        out.append(bound)
        claimed = claim.value if bare and claim.value is not None else bound
        said.append(min(value, max(bound, claimed)))
        stage = next_stage(stage, goal, value)
    return tuple(out), tuple(said)


def _require_modest(goal: _Target, claim: Claim, found: tuple[float, float], *, bare: bool) -> None:
    """Raise an error if a claimed bound is above the value of a path, or above the proven one."""
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
