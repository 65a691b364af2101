"""Choose the states of a build, or a path through an instance."""

from __future__ import annotations

import operator
import time
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import partial
from math import inf, isfinite
from typing import Any

import numpy as np

from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.formulation import (
    Formulation,
    FormulationKind,
    Run,
    as_formulation,
    find_formulation,
    formulations,
)
from seqopt.graph.instance import PEAK, SUM, Instance
from seqopt.graph.orders import AllOrders, OrderSelection
from seqopt.graph.solution import StatePath
from seqopt.graph.states._visits import barred, steps_in_hands
from seqopt.graph.states.states import States
from seqopt.judge._orders import finds_better_order
from seqopt.judge.certificate import TOLERANCE
from seqopt.judge.schedules import judge_schedule
from seqopt.plan._guard import called, readable, require_proof, require_time, text, with_numbers
from seqopt.plan._infeasible import claimed, confirmed, without_order
from seqopt.plan._paths import PROOF, find_path
from seqopt.plan._status import FoundOrder
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Aim
from seqopt.responses.resources import HERE
from seqopt.scene.scene import in_order
from seqopt.work._workers import keep

AIMS = {SUM: Aim.SUM, PEAK: Aim.PEAK}


def able(instance: Instance) -> tuple[str, ...]:
    """Return the names of formulations that an instance fits, the usual one first."""
    every = formulations()
    asked = ("time" if instance.asks_time else "goals", "instance")
    found = [n for n, f in every.items() if f.fits(*asked) and not f.aim]
    if len(instance.goals) == 1 and instance.goals[0].kind in AIMS and not instance.asks_time:
        aim = AIMS[instance.goals[0].kind]
        found += [n for n, f in every.items() if f.aim is aim]
    if instance.caps:
        found = [name for name in found if every[name].takes_budgets]
    usual = ("makespan_labels", "labels" if instance.caps else "path_dp", "schedule_search")
    first = next(name for name in usual if name in found)
    return (first, *(name for name in found if name != first))


def solve_instance(instance: Instance, named: Formulation | str | None, run: Run) -> Plan:
    """Return the plan of a formulation, of which an instance has the nodes and no steps.

    Raises `ProblemError` if the formulation does not fit; `SolverError` if its answer is not what
    is claimed.
    """
    names = able(instance)
    formulation = as_formulation(named or names[0])
    if formulation.name not in names and formulation.name in formulations():
        raise ProblemError(
            f"{formulation.name}: instance {instance.name} does not fit; use {' or '.join(names)}"
        )
    require_time(formulation, run.time_limit)
    if run.lazy:
        raise ProblemError("an instance has all its costs; leave out lazy")
    found = find_path(instance, formulation, run)
    return Plan(
        instance, instance, formulation, found.selection, found.certificate, (), found.seconds
    )


COUNTED = ("each", "sets", "screened", "stability")  # of a problem: they know what was computed


def solve_states(graph: States, formulation: Formulation, run: Run) -> Plan:
    """Return the plan of a formulation of states, judged where a proof is asked for.

    Raises `InfeasibleError`, naming the brick at which it stops, and the rule or limit whose
    loosening opens a way; `ProblemError` if there is no such option; `SolverError` if the answer is
    not what its formulation claims.
    """
    formulation.require_options(run.options)
    if run.lazy:  # it is at any rate
        require_proof(run.proof)
    with keep(graph.resources.executor, graph.resources.workers):
        return _solved(graph, formulation, run)


def _solved(problem: States, formulation: Formulation, run: Run) -> Plan:
    start, twin = time.perf_counter(), replace(problem)  # which no formulation can reach
    told = {} if run.progress is None else {"progress": run.progress}
    limit = {"seconds": run.left} if isfinite(run.left) else {}
    options = {**run.options, **told, **limit}
    with run.clock.needed("finding a first plan"):
        selection = _selected(formulation, (problem, twin), options, explain=run.explains)
    selection = replace(selection, stopped=run.clock.why(selection.stopped))
    solved = time.perf_counter()
    if run.proof and run.progress is not None:
        run.progress("proving that no plan is better")
    steps = steps_in_hands(twin.space, selection.states, selection.grips)
    hint = dict(enumerate(selection.visited, start=twin.space.first))
    exact = formulation.kind is FormulationKind.EXACT
    certificate = None
    if run.proof:
        judged = partial(judge_schedule, twin, selection, steps, hint, exact=exact)
        certificate = run.clock.spare(PROOF, judged, None)
        if certificate is None:
            selection = replace(selection, stopped=run.clock.left_out[PROOF])
    problem.certified.update(twin.certified)
    seconds = {"solve": solved - start, "verify": time.perf_counter() - solved}
    return Plan(problem, problem, formulation, selection, certificate, steps, seconds)


def _selected(
    formulation: Formulation,
    problems: tuple[States, States],
    options: Mapping[str, Any],
    *,
    explain: bool,
) -> StatePath:
    """Return what a formulation says, with numbers where numbers belong; or why there is none."""
    (problem, twin), start, name = problems, time.perf_counter(), formulation.name
    limit = float(options.get("seconds", inf))
    solve = partial(formulation.solve, problem, **options)
    if barred(problem) is not None:  # what every plan passes is asked before any is sought
        raise confirmed(twin, name, limit, explain=explain)
    judged = partial(replace, problem, resources=HERE)  # who works for a formulation may change
    try:
        selection = called(name, judged, StatePath, solve)
    except InfeasibleError as error:
        left = limit - (time.perf_counter() - start)
        why = confirmed(twin, name, left, exact=formulation.looks_at_all, explain=explain)
        standing = problem.standing
        if type(why) is SolverError and standing is not None and standing.curing is not None:
            said = (
                f"{error} in which all states stand while mortar cures, though some are once it "
                "has; more robots may help, or mortar with some bond from 0 s on"
            )
            why = claimed(name, said, exact=formulation.looks_at_all)
        raise why from None
    for kept in [*vars(problem)]:  # whatever it left behind, but counts of what was computed
        if kept not in (*(f.name for f in fields(problem)), *COUNTED):
            del vars(problem)[kept]
    return with_numbers(name, selection, len(problem.goals))


ENDED = ("time", "interrupt")  # searches that were told to end: nothing more is computed


def solve_orders(problem: AllOrders, formulation: Formulation, run: Run) -> Plan:
    """Return the best plan of the best order, or of a good one with a bound.

    The plan is computed again for this one order and judged by its own certificate. Raises
    `InfeasibleError`, `ProblemError` if no order has a plan, or there is no such option;
    `SolverError` if the order is none that was asked for or not worth what is claimed, or another
    is better.
    """
    formulation.require_options(run.options)
    start, means = time.perf_counter(), problem.states.resources
    options = {**run.options, **({"seconds": run.left} if isfinite(run.left) else {})}
    means = replace(means, progress=run.progress or means.progress)
    twin = _judged_orders(problem)  # which no formulation can reach
    ends = start + float(options.get("seconds", inf))
    solve = partial(formulation.solve, problem, resources=means, **options)
    with run.clock.needed("finding a first plan"):
        selection = _selected_order(formulation, (problem, twin), ends, solve)
    selection = replace(selection, stopped=run.clock.why(selection.stopped))
    seconds = {"order": time.perf_counter() - start}
    proof = run.proof and run.clock.left > 0
    plan = _planned(formulation.name, twin, selection, proof=proof)
    start = time.perf_counter()
    prove = partial(_proven, formulation.name, twin, selection, ends)
    proven = proof and run.clock.spare(PROOF, prove, otherwise=False)
    seconds |= {**plan.seconds, "order_proof": time.perf_counter() - start}
    found = FoundOrder(twin, selection, proven)
    return replace(plan, problem=problem, formulation=formulation, seconds=seconds, order=found)


def _planned(name: str, problem: AllOrders, selection: OrderSelection, *, proof: bool) -> Plan:
    """Return the best plan of an order, which must be worth what is claimed."""
    in_order(problem.scene, selection.order)  # it names every brick once
    if not problem.allows(selection.order):
        raise SolverError(f"{name}: its order places a brick that nothing ties")
    plan = solve_states(
        problem.planned(selection.order), find_formulation("schedule_search"), Run(proof=proof)
    )
    (value, *_), claimed, bound = plan.selection.objective, selection.objective, selection.bound
    most = TOLERANCE * max(abs(value), abs(claimed))
    if not (abs(value - claimed) <= most and bound <= value + most):  # NaN is no bound
        raise SolverError(
            f"{name}: the value of the order is {value:.9g}; claimed are {claimed:.9g} and "
            f"a bound of {bound:.9g}"
        )
    return plan


def _selected_order(
    found: Formulation,
    problems: tuple[AllOrders, AllOrders],
    end: float,
    solve: Callable[[], object],
) -> OrderSelection:
    """Return what a formulation says, with numbers where numbers belong; or why there is none."""
    asked, problem = problems
    if problem.down is None and barred(problem.states) is not None:  # all orders end so
        raise confirmed(problem.states, found.name, end - time.perf_counter())
    try:
        said = called(found.name, lambda: (_judged_orders(asked), problem), OrderSelection, solve)
    except InfeasibleError as error:
        some = finds_better_order(problem, np.inf, end=end)
        if some and not problem.states.budgets:  # whether they are within these is not asked
            raise SolverError(
                f"formulation {found.name} says that no order has a plan, and some have"
            ) from None
        if some is False and problem.down is None:  # whose whole may be beyond limits
            raise without_order(problem, found.name, end - time.perf_counter()) from None
        raise claimed(found.name, str(error), exact=found.looks_at_all) from None
    with readable(found.name):
        order = tuple(operator.index(brick) for brick in said.order)
        objective, bound = float(said.objective), float(said.bound)
        evaluated, weights = operator.index(said.evaluated), tuple(map(float, said.weights))
        return OrderSelection(order, objective, bound, evaluated, text(said.stopped), weights)


def _judged_orders(problem: AllOrders) -> AllOrders:
    """Return what a formulation must not change; who works for it may."""
    return replace(problem, states=replace(problem.states, resources=HERE))


def _proven(name: str, problem: AllOrders, selection: OrderSelection, end: float) -> bool:
    """Return whether a bound on all orders is proven; raise an error if one is below it."""
    if selection.stopped in ENDED or not isfinite(selection.bound):
        return False
    bound = min(selection.bound, selection.objective)
    if problem.states.totals:  # what weights leave open, labels of the search alone close
        if len(selection.weights) != len(problem.states.scenarios):
            raise SolverError(f"{name}: there is no weight for every scenario")
        valid = problem.states.over.allowed(np.array(selection.weights))  # whatever was said
        weighed = replace(problem.states, weights=tuple(valid.tolist()))
        return finds_better_order(replace(problem, states=weighed), bound, end=end) is False
    better = finds_better_order(problem, bound, end=end)
    if better and not problem.states.budgets:  # of plans without these
        raise SolverError(
            f"{name}: {selection.bound:.9g} is promised as a bound on all orders; one has a plan "
            "with less"
        )
    return better is False
