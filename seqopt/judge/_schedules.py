"""Certificates of schedules: a plan recomputed from its steps, and a proof that none is better.

The values of the plan come from the responses of its steps, of which only those are computed that
are asked. Whether steps stand, bear on props and keep the linear range is found again, too; that
shares the engine and the cone program alone with the search. Lower bounds of all plans are proven
goal by goal (`seqopt.judge._proof`): this shares nothing with the search but the states that it
visited, on which only the time depends.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import reduce
from itertools import pairwise
from math import pi
from operator import or_
from typing import TYPE_CHECKING

import numpy as np

from seqopt._registry import Later
from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Engine, Fields, Want, linear_limit
from seqopt.errors import SolverError, StepError
from seqopt.graph.formulation import Solution
from seqopt.graph.states import States
from seqopt.judge._proof import Hint, Proof, TooManyPartsError
from seqopt.judge._rule_moves import check_free, may_follow
from seqopt.judge._states import StateEvaluator, depends_on_robots, largest_load, props_that_hold
from seqopt.judge.certificate import (
    TOLERANCE,
    Basis,
    Certificate,
    _own_values,
    _twin_of,
    exceeds,
    limit_below,
)
from seqopt.problem.amounts import LARGEST, NONE, Amount, MoveArrays, StateArrays
from seqopt.problem.requirements import LINEAR_RANGE, Limit, StepArrays, _first_fault
from seqopt.responses._grip_sets import Moved
from seqopt.responses._tolerance import is_tolerance, misfits_along, step_tolerance
from seqopt.responses.quantities import CHOSEN_BY, PROP_EXCESS, _excess_of, lengths, require_finite
from seqopt.responses.table import _each_fields
from seqopt.scene.parts import Prop
from seqopt.scene.scene import Order, _check_postures
from seqopt.sequence.rules import _check_carried
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability.standing import Standing, _size, slack
from seqopt.stability.verdict import ASSESSED, Verdict

if TYPE_CHECKING:
    from seqopt.stability.assessment import Stability

STEPS = Later("seqopt.stability._steps")  # where states must stand
ENDED = ("time", "memory", "interrupt")  # searches that were stopped: no bound is proven
SURE = 1e-3  # rad, or as a share: how far the cone program may be from what forces prove
_UNFELT = 1e-3  # of the mean weight of a brick, far more than forces err
_TENTH = 0.1  # of the smallest side of any brick
_LITTLE = 1e-6  # by which a motion may be larger, over its limit
Bounds = tuple[float, ...]


def judge_schedule(
    problem: States,
    selection: Solution,
    steps: Sequence[Step],
    hint: Hint | None = None,
    *,
    exact: bool = True,
) -> Certificate:
    """Check a schedule from the problem's own data, without the search.

    ``selection``: what a formulation claims; ``steps``: of the selection, checked in the scene;
    ``hint`` (mapping of int to (n, c) int): states that a search visited, by level; only the
    time that the proof takes depends on them; ``exact``: whether values are claimed to be optimal;
    else only the claimed bounds are checked. Raises `SolverError` if a value is not what was
    claimed, a limit or a budget is exceeded, or a plan is better than promised; `StepError` if a
    step breaks a rule.
    """
    aims = len(problem.aims)
    values, moved = _as_claimed(ordered(problem, selection.order), selection, steps)
    for goal, spent, cap in zip(problem.goals[aims:], values[aims:], problem.budgets, strict=True):
        if not spent <= cap + TOLERANCE * cap:
            raise SolverError(f"{goal} is {spent:.9g}, more than the {cap:g} that are allowed")
    by_labels, proves = problem.is_timed or bool(problem.paths), bool(selection.proofs)
    if problem.is_timed:
        twin = next((goal.twin for goal in problem.goals if goal.in_time), None)
        proves = twin is not None and bool(np.isfinite(selection.bound).any())
    # a bound is proven soon, of a search that stopped early too, as of loops
    quick = problem.rules.has_pairs and not problem.demands
    quick &= bool(selection.prices) or not (problem.budgets or problem.totals)
    is_claimed = not proves and (bool(selection.stopped and not quick) or by_labels)
    bounds: Bounds = (-np.inf,) * max(1, aims)  # they are claimed alone
    with suppress(TooManyPartsError):
        if not is_claimed and _has_twins(problem):
            exact &= not selection.stopped
            return replace(_proven(problem, selection, values, hint, exact=exact), moved=moved)
        first, least = replace(problem, budgets=(), goals=problem.goals[:1]), selection.bound[0]
        is_sought = selection.stopped not in ENDED and not by_labels and _has_twins(first)
        if is_sought and np.isfinite(least):
            if not Proof(first).bounds_first(least):
                raise SolverError(f"{least:.9g} is promised as the least; a plan has less")
            bounds = (least, *bounds[1:])
    gap = _gap(problem.aims, values, bounds)
    left = _gap(problem.aims, values, _closed(values, tuple(map(max, bounds, selection.bound))))
    return Certificate(values, bounds, gap, left, basis=Basis.REBUILT, moved=moved)


def ordered(problem: States, order: Order) -> States:
    """Return the problem of a claimed order; a `SolverError` if the order is infeasible.

    ``order``: names of all bricks; empty where it is given.
    """
    if problem.orders is None:
        if order:
            raise SolverError("an order of the bricks is claimed, where it is given")
        return problem
    scene = problem.network.scene
    if sorted(order) != sorted(scene.build_order):
        raise SolverError(f"the order {order} does not name every brick once")
    begun = problem.free_rules.span(scene)[0]
    ties = (
        may_follow(scene, problem.orders, order[:k], order[k]) for k in range(begun, len(order))
    )
    if {*order[:begun]} != {*scene.build_order[:begun]} or not all(ties):
        raise SolverError("the order places a brick that nothing ties")
    return problem.at(order)


def _proven(
    problem: States, selection: Solution, values: Bounds, hint: Hint | None, *, exact: bool
) -> Certificate:
    """Return the certificate of values with proven bounds.

    Over scenario totals it is of the claimed weights, projected to valid ones.
    """
    budgets, aims, claimed, weighed = problem.budgets, len(problem.aims), selection.bound, problem
    if problem.totals:
        if [*map(len, selection.prices)] != [len(problem.each)]:
            raise SolverError("there is no weight for every scenario")
        weights = problem.over.allowed(np.array(selection.prices[0]))
        weighed = replace(problem, weights=tuple(weights.tolist()))
    proof = Proof(weighed, hint)
    margins = _margin_bounds(problem, proof, values)
    if problem.is_timed or problem.paths:
        found = proof.label_bounds(values, selection)
    elif budgets:
        found = proof.budget_bounds(values, claimed, selection.prices)
    else:
        found = proof.bounds(values) if len(margins) < len(values) else margins
    bounds = _closed(values, (*margins, *found[len(margins) :]))[: max(1, aims)]
    if not (problem.is_timed or problem.totals or problem.paths):
        promised = values if exact and not budgets else claimed
        for goal, bound, least in zip(problem.aims, bounds, promised, strict=False):
            low = least - TOLERANCE * abs(least) if budgets else limit_below(least)
            if not goal.margins and not bound >= low:
                lower = f"{least:.9g} is promised as the least; a plan has less"
                within = f"no plan within budgets is promised below {least:.9g}"
                raise SolverError(f"{goal}: {within if budgets else lower}")
        claimed = bounds
    claimed = _closed(values, tuple(map(max, bounds, claimed)))
    gap, left = (_gap(problem.goals, values, each) for each in (bounds, claimed))
    return Certificate(values, bounds, gap, left, {}, proof.states, proof.models, Basis.REBUILT)


def _closed(values: Sequence[float], bounds: Sequence[float]) -> Bounds:
    """Return bounds capped by values; those within rounding of a value are set to it."""
    return tuple(v if b >= limit_below(v) else b for v, b in zip(values, bounds, strict=False))


def _has_twins(problem: States) -> bool:
    """Return whether goals of states and moves, filters and resources all have twins."""
    goals = (_twin_of(goal) is not None or goal.in_time for goal in problem.goals)
    filters = all(each.twin is not None for each in problem.filters)
    return all(goals) and filters and all(each.twin is not None for each in problem.paths)


def _gap(goals: Sequence[Amount], values: Sequence[float], bounds: Sequence[float]) -> float:
    """Return the largest gap of the first goals, relative to the size of their values."""
    return max(
        (value - bound) / (_size(goal.name, value) or 1.0)
        for goal, value, bound in zip(goals, values, bounds, strict=False)
    )


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


def _as_claimed(
    problem: States, selection: Solution, steps: Sequence[Step]
) -> tuple[Bounds, Moved]:
    """Return what feasible steps come to, recomputed; a `SolverError` if else was claimed."""
    if isinstance(problem.rules, Schedule):
        _check_scheduled(problem.rules, steps)
        _check_carried(problem.network.scene, steps, problem.worlds)
    else:
        check_free(problem.network, problem.rules, steps, problem.worlds)
    _check_postures(problem.network.scene, steps)
    values, moved = _recomputed(problem, steps, selection.objective, selection.starts)
    for goal, value, claimed in zip(problem.names, values, selection.objective, strict=True):
        if not abs(value - claimed) <= TOLERANCE * max(abs(value), abs(claimed)):
            raise SolverError(f"{goal} is {value:.9g}, not {claimed:.9g} as claimed")
    return values, moved


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
    return _recomputed(problem, steps, claimed, starts)[0]


def _recomputed(
    problem: States, steps: Sequence[Step], claimed: Sequence[float], starts: Sequence[float]
) -> tuple[Bounds, Moved]:
    """Return these values, and the largest displacement, in any scenario."""
    moves = _moves(problem, steps)  # these are as they are planned
    if problem.each:
        found = [_recomputed(each, steps, claimed, ()) for each in problem.each]
        every, moved = [own[0] for own in found], max(found, key=lambda own: own[1].share)[1]
        if problem.totals:
            return (problem.over.value(np.array(every)[:, 0]),), moved
        pairs = zip(problem.goals, zip(*every, strict=True), strict=True)
        worst = (max(v) if g.moves is None else _value(g, (), moves) for g, v in pairs)
        return tuple(worst), moved
    (levels, moved), out = _states(problem, steps), list[float]()
    fault = _first_fault(problem.paths, _held(problem, steps)) if problem.paths else None
    if fault is not None:
        number = steps[fault[1]].number
        raise SolverError(f"the resource {fault[0]} is not kept up to step {number}")
    margins, by_level = proven_margins(problem, steps, claimed), np.zeros((0, 0))
    if elsewhere := depends_on_robots(problem):
        by_level = StateEvaluator(problem).of_steps(steps)
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
    return tuple(out), moved


Levels = Sequence[tuple[Ints, StateArrays]]  # rows of steps, and the states that they lead to


def _value(goal: Amount, levels: Levels, moves: MoveArrays) -> float:
    """Return the value of an amount of states or moves of a plan, by its twin if it has one."""
    values = _own_values(goal)
    assert values is not None  # it is of no whole path
    every = [values(moves)] if goal.moves else [values(states) for _, states in levels]
    costs = np.concatenate([np.zeros(1), *every])
    return float(costs.max() if goal.is_peak else costs.sum())


def _states(problem: States, steps: Sequence[Step]) -> tuple[Levels, Moved]:
    """Return the states that steps lead to, with as many bricks each, and the largest displacement.

    The empty site, where a take-down ends, is none: nothing is taken of it. Raises `SolverError` if
    a step exceeds a limit or a payload, or does not pass a filter, by its own function or its twin.
    """
    check_props(problem.engine, steps)
    check_shape(problem.engine, steps, problem.limits)
    columns, forces = _responses(problem, steps)
    robots, moved = problem.network.scene.robots, columns["D_max"]
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
    share, at = moved / linear_limit(problem.network.scene), int(moved.argmax())
    return out, Moved(float(share[at]), steps[at].number if share[at] else 0)


def _responses(problem: States, steps: Sequence[Step]) -> tuple[dict[str, Floats], Floats]:
    """Return responses (n,) of steps by name, SI units, and forces (n, r) of robots, N.

    Those that are asked, and the displacement, from fields that are solved anew.
    """
    network, scene = problem.network, problem.network.scene
    out = {name: np.zeros(len(steps)) for name in (*problem.named, "D_max")}
    chosen = [CHOSEN_BY[name] for name in out if name in CHOSEN_BY]
    want, forces = reduce(or_, (r.needs for r in chosen)), np.zeros((len(steps), len(scene.robots)))
    every = zip(steps, _each_fields(problem.engine, steps, want), strict=True)
    for k, (step, fields) in enumerate(every):
        bricks, held = step.bricks, [r for r, node in enumerate(step.grips) if node is not None]
        size = require_finite("grip force", lengths(fields.grip_force[0]), bricks)
        forces[k, held] = size[: len(held)]
        for response in chosen if bricks else ():
            value = require_finite(response.name, response.of(network, fields), bricks)
            out[response.name][k] = value[0]
        if PROP_EXCESS in out:
            props = [prop for _, prop in props_that_hold(scene, bricks, len(held))]
            out[PROP_EXCESS][k] = _excess_of(props, fields.grip_force[:, len(held) :])[0]
    for name in filter(is_tolerance, out):
        each = [step_tolerance(problem.engine, step).distance for step in steps]
        out[name] = misfits_along(1e3 * np.array(each))
    return out | {LARGEST: forces.max(axis=1, initial=0.0)}, forces


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


def _fields(engine: Engine, step: Step, want: Want) -> tuple[list[Prop], Fields]:
    """Return the props that hold in a step, and its fields; forces of props come last."""
    scene = engine.network.scene
    held = scene.grip_numbers(step.grips)
    props = props_that_hold(scene, step.bricks, len(held))
    grips = np.array([[*held, *(number for number, _ in props)]], dtype=np.int64)
    return [prop for _, prop in props], engine.solve(step.bricks, grips, want)


def check_props(engine: Engine, steps: Sequence[Step]) -> None:
    """Raise a `SolverError` if a prop pulls that may only push, or bears more than it may."""
    scene = engine.network.scene
    if not any(prop.direction or prop.capacity for prop in scene.props):
        return
    little = _UNFELT * (float(np.linalg.norm(engine.network.weight, axis=1).mean()) or 1.0)
    for step in steps:
        if not props_that_hold(scene, step.bricks, len(step.held)):
            continue  # as on the empty site, where a take-down ends
        props, fields = _fields(engine, step, Want(0))
        for prop, force in zip(props, fields.grip_force[0, -len(props) :], strict=True):
            size = float(np.linalg.norm(force))
            if prop.capacity is not None and size > prop.capacity + little:
                bears = f"bears {size:.4g} N of {prop.capacity:g} N"
                raise SolverError(f"step {step.number}: the {prop.label} {bears}")
            if prop.direction is not None and np.dot(force, prop.direction) < -little:
                raise SolverError(f"step {step.number}: the {prop.label} pulls, and may only push")


def check_shape(engine: Engine, steps: Sequence[Step], limits: Sequence[Limit]) -> None:
    """Raise a `SolverError` if a node moves farther than a limit of the linear range allows."""
    shares = [limit.shown(limit.bound) for limit in limits if limit.label == LINEAR_RANGE]
    placed = engine.network.scene.placed
    most = min(shares, default=np.inf) * _TENTH * min(min(b.dimensions) for b in placed)
    at = np.array([[brick.node_position(node) for node in brick.nodes] for brick in placed])
    lever = at - np.array([brick.position for brick in placed])[:, None]
    for step in steps if shares else ():
        if step.bricks:
            twist = _fields(engine, step, Want.BRICKS)[1].brick_twist[0][:, None]
            moved = twist[..., :3] + np.cross(twist[..., 3:], lever[: step.bricks])
            farthest = float(np.linalg.norm(moved, axis=2).max())
            if not farthest <= most * (1 + _LITTLE):
                raise SolverError(
                    f"step {step.number}: a node moves {farthest:.4g} m, and the linear range "
                    f"ends at {most:.4g} m"
                )


def proven_margins(
    problem: States, steps: Sequence[Step], claimed: Sequence[float]
) -> dict[str, float]:
    """Return the margins of a plan, as claimed if they are; every step must stand as demanded.

    ``claimed``: by goal, if any is. Worst margins are found only where they are asked for: ``bond``
    (Pa), ``friction``, and how far ``tilt`` is from a right angle (rad). A `SolverError` names the
    step that is not proven to stand, or a margin that is worse by more than its proven width.
    """
    standing = problem.standing
    said, stand = list[str](), list[bool]()
    results: tuple[Stability, ...] = ()
    if any(goal.margins for goal in problem.goals) or (standing and standing.tilt):
        results = certified(problem, steps)
        said = [f"{each.verdict.value}, tilt survived {each.tilt:.4g} rad" for each in results]
        least = (standing or Standing()).tilt - SURE
        stand = [r.verdict is Verdict.STANDS and not r.tilt < least for r in results]
    elif standing is not None:
        verdicts = STEPS.step_verdicts(problem.network, steps, standing.mortar)
        said, stand = [v.value for v in verdicts], [v is Verdict.STANDS for v in verdicts]
    for step, what, does in zip(steps, said, stand, strict=bool(said)):
        if standing is not None and not does:
            raise SolverError(f"step {step.number} is not proven to stand as demanded: {what}")
    worst = {"bond": [r.bond for r in results], "friction": [r.friction for r in results]}
    worst["tilt"] = [pi / 2 - result.tilt for result in results]
    out = {}
    for k, name in [(k, goal.name) for k, goal in enumerate(problem.goals) if goal.margins]:
        proven = float(np.max(worst[name]))
        out[name] = claimed[k] if claimed else proven
        if not proven <= out[name] + slack(name, out[name]):
            raise SolverError(f"{name} is {proven:.6g}, not {out[name]:.6g} as claimed")
    return out


def certified(problem: States, steps: Sequence[Step]) -> tuple[Stability, ...]:
    """Return verdict and margins of every step by the cone program; of equal ones once."""
    mortar = (problem.standing or Standing()).mortar
    for step in steps:
        if (step.bricks, step.grips) not in problem.certified:
            (result,) = STEPS.each_stability(problem.network, [step], mortar, ASSESSED)
            problem.certified[step.bricks, step.grips] = result
    return tuple(problem.certified[step.bricks, step.grips] for step in steps)
