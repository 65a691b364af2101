"""Certificates of free schedules: a plan recomputed, and a proof that none is better.

The values of the plan come from the responses of its steps. Lower bounds of all plans are proven
goal by goal (`seqopt.judge._proof`): this shares nothing with the search but the states that it
visited, on which only the time depends.
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
from seqopt.judge._rule_moves import check_free
from seqopt.judge._states import goal_values
from seqopt.judge._step_checks import check_props, check_shape, proven_margins, require_margin
from seqopt.judge._twin import Twin, twin_of
from seqopt.judge.certificate import Certificate
from seqopt.problem.problem import LARGEST, Goal, Measure
from seqopt.problem.standing import _size, slack
from seqopt.responses._props import EXCESS_COLUMN
from seqopt.responses._tolerance import COLUMN, is_tolerance, misfits_along, tolerances_along
from seqopt.responses.quantities import CHOSEN_BY, PROP_EXCESS
from seqopt.responses.table import _analyzed, _Columns, force_column
from seqopt.scene._armed import check_postures
from seqopt.sequence._rule_check import check_carried
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import Step, StepKind

TOLERANCE = 1e-6  # over the size of a value: how far a claim may be from what the engine says
Bounds = tuple[float, ...]


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
    a limit or a budget is exceeded, or a plan is better than promised; `StepError` if a step breaks
    a rule.
    """
    values, aims = _as_claimed(problem, selection, steps), len(problem.aims)
    for goal, spent, cap in zip(problem.goals[aims:], values[aims:], problem.budgets, strict=True):
        if not spent <= cap + TOLERANCE * cap:
            raise SolverError(f"{goal} is {spent:.9g}, more than the {cap:g} that are allowed")
    twin = twin_of(Measure.MAKESPAN) if problem.is_timed else None
    proves_time = twin is not None and bool(np.isfinite(selection.bound).any())
    if not proves_time and (selection.stopped or problem.is_timed):  # bounds are claimed alone
        bounds = _with_counts(problem, twin, values, (-np.inf,) * len(values))
        gap = _gap(problem.aims, values, bounds)
        return Certificate(values, bounds, gap, gap)
    proof, claimed = Proof(_weighed(problem, selection), hint), selection.bound
    margins = _margin_bounds(problem, proof, values)
    if twin is not None:
        found = proof.timed_bounds(twin, values, selection)
    elif problem.budgets:
        found = proof.budget_bounds(values, claimed, _multipliers(problem, selection))
    else:
        found = proof.bounds(values) if len(margins) < len(values) else margins
    bounds = _closed(values, (*margins, *found[len(margins) :]))
    if twin is not None:
        bounds = _with_counts(problem, twin, values, bounds)
    elif not problem.totals:
        _require_promised(problem, bounds, values if exact and not problem.budgets else claimed)
        claimed = bounds
    claimed = _closed(values, tuple(map(max, bounds, claimed)))
    gap, left = (_gap(problem.goals, values, each) for each in (bounds, claimed))
    return Certificate(values, (*bounds, *values[aims:]), gap, left, {}, proof.states)


def _closed(values: Sequence[float], bounds: Sequence[float]) -> Bounds:
    """Return bounds that are no higher than values; those that leave no room are the values."""
    pairs = zip(values, bounds, strict=False)
    return tuple(v if b >= v - BELOW * abs(v) else b for v, b in pairs)


def _gap(goals: Sequence[Goal], values: Sequence[float], bounds: Sequence[float]) -> float:
    """Return the most that bounds of the first goals leave open, over the size of their values."""
    return max(
        (value - bound) / (_size(goal.response, value) or 1.0)
        for goal, value, bound in zip(goals, values, bounds, strict=False)
    )


def _weighed(problem: States, selection: StatePath) -> States:
    """Return a problem over totals of scenarios with the weights that are claimed, made valid."""
    if not problem.totals:
        return problem
    if [*map(len, selection.prices)] != [len(problem.each)]:
        raise SolverError("there is no weight for every scenario")
    weights = problem.over.allowed(np.array(selection.prices[0]))
    return replace(problem, weights=tuple(weights.tolist()))


def _margin_bounds(problem: States, proof: Proof, values: Bounds) -> Bounds:
    """Return lower bounds of margins, up to their proven width."""
    out: list[float] = []
    for goal, value in zip(problem.goals, values, strict=True):
        if goal.of_margins:
            bound = max(0.0, value - slack(goal.response, value))
            if value > 0 and not proof.is_impossible((*values[: len(out)], bound)):
                raise SolverError(f"{goal}: {value:.9g} is promised as the least; a plan has less")
            out.append(bound)
    return tuple(out)


def _multipliers(problem: States, selection: StatePath) -> Sequence[Sequence[float]]:
    """Return the multipliers that are claimed of budgets, goal by goal."""
    found, budgets = selection.prices, len(problem.budgets)
    if len(found) < len(problem.aims) or any(len(each) < budgets for each in found):
        raise SolverError("there is no price for every budget and goal")
    return found


def _require_promised(problem: States, bounds: Bounds, promised: Sequence[float]) -> None:
    """Raise a `SolverError` if a bound, not of a margin, is below what is promised."""
    for goal, bound, least in zip(problem.aims, bounds, promised, strict=False):
        if not goal.of_margins and not bound >= least - BELOW * abs(least):
            if not problem.budgets:
                raise SolverError(f"{goal}: {least:.9g} is promised as the least; a plan has less")
            if not bound >= least - TOLERANCE * abs(least):
                raise SolverError(f"{goal}: no plan within budgets is promised below {least:.9g}")


def _with_counts(problem: States, twin: Twin | None, values: Bounds, bounds: Bounds) -> Bounds:
    """Return bounds of first goals, those of makespans no lower than the combinatorial one."""
    if twin is None:
        return bounds
    least = twin.least(problem.network, problem.rules)
    return tuple(
        max(bound, min(least, value)) if goal.measure is Measure.MAKESPAN else bound
        for goal, value, bound in zip(problem.goals, values, bounds, strict=False)
    )


def _as_claimed(problem: States, selection: StatePath, steps: Sequence[Step]) -> Bounds:
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
        own = planned.number, planned.kind, planned.bricks
        same = (step.number, step.kind, step.bricks) == own
        for node, grip in zip(step.grips, planned.grips, strict=True):
            if isinstance(grip, OpenGrip):
                found = chosen.setdefault(grip.move, node)
                same &= found == node and node in schedule.moves[grip.move].candidates
            else:
                same &= node == grip
        if not same:
            raise StepError(f"step {step.number} is none of schedule {schedule.method}")


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
    exceeds a limit, is not proven to stand, or has less of a margin.
    """
    if problem.each:
        found = [plan_values(each, steps, claimed) for each in problem.each]
        if problem.totals:
            return (problem.over.value(np.array(found)[:, 0]),)
        pairs = zip(problem.goals, zip(*found, strict=True), strict=True)
        of_ways = Measure.TRAVEL  # these are as they are planned
        return tuple(_travel(problem, steps) if g.measure is of_ways else max(v) for g, v in pairs)
    check_props(problem.engine, steps)
    check_shape(problem.engine, steps, problem.limits)
    columns = _state_columns(problem, steps, _analyzed(problem.engine, steps))
    for limit in problem.limits:
        if limit.response in columns and limit.exceeded(columns[limit.response]).any():
            at = int(np.argmax(columns[limit.response])) + 1
            raise SolverError(f"step {at} exceeds the limit on {limit.label}")
    margins, out = proven_margins(problem, steps), list[float]()
    for k, goal in enumerate(problem.goals):
        if goal.of_margins:
            require_margin(goal.response, claimed[k], margins[goal.response])
            out.append(claimed[k])
        elif goal.measure is Measure.MAKESPAN:
            twin = twin_of(goal.measure)
            out.append(claimed[k] if twin is None else twin.value(problem, steps, starts))
        else:
            costs = _costs(problem, goal, columns, steps)
            out.append(float(costs.max() if goal.measure is Measure.PEAK else costs.sum()))
    return tuple(out)


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


def _costs(
    problem: States, goal: Goal, columns: Mapping[str, np.ndarray], steps: Sequence[Step]
) -> np.ndarray:
    """Return what a goal takes of every step, (n,)."""
    if goal.measure is Measure.STEPS:
        return np.ones(len(steps))
    if goal.measure is Measure.REGRIPS:
        return np.array([step.kind is StepKind.REPOSITION for step in steps], dtype=float)
    if goal.measure is Measure.TRAVEL:
        return np.array([_travel(problem, steps)])
    bricks, out = np.array([step.bricks for step in steps]), np.zeros(len(steps))
    for stand in {*bricks.tolist()}:  # an empty site takes nothing but responses
        rows = np.flatnonzero(bricks == stand)
        found = {name: values[rows] for name, values in columns.items()}
        if goal.response or stand:
            out[rows] = goal_values(problem, goal, found, stand, np.ones(len(rows), dtype=bool))
    return out


def _travel(problem: States, steps: Sequence[Step]) -> float:
    """Return how far robots go straight from one grip to the next, m."""
    scene, site, total = problem.network.scene, problem.rules.begin, 0.0
    before = () if site is None else (site.stays or site.holds(scene), site.holds(scene))
    for nodes in zip(*before, *(step.grips for step in steps), strict=True):  # robot by robot
        held = [scene.node_position(node) for node in nodes if node is not None]
        for ends in pairwise(held):
            total += float(np.linalg.norm(np.subtract(*ends)))
    return total
