"""Certificates of free schedules: a plan recomputed, and a proof that none is better.

The plan's own values come from the responses of its steps, one after the other. What no plan stays
below is then proven goal by goal: the states that a better plan could pass and the moves between
them are found by a second version of the rules, with responses computed again, and weak duality
bounds every path through them (`seqopt.graph.duality`). This shares nothing with the search that is
judged but the states that it visited, on which only the time depends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from seqopt.errors import SolverError, StepError
from seqopt.graph.solution import StatePath
from seqopt.graph.states.states import States
from seqopt.judge._proof import BELOW, Hint, Proof
from seqopt.judge._prop_rules import check_props
from seqopt.judge._shape_rules import check_shape
from seqopt.judge._standing_proof import proven_margins, require_margin
from seqopt.judge._twin import Twin, twin_of
from seqopt.judge.certificate import Certificate
from seqopt.problem.problem import LARGEST, Goal, Measure
from seqopt.problem.standing import _size, slack
from seqopt.responses._props import EXCESS_COLUMN
from seqopt.responses._tolerance import COLUMN, is_tolerance, misfits_along, tolerances_along
from seqopt.responses.quantities import CHOSEN_BY, PROP_EXCESS
from seqopt.responses.table import _analyzed, _Columns, force_column
from seqopt.scene._armed import check_postures
from seqopt.sequence._rule_check import check_carried, check_free
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import Step, StepKind

TOLERANCE = 1e-6  # over the size of a value: how far a claim may be from what the engine says


def judge_schedule(
    problem: States,
    selection: StatePath,
    steps: Sequence[Step],
    hint: Hint | None = None,
    *,
    exact: bool = True,
) -> Certificate:
    """Check a free schedule from the problem's own data, without the search.

    ``selection``: what a formulation claims; ``steps``: of the selection, checked in the scene;
    ``hint`` (mapping of int to (n, c) int): states that a search visited, by brick count; only the
    time that the proof takes depends on them; ``exact``: whether values are promised as the least;
    else only bounds that were claimed are. Raises `SolverError` if a value is not what was claimed,
    a limit is exceeded, or a plan is better than promised; `StepError` if a step breaks a rule.
    """
    values = _as_claimed(problem, selection, steps)
    twin = twin_of(Measure.MAKESPAN) if problem.is_timed else None
    if twin is not None and np.isfinite(selection.bound).any():
        return _by_twin(problem, twin, selection, values, hint)
    if selection.stopped or (problem.is_timed and twin is None):
        bounds = _counted(problem, twin, values, (-np.inf,) * len(values))
        gap = _gap(problem.aims, values, bounds)
        return Certificate(values, bounds, gap, gap)  # its bounds are claimed, not proven
    if problem.totals:
        return _over_totals(problem, selection, values[0], hint)
    proof = Proof(problem, hint)
    if problem.budgets:
        return _within_budgets(problem, selection, values, proof)
    bounds = _bounds(problem, proof, values)
    promised = values if exact else selection.bound
    for goal, value, bound in zip(problem.goals, promised, bounds, strict=True):
        if not goal.of_margins and not bound >= value - BELOW * abs(value):
            raise SolverError(f"{goal}: {value:.9g} is promised as the least; a plan has less")
    gap = _gap(problem.goals, values, bounds)
    return Certificate(values, bounds, gap, gap, {}, proof.states)


def _by_twin(
    problem: States, twin: Twin, selection: StatePath, values: tuple[float, ...], hint: Hint | None
) -> Certificate:
    """Return the certificate of a build of which a measure of the whole path counts."""
    aims, proof = len(problem.aims), Proof(problem, hint)
    for goal, spent, cap in zip(problem.goals[aims:], values[aims:], problem.budgets, strict=True):
        if not spent <= cap + TOLERANCE * cap:
            raise SolverError(f"{goal} is {spent:.9g}, more than the {cap:g} that are allowed")
    margins = _margin_bounds(problem, proof, values)
    bounds = (*margins, *proof.timed_bounds(twin, values, selection)[len(margins) :])
    pairs = list(zip(bounds, values, strict=False))
    bounds = tuple(v if b >= v - BELOW * abs(v) else b for b, v in pairs)
    bounds = _counted(problem, twin, values, bounds)
    said = zip(bounds, selection.bound, values, strict=False)
    claimed = [min(v, max(b, other)) for b, other, v in said]
    gap, left = (_gap(problem.goals, values, each) for each in (bounds, claimed))
    return Certificate(values, (*bounds, *values[aims:]), gap, left, {}, proof.states)


def _counted(
    problem: States, twin: Twin | None, values: Sequence[float], bounds: Sequence[float]
) -> tuple[float, ...]:
    """Return bounds of first goals, those on makespans no less than what all builds take."""
    if twin is None:
        return tuple(bounds)
    least = twin.least(problem.network, problem.rules)
    return tuple(
        max(bound, min(least, value)) if goal.measure is Measure.MAKESPAN else bound
        for goal, value, bound in zip(problem.goals, values, bounds, strict=False)
    )


def _gap(goals: Sequence[Goal], values: Sequence[float], bounds: Sequence[float]) -> float:
    """Return the most that bounds of the first goals leave open, over the size of their values."""
    return max(
        (value - bound) / (_size(goal.response, value) or 1.0)
        for goal, value, bound in zip(goals, values, bounds, strict=False)
    )


def _as_claimed(problem: States, selection: StatePath, steps: Sequence[Step]) -> tuple[float, ...]:
    """Return the values of steps that keep the rules, if they are those that are claimed."""
    if isinstance(problem.rules, Schedule):
        _check_scheduled(problem.rules, steps)
        check_carried(problem.network.scene, problem.rules, steps, problem.worlds)
    else:
        check_free(problem.network, problem.rules, steps, problem.worlds)
    check_postures(problem.network.scene, steps)
    values = plan_values(problem, steps, selection.objective, selection.starts)
    for goal, value, claimed in zip(problem.names, values, selection.objective, strict=True):
        if not abs(value - claimed) <= TOLERANCE * max(abs(value), abs(claimed)):
            raise SolverError(f"{goal} is {value:.9g}, not {claimed:.9g} as claimed")
    return values


def _check_scheduled(schedule: Schedule, steps: Sequence[Step]) -> None:
    """Raise a `StepError` unless a sequence is the schedule, each open grip at one candidate."""
    if len(steps) != len(schedule.steps):
        raise StepError(f"{len(steps)} steps; schedule {schedule.method} has {len(schedule.steps)}")
    chosen: dict[int, object] = {}
    for step, planned in zip(steps, schedule.steps, strict=True):
        same = (step.number, step.kind, step.bricks) == (
            planned.number,
            planned.kind,
            planned.bricks,
        )
        for node, grip in zip(step.grips, planned.grips, strict=True):
            if isinstance(grip, OpenGrip):
                found = chosen.setdefault(grip.move, node)
                same &= found == node and node in schedule.moves[grip.move].candidates
            else:
                same &= node == grip
        if not same:
            raise StepError(f"step {step.number} is none of schedule {schedule.method}")


def _bounds(problem: States, proof: Proof, values: tuple[float, ...]) -> tuple[float, ...]:
    """Return what no plan stays below, goal by goal; margins come first and have their width."""
    out = _margin_bounds(problem, proof, values)
    if len(out) == len(values):
        return tuple(out)
    pairs = zip(proof.bounds(values), values, strict=True)
    found = [v if b >= v - BELOW * abs(v) else b for b, v in pairs]
    return (*out, *found[len(out) :])


def _margin_bounds(problem: States, proof: Proof, values: tuple[float, ...]) -> list[float]:
    """Return what no plan stays below of margins, within what they are proven to."""
    out: list[float] = []
    for goal, value in zip(problem.goals, values, strict=True):
        if goal.of_margins:
            bound = max(0.0, value - slack(goal.response, value))
            if value > 0 and not proof.is_impossible((*values[: len(out)], bound)):
                raise SolverError(f"{goal}: {value:.9g} is promised as the least; a plan has less")
            out.append(bound)
    return out


def _within_budgets(
    problem: States, selection: StatePath, values: tuple[float, ...], proof: Proof
) -> Certificate:
    """Return the certificate of a plan within budgets: what prices leave open is its gap."""
    aims = len(problem.aims)
    pairs = zip(problem.goals[aims:], values[aims:], problem.budgets, strict=True)
    for goal, spent, cap in pairs:
        if not spent <= cap + TOLERANCE * cap:
            raise SolverError(f"{goal} is {spent:.9g}, more than the {cap:g} that are allowed")
    claimed, prices = selection.bound, selection.prices
    if len(prices) < aims or any(len(each) < len(problem.budgets) for each in prices):
        raise SolverError("there is no price for every budget and goal")
    margins = _margin_bounds(problem, proof, values)
    bounds = (*margins, *proof.budget_bounds(values, claimed, prices)[len(margins) :])
    for goal, bound, said in zip(problem.aims, bounds, claimed, strict=False):
        if not goal.of_margins and not bound >= said - TOLERANCE * abs(said):
            raise SolverError(f"{goal}: no plan within budgets is promised below {said:.9g}")
    bounds = tuple(map(min, bounds, values))
    left = _gap(problem.goals, values, bounds)
    return Certificate(values, (*bounds, *values[aims:]), left, left, {}, proof.states)


def _over_totals(
    problem: States, selection: StatePath, value: float, hint: Hint | None
) -> Certificate:
    """Return the certificate of a total over scenarios: weights bound it by one weighted sum."""
    if [*map(len, selection.prices)] != [len(problem.each)]:
        raise SolverError("there is no weight for every scenario")
    weights = problem.over.allowed(np.array(selection.prices[0]))
    proof = Proof(replace(problem, weights=tuple(weights.tolist())), hint)
    bound = min(value, proof.bounds((value,))[0])
    claimed = min(value, max(bound, selection.bound[0]))
    if claimed > value - BELOW * abs(value):
        claimed = value
    gap, left = (_gap(problem.goals, (value,), (each,)) for each in (bound, claimed))
    return Certificate((value,), (bound,), gap, left, {}, proof.states)


def plan_values(
    problem: States,
    steps: Sequence[Step],
    claimed: Sequence[float] = (),
    starts: Sequence[float] = (),
) -> tuple[float, ...]:
    """Return what goals take of a sequence, from the responses of its steps.

    ``claimed``: the value of every goal; margins of stability are compared with these, and taken
    from them; ``starts``: where mortar cures, when steps start, s. Result: SI units. Over scenarios
    the largest, but ways, which are those of the scene itself. Raises `SolverError` if a step
    exceeds a limit, does not stand as is demanded, or has less of a margin.
    """
    if problem.each:
        return _in_all(problem, steps, [plan_values(each, steps, claimed) for each in problem.each])
    check_props(problem.engine, steps)
    check_shape(problem.engine, steps, problem.limits)
    columns = _state_columns(problem, steps, _analyzed(problem.engine, steps))
    _require_limits(problem, columns)
    margins = _margins(problem, steps)
    regrips = sum(step.kind is StepKind.REPOSITION for step in steps)
    moves: dict[Measure, float] = {Measure.STEPS: len(steps), Measure.REGRIPS: regrips}
    moves[Measure.TRAVEL] = _travel_of(problem, steps)
    out = []
    for k, goal in enumerate(problem.goals):
        if goal.of_margins:
            require_margin(goal.response, claimed[k], margins[goal.response])
            out.append(claimed[k])
        elif goal.measure in moves:
            out.append(float(moves[goal.measure]))
        elif not goal.of_states:
            twin = twin_of(goal.measure)
            out.append(claimed[k] if twin is None else twin.value(problem, steps, starts))
        else:
            costs = _costs(problem, goal, columns, [step.bricks for step in steps])
            out.append(float(costs.max() if goal.measure is Measure.PEAK else costs.sum()))
    return tuple(out)


def _in_all(
    problem: States, steps: Sequence[Step], found: Sequence[tuple[float, ...]]
) -> tuple[float, ...]:
    """Return the largest of what goals take in scenarios, or what is made of their totals."""
    if problem.totals:
        return (problem.over.value(np.array(found)[:, 0]),)
    return tuple(
        _travel_of(problem, steps) if goal.measure is Measure.TRAVEL else max(values)
        for goal, values in zip(problem.goals, zip(*found, strict=True), strict=True)
    )  # ways are as they are planned


def _require_limits(problem: States, columns: Mapping[str, np.ndarray]) -> None:
    """Raise a `SolverError` if a step exceeds a limit."""
    for limit in problem.limits:
        if limit.response in columns and limit.exceeded(columns[limit.response]).any():
            at = int(np.argmax(columns[limit.response])) + 1
            raise SolverError(f"step {at} exceeds the limit on {limit.label}")


def _margins(problem: States, steps: Sequence[Step]) -> Mapping[str, float]:
    """Return the margins of a plan where they count, and require that it stands where it must."""
    if problem.standing is None and not any(goal.of_margins for goal in problem.goals):
        return {}
    return proven_margins(problem, steps)


def _state_columns(
    problem: States, steps: Sequence[Step], table: _Columns
) -> Mapping[str, np.ndarray]:
    """Return responses (n,) by name, SI units, of the columns of `seqopt.analyze`."""

    def column(name: str) -> np.ndarray:
        return np.asarray(table[name], dtype=float)

    forces = [column(force_column(robot)) for robot in problem.network.scene.robots]
    out = {LARGEST: np.nan_to_num(np.fmax.reduce(np.abs(forces)))}
    for name in problem.named:
        if name == "C_max":
            out[name] = np.maximum(0.0, -column("F_min_N"))
        elif name == PROP_EXCESS:
            out[name] = column(EXCESS_COLUMN)
        elif is_tolerance(name):
            out[name] = misfits_along({COLUMN: tolerances_along(problem.engine, steps, name)})
        elif name != LARGEST:
            out[name] = column(CHOSEN_BY[name].column) / CHOSEN_BY[name].scale
    return out


def _travel_of(problem: States, steps: Sequence[Step]) -> float:
    """Return how far robots go straight from one grip to the next, m."""
    scene, site, total = problem.network.scene, problem.rules.begin, 0.0
    before = () if site is None else (site.stays or site.holds(scene), site.holds(scene))
    for nodes in zip(*before, *(step.grips for step in steps), strict=True):  # robot by robot
        held = [scene.node_position(node) for node in nodes if node is not None]
        for ends in pairwise(held):
            total += float(np.linalg.norm(np.subtract(*ends)))
    return total


def _costs(
    problem: States, goal: Goal, columns: Mapping[str, np.ndarray], bricks: Sequence[int]
) -> np.ndarray:
    """Return what a goal takes of every step (n,), in which so many bricks stand."""
    if goal.response:
        return columns[goal.response]
    out = np.zeros(len(bricks))
    for stand in {*bricks} - {0}:  # an empty site takes nothing
        rows = np.flatnonzero(np.array(bricks) == stand)
        found = {name: values[rows] for name, values in columns.items()}
        out[rows] = problem.criterion.costs(found, stand, len(rows))
    return out
