"""Certificates of free schedules: a plan recomputed, and a proof that none is better.

The values of the plan come from the responses of its steps. Lower bounds of all plans are proven
goal by goal (`seqopt.judge._proof`): this shares nothing with the search but the states that it
visited, on which only the time depends.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import SolverError, StepError
from seqopt.graph._spaces import order_rules
from seqopt.graph.formulation import Solution
from seqopt.graph.states import States
from seqopt.judge._candidates import depends_on_robots, values_by_level
from seqopt.judge._proof import BELOW, Hint, Proof, TooManyPartsError
from seqopt.judge._rule_moves import check_free
from seqopt.judge._states import StateEvaluator, largest_load
from seqopt.judge._step_checks import check_props, check_shape, proven_margins
from seqopt.judge._twin import exceeds, own_values, twin_of
from seqopt.judge.certificate import TOLERANCE, Basis, Certificate
from seqopt.problem.amounts import LARGEST, NONE, Amount, MoveArrays, StateArrays
from seqopt.problem.requirements import StepArrays, _first_fault
from seqopt.responses._tolerance import is_tolerance, misfits_along, step_tolerance
from seqopt.responses.quantities import CHOSEN_BY, EXCESS_COLUMN, PROP_EXCESS
from seqopt.responses.table import _analyzed, _Columns, force_column
from seqopt.scene.scene import Order, _check_postures
from seqopt.sequence.rules import _check_carried
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability.standing import _size, slack

ENDED = ("time", "memory", "interrupt")  # searches that were stopped: no bound is proven
Bounds = tuple[float, ...]


def judge_schedule(
    problem: States,
    selection: Solution,
    steps: Sequence[Step],
    hint: Hint | None = None,
    *,
    exact: bool = True,
) -> Certificate:
    """Check a free schedule from the problem's own data, without the search.

    ``selection``: what a formulation claims; ``steps``: of the selection, checked in the scene;
    ``hint`` (mapping of int to (n, c) int): states that a search visited, by brick count; only the
    time that the proof takes depends on them; ``exact``: whether values are claimed to be optimal;
    else only the claimed bounds are checked. Raises `SolverError` if a value is not what was
    claimed, a limit or a budget is exceeded, or a plan is better than promised; `StepError` if a
    step breaks a rule.
    """
    own, aims = ordered(problem, selection.order), len(problem.aims)
    values = _as_claimed(own, selection, steps)
    for goal, spent, cap in zip(problem.goals[aims:], values[aims:], problem.budgets, strict=True):
        if not spent <= cap + TOLERANCE * cap:
            raise SolverError(f"{goal} is {spent:.9g}, more than the {cap:g} that are allowed")
    by_labels, proves = problem.is_timed or bool(problem.paths), bool(selection.proofs)
    if problem.is_timed:
        twin = next((goal.twin for goal in problem.goals if goal.in_time), None)
        proves = twin is not None and bool(np.isfinite(selection.bound).any())
    early = bool(selection.stopped) and not _is_quick(problem, selection)
    is_claimed = not proves and (early or by_labels)
    bounds: Bounds = (-np.inf,) * len(problem.goals)  # they are claimed alone
    with suppress(TooManyPartsError):
        if not is_claimed and _has_twins(problem):
            exact &= not selection.stopped
            return _proven(problem, selection, values, hint, exact=exact)
        first, least = replace(problem, budgets=(), goals=problem.goals[:1]), selection.bound[0]
        is_sought = selection.stopped not in ENDED and not by_labels and _has_twins(first)
        if is_sought and np.isfinite(least):
            if not Proof(first).bounds_first(least):
                raise SolverError(f"{least:.9g} is promised as the least; a plan has less")
            bounds = (least, *bounds[1:])
    gap = _gap(problem.aims, values, bounds)
    left = gap if is_claimed else _gap(problem.aims, values, _closed(values, selection.bound))
    return Certificate(values, bounds, gap, left, basis=Basis.REBUILT)


def _is_quick(problem: States, selection: Solution) -> bool:
    """Return whether a bound is proven soon, of a search that stopped early too: as of loops."""
    priced = bool(selection.prices) or not (problem.budgets or problem.totals)
    return problem.rules.has_pairs and priced and not problem.demands


def ordered(problem: States, order: Order) -> States:
    """Return the problem of a claimed order; a `SolverError` if the order is infeasible.

    ``order``: names of all bricks; empty where it is given.
    """
    if problem.orders is None:
        if order:
            raise SolverError("an order of the bricks is claimed, where it is given")
        return problem
    if sorted(order) != sorted(problem.network.scene.build_order):
        raise SolverError(f"the order {order} does not name every brick once")
    if not order_rules(problem).allows(order):
        raise SolverError("the order places a brick that nothing ties")
    return problem.at(order)


def _proven(
    problem: States, selection: Solution, values: Bounds, hint: Hint | None, *, exact: bool
) -> Certificate:
    """Return the certificate of values with proven bounds."""
    budgets, aims = problem.budgets, len(problem.aims)
    proof, claimed = Proof(_weighed(problem, selection), hint), selection.bound
    margins = _margin_bounds(problem, proof, values)
    if problem.is_timed or problem.paths:
        found = proof.label_bounds(values, selection)
    elif budgets:
        found = proof.budget_bounds(values, claimed, selection.prices)
    else:
        found = proof.bounds(values) if len(margins) < len(values) else margins
    bounds = _closed(values, (*margins, *found[len(margins) :]))
    if not (problem.is_timed or problem.totals or problem.paths):
        promised = values if exact and not budgets else claimed
        for goal, bound, least in zip(problem.aims, bounds, promised, strict=False):
            off, lower = TOLERANCE if budgets else BELOW, f"promised below {least:.9g}"
            if not goal.margins and not bound >= least - off * abs(least):
                if budgets:
                    raise SolverError(f"{goal}: no plan within budgets is {lower}")
                raise SolverError(f"{goal}: {least:.9g} is promised as the least; a plan has less")
        claimed = bounds
    claimed = _closed(values, tuple(map(max, bounds, claimed)))
    gap, left = (_gap(problem.goals, values, each) for each in (bounds, claimed))
    bounds = (*bounds, *values[aims:])
    return Certificate(values, bounds, gap, left, {}, proof.states, proof.models, Basis.REBUILT)


def _closed(values: Sequence[float], bounds: Sequence[float]) -> Bounds:
    """Return bounds capped by values; those within rounding of a value are set to it."""
    pairs = zip(values, bounds, strict=False)
    return tuple(v if b >= v - BELOW * abs(v) else b for v, b in pairs)


def _has_twins(problem: States) -> bool:
    """Return whether goals of states and moves, filters and resources all have twins."""
    goals = (twin_of(goal) is not None or goal.in_time for goal in problem.goals)
    filters = all(each.twin is not None for each in problem.filters)
    return all(goals) and filters and all(each.twin is not None for each in problem.paths)


def _gap(goals: Sequence[Amount], values: Sequence[float], bounds: Sequence[float]) -> float:
    """Return the largest gap of the first goals, relative to the size of their values."""
    return max(
        (value - bound) / (_size(goal.name, value) or 1.0)
        for goal, value, bound in zip(goals, values, bounds, strict=False)
    )


def _weighed(problem: States, selection: Solution) -> States:
    """Return a problem over scenario totals with the claimed weights, projected to valid ones."""
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
        if goal.margins:
            bound = max(0.0, value - slack(goal.name, value))
            if value > 0 and not proof.is_impossible((*values[: len(out)], bound)):
                raise SolverError(f"{goal}: {value:.9g} is promised as the least; a plan has less")
            out.append(bound)
    return tuple(out)


def _as_claimed(problem: States, selection: Solution, steps: Sequence[Step]) -> Bounds:
    """Return the recomputed values of feasible steps; a `SolverError` if others were claimed."""
    if isinstance(problem.rules, Schedule):
        _check_scheduled(problem.rules, steps)
        _check_carried(problem.network.scene, steps, problem.worlds)
    else:
        check_free(problem.network, problem.rules, steps, problem.worlds)
    _check_postures(problem.network.scene, steps)
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
    """Return the values of goals of a sequence, from the responses of its steps.

    ``claimed``: the value of every goal; margins of stability are compared with these, and taken
    from them; ``starts``: where mortar cures, when steps start, s. Result: SI units. Over scenarios
    the largest, but distances, which are those of the scene itself. Raises `SolverError` if a step
    exceeds a limit, is not proven to stand, or has less of a margin.
    """
    moves = _moves(problem, steps)  # these are as they are planned
    if problem.each:
        found = [plan_values(each, steps, claimed) for each in problem.each]
        if problem.totals:
            return (problem.over.value(np.array(found)[:, 0]),)
        pairs = zip(problem.goals, zip(*found, strict=True), strict=True)
        return tuple(max(v) if g.moves is None else _value(g, (), moves) for g, v in pairs)
    levels, out = _states(problem, steps), list[float]()
    fault = _first_fault(problem.paths, _held(problem, steps)) if problem.paths else None
    if fault is not None:
        number = steps[fault[1]].number
        raise SolverError(f"the resource {fault[0]} is not kept up to step {number}")
    margins, by_level = proven_margins(problem, steps, claimed), np.zeros((0, 0))
    if elsewhere := depends_on_robots(problem):
        evaluator = StateEvaluator(problem)
        by_level = values_by_level(evaluator, [evaluator.tables.row(s.grips) for s in steps])
    for k, goal in enumerate(problem.goals):
        if goal.margins is not None:
            out.append(margins[goal.name])
        elif goal.in_time:
            known = goal.twin is not None
            out.append(goal.twin.value(problem, steps, starts) if known else claimed[k])
        elif k in elsewhere:
            own = by_level[:, k]
            out.append(float(own.max(initial=0.0) if goal.is_peak else own.sum()))
        else:
            out.append(_value(goal, levels, moves))
    return tuple(out)


Levels = Sequence[tuple[Ints, StateArrays]]  # rows of steps, and the states that they lead to


def _value(goal: Amount, levels: Levels, moves: MoveArrays) -> float:
    """Return the value of an amount of states or moves of a plan, by its twin if it has one."""
    values = own_values(goal)
    assert values is not None  # it is of no whole path
    every = [values(moves)] if goal.moves else [values(states) for _, states in levels]
    costs = np.concatenate([np.zeros(1), *every])
    return float(costs.max() if goal.is_peak else costs.sum())


def _states(problem: States, steps: Sequence[Step]) -> Levels:
    """Return the states that steps lead to, with as many bricks each, and their responses.

    The empty site, where a take-down ends, is none: nothing is taken of it. Raises `SolverError` if
    a step exceeds a limit or a payload, or does not pass a filter, by its own function or its twin.
    """
    check_props(problem.engine, steps)
    check_shape(problem.engine, steps, problem.limits)
    table, robots = _analyzed(problem.engine, steps), problem.network.scene.robots
    each_force = [table[force_column(robot)] for robot in robots]  # NaN where one holds nothing
    forces = np.nan_to_num(np.abs(np.array(each_force, dtype=float).T))
    columns = _responses(problem, steps, table) | {LARGEST: forces.max(axis=1)}
    for limit in problem.limits:
        if limit.response in columns and exceeds(limit, columns[limit.response]).any():
            at = int(np.argmax(columns[limit.response])) + 1
            raise SolverError(f"step {at} exceeds the limit on {limit.label}")
    most = np.array([largest_load(problem, r, stand=False) for r in range(len(robots))])
    for row, robot in np.argwhere(forces > most + TOLERANCE * most).tolist():
        raise SolverError(
            f"step {steps[row].number}: {robots[robot].name} holds {forces[row, robot]:.6g} N, "
            f"more than the {most[robot]:.6g} N that are allowed"
        )
    held = _held(problem, steps)
    able, free = np.ones(len(steps), dtype=bool), np.full(forces.shape, np.inf)
    every = StateArrays(0, held.after, columns, forces, free, able, problem.criterion, held.after)
    rows = [np.flatnonzero(held.bricks == k) for k in np.unique(held.bricks[held.bricks > 0])]
    out = [(own, every.only(own)._replace(bricks=int(held.bricks[own[0]]))) for own in rows]
    for each in problem.filters:
        for own, states in out:
            refused = own[~each.proven(states) | each.refuted_again(states)]
            if len(refused):
                number = steps[refused[0]].number
                raise SolverError(f"step {number} does not pass the filter {each.name}")
    return out


def _responses(problem: States, steps: Sequence[Step], table: _Columns) -> dict[str, Floats]:
    """Return responses (n,) by name, SI units, of the columns of `seqopt.analyze`."""
    out = dict[str, Floats]()
    for name in problem.named:
        if name == "C_max":
            out[name] = np.maximum(0.0, -np.asarray(table["F_min_N"], dtype=float))
        elif name == PROP_EXCESS:
            out[name] = np.asarray(table[EXCESS_COLUMN], dtype=float)
        elif is_tolerance(name):
            each = [step_tolerance(problem.engine, step).distance for step in steps]
            out[name] = misfits_along(1e3 * np.array(each))
        elif name != LARGEST:
            chosen = CHOSEN_BY[name]
            out[name] = np.asarray(table[chosen.column], dtype=float) / chosen.scale
    return out


def _held(problem: States, steps: Sequence[Step]) -> StepArrays:
    """Return the bricks that stand after steps, and the nodes held before and after them."""
    site, scene = problem.rules.begin, problem.network.scene
    first = (None,) * len(scene.robots) if site is None else site.holds(scene)
    every = [first, *(step.grips for step in steps)]
    nodes = np.array([[NONE if n is None else n for n in grips] for grips in every])
    return StepArrays(np.array([step.bricks for step in steps]), nodes[:-1], nodes[1:])


def _moves(problem: States, steps: Sequence[Step]) -> MoveArrays:
    """Return the steps as moves: which are regrips, and how far robots go straight in them, m."""
    scene, site = problem.network.scene, problem.rules.begin
    before = () if site is None else (site.stays or site.holds(scene), site.holds(scene))
    distances = np.zeros(len(steps) + len(before))
    for nodes in zip(*before, *(step.grips for step in steps), strict=True):  # robot by robot
        held = [(k, scene.node_position(node)) for k, node in enumerate(nodes) if node is not None]
        for (_, at), (k, to) in pairwise(held):
            distances[k] += float(np.linalg.norm(np.subtract(at, to)))
    regrips = [float(step.kind is StepKind.REPOSITION) for step in steps]
    return MoveArrays(np.array(regrips), distances[len(before) :])
