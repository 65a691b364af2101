"""The judge of paths: one is recomputed arc by arc, and bounds are checked by arithmetic alone."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import SolverError
from seqopt.graph.graph import ROUNDING, TIED, Graph, cut, least_sum, tied
from seqopt.graph.instance import PEAK, SUM, TAIL, TIME, Instance, _Target, _target_sums
from seqopt.judge._bounds import Book, Closed, SumBook, TwinBook, least_within, limit_below
from seqopt.judge._twin import path_twin
from seqopt.judge.certificate import TOLERANCE, Certificate
from seqopt.problem.requirements import _first_fault

BELOW = 1e-9  # by how much a path must be better, over the size of the value
ABOVE = 1e-6  # over a value: how far a claim may be above what is proven


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
        twin = path_twin()
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
    every = instance.steps if instance.resources else None
    if every is not None and (fault := _first_fault(instance.resources, every.only(arcs))):
        raise SolverError(f"the resource {fault[0]} is not kept up to step {fault[1] + 1}")
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
    stage, out, said = first_stage(instance), list[float](), list[float]()
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
        out.append(bound if bound < value - BELOW * abs(value) else value)
        low = claimed if bare and claimed is not None else out[-1]
        said.append(min(value, max(out[-1], low)))
        stage = next_stage(stage, goal, value)
    return tuple(out), tuple(said)


Labels = tuple[Ints, Floats]  # nodes (N,), and values (N, 1 + c + q)


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
    labels: Labels | None = None


class Stage(NamedTuple):
    """State between goals: the arcs that are left, caps on sums of columns, and one of the time."""

    graph: Graph
    limited: tuple[tuple[str, int, float], ...]
    time: float = np.inf


def first_stage(instance: Instance) -> Stage:
    """Return all arcs, with the caps."""
    caps = [(c.name, c.column, c.most) for c in instance.caps if c.column is not None]
    return Stage(instance.graph, tuple((name, c, tied(most)) for name, c, most in caps))


def next_stage(stage: Stage, goal: _Target, value: float) -> Stage:
    """Return arcs and caps that are left once a goal is at its value."""
    if goal.kind == PEAK:
        kept = stage.graph.amounts[:, goal.columns[0]] <= tied(value)
        return stage._replace(graph=stage.graph.only(kept))
    if goal.kind == SUM:
        more = (goal.name, goal.columns[0], tied(value))
        return stage._replace(limited=(*stage.limited, more))
    time = tied(value) if goal.kind == TIME else np.inf
    return stage._replace(time=min(stage.time, time))  # what is left out makes a bound no higher


def only_below(graph: Graph, goal: _Target, value: float) -> Graph:
    """Return the arcs that paths below a value of a goal may take, not below by rounding alone."""
    if goal.kind != PEAK:
        return graph
    amounts = graph.amounts[:, goal.columns[0]]
    return graph.only(amounts + TIED * np.abs(amounts) < value)


def sum_books(stage: Stage, goal: _Target, value: float, move: Ints) -> list[Book]:
    """Return the book of limited sums; that of a goal stays below a value.

    ``move``: of arcs, as of `SumBook`.
    """
    limited = [(column, most, False) for _, column, most in stage.limited]
    if goal.kind == SUM:
        limited.append((goal.columns[0], limit_below(value), True))
    if not limited:
        return []
    columns, most, strict = (np.array(each) for each in zip(*limited, strict=True))
    return [SumBook(stage.graph, move, stage.graph.amounts[:, columns], (most, strict))]


def proven(instance: Instance, stage: Stage, goal: _Target, claim: Claim, value: float) -> float:
    """Return the lower bound of a goal by the proof of a claim, or by the judge's own without one.

    ``value``: of a path; no higher bound is sought. Where sums are capped the judge finds
    multipliers itself, from those claimed on; where paths have a node on every level, partial paths
    close what these leave open.

    Raises `SolverError` where a multiplier, a weight or a share is dual infeasible.
    """
    known = {name: (column, most) for name, column, most in stage.limited}
    for name, price in claim.prices.items():
        if name not in known:
            said = ", ".join(known) or "there are none"
            raise SolverError(f"price of {name!r}: it is no cap or sum before; give {said}")
        if not price >= 0 or not np.isfinite(price):
            raise SolverError(f"price of {name!r} is {price:g}; give a number from 0")
    limited = [(price, *known[name]) for name, price in claim.prices.items()]
    if instance.resources and claim.labels is not None and goal.kind in (SUM, PEAK):
        return _by_labels(instance, stage, goal, claim)
    if goal.kind == PEAK:
        return _peak(stage, goal, claim.value, limited)
    if goal.kind == TIME:
        twin = path_twin()
        return -np.inf if twin is None else twin.claimed(instance, stage, claim, limited)
    costs = stage.graph.amounts[:, list(goal.columns)] @ _weights(goal, claim)
    if goal.kind == TAIL or not stage.limited:
        return _sum(stage, costs, limited)
    caps = [(column, most) for _, column, most in stage.limited]
    begin = [claim.prices.get(name, 0.0) for name, *_ in stage.limited]
    layered = instance.is_layered
    return least_within(stage.graph, costs, caps, value, prices=begin, laid_down=layered)[0]


def _weights(goal: _Target, claim: Claim) -> Floats:
    """Return weights of the columns of a tail that prove a bound, or say why they do not."""
    count, weights = len(goal.columns), claim.weights
    if weights is None or goal.kind != TAIL:
        return np.full(count, 1 / count)
    if weights.shape != (count,) or not (weights >= 0).all():
        raise SolverError(f"weights: give {count} numbers from 0")
    if weights.sum() > 1 + 1e-9 or weights.max() > goal.most * (1 + 1e-9):
        raise SolverError(
            f"weights: they add up to {weights.sum():.9g}, the largest is {weights.max():.9g}; at "
            f"most 1 in all and {goal.most:.9g} each prove a bound"
        )
    return weights


def _by_labels(instance: Instance, stage: Stage, goal: _Target, claim: Claim) -> float:
    """Return the claimed bound of a goal; a `SolverError` if labels of resources do not close."""
    assert claim.labels is not None
    twins = [each.twin for each in instance.resources if each.twin is not None]
    if claim.value is None or len(twins) < len(instance.resources):
        return -np.inf  # without a twin nothing is proven
    graph = only_below(stage.graph, goal, claim.value)
    move = np.arange(len(graph.source))
    codes = instance.source.astype(np.int64) * instance.nodes + instance.target
    own = graph.source.astype(np.int64) * graph.states + graph.target
    steps = instance.steps.only(np.searchsorted(codes, own))
    books = sum_books(stage._replace(graph=graph), goal, claim.value, move)
    closed = Closed(graph, move, [*books, *(TwinBook(twin, steps) for twin in twins)])
    state, values = claim.labels
    values = values if len(values) else np.zeros((0, closed.width))
    named = len(state) == 0 or (state.min() >= 0 and state.max() < instance.nodes)
    fits = named and values.shape == (len(state), closed.width)
    if fits and closed.is_proof((state, values), lambda states: np.zeros(len(states), dtype=bool)):
        return claim.value
    raise SolverError(f"{goal.name}: labels do not prove that no path is below {claim.value:.9g}")


def _sum(stage: Stage, costs: Floats, limited: Sequence[tuple[float, int, float]]) -> float:
    """Return the Lagrangian bound of a sum, by multipliers of limited sums and by potentials."""
    graph, back = stage.graph, 0.0
    for price, column, most in limited:
        costs = costs + price * graph.amounts[:, column]
        back += price * most
    return least_sum(graph, costs) - back - ROUNDING * graph.states * abs(back)


def budget_bounds(
    graph: Graph,
    values: Sequence[float],
    claimed: Sequence[float],
    priced: tuple[Sequence[float], Sequence[Sequence[float]]],
) -> tuple[float, ...]:
    """Return Lagrangian lower bounds of paths under caps on the last columns, goal by goal.

    ``values``, ``claimed``: of a path, and the bounds that are claimed for worst amounts;
    ``priced``: the caps; by goal, multipliers of these and of the sums before it; of a goal without
    any the judge finds its own.
    """
    caps, multipliers = priced
    first, out = len(graph.peaks) - len(caps), list[float]()
    stage = Stage(graph, tuple(("", c, cap) for c, cap in enumerate(caps, start=first)))
    for k in range(first):
        given = multipliers[k] if k < len(multipliers) else (0.0,) * len(stage.limited)
        own = [max(price, 0.0) for price in given]
        if len(own) != len(stage.limited) or not np.isfinite(own).all():
            counts = f"{len(own)} where {len(stage.limited)} numbers belong"
            raise SolverError(f"there is no multiplier for every budget and goal: {counts}")
        limited = [(price, c, most) for price, (_, c, most) in zip(own, stage.limited, strict=True)]
        goal = _Target("", PEAK if graph.peaks[k] else SUM, (k,))
        if graph.peaks[k]:
            is_alone = k >= len(multipliers)
            out.append((_own_peak if is_alone else _peak)(stage, goal, claimed[k], limited))
            stage = next_stage(stage, goal, values[k])
        else:  # what is tied with a value would loosen the bounds of later goals
            costs = stage.graph.amounts[:, k]
            bound = _sum(stage, costs, limited)
            if claimed[k] > bound + ABOVE * abs(claimed[k]):  # labels may close what is left open
                some = [(c, most) for _, c, most in limited]
                bound = max(bound, _laid_down(stage.graph, costs, some, values[k], own))
            out.append(bound)
            stage = stage._replace(limited=(*stage.limited, ("", k, values[k])))
    return tuple(out)


def _laid_down(
    graph: Graph,
    costs: Floats,
    limited: Sequence[tuple[int, float]],
    value: float,
    multipliers: Sequence[float],
) -> float:
    """Return the lower bound of a sum within caps that labels prove, from multipliers on."""
    limited = [(column, tied(most)) for column, most in limited]
    return least_within(graph, costs, limited, value, prices=multipliers, laid_down=True)[0]


def _own_peak(
    stage: Stage, goal: _Target, claimed: float, limited: Sequence[tuple[float, int, float]]
) -> float:
    """Return the bound of a peak by multipliers and labels of the judge: as claimed, or lower."""
    part, caps = only_below(stage.graph, goal, claimed), [(c, tied(most)) for _, c, most in limited]
    if least_within(part, np.zeros(len(part.source)), caps, 1.0, laid_down=True)[0] >= 1.0:
        return claimed
    return _peak(stage, goal, None, ())


def _peak(
    stage: Stage, goal: _Target, claimed: float | None, limited: Sequence[tuple[float, int, float]]
) -> float:
    """Return the bound of a peak: as claimed if multipliers leave no path below it, or a cut.

    Without multipliers, where sums are limited, the judge finds the largest amount below which they
    leave no path.
    """
    graph, column = stage.graph, goal.columns[0]
    if limited and claimed is not None:
        part = stage._replace(graph=only_below(graph, goal, claimed))
        nothing = np.zeros(len(part.graph.source))
        return claimed if _sum(part, nothing, limited) > 0 else -np.inf
    least = cut(graph, column, np.inf)[0]
    levels = np.unique(graph.amounts[:, column]) if stage.limited else np.zeros(0)
    caps = [(c, most) for _, c, most in stage.limited]

    def is_open(level: float) -> bool:
        part = graph.only(graph.amounts[:, column] <= level)
        return least_within(part, np.zeros(len(part.source)), caps, 1.0)[0] < 1.0

    first = bisect_left(levels, x=True, key=is_open)
    return max(least, float(levels[min(first, len(levels) - 1)])) if len(levels) else least
