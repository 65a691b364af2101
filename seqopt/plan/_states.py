"""Choose the states of a build, or a path through an instance."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import partial
from math import inf, isfinite
from typing import Any

from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.formulation import Formulation, FormulationKind, Run, as_formulation, formulations
from seqopt.graph.instance import PEAK, SUM, Instance
from seqopt.graph.solution import Solution
from seqopt.graph.states._visits import steps_in_hands
from seqopt.graph.states.explored import barred
from seqopt.graph.states.states import States
from seqopt.judge.schedules import judge_schedule, ordered
from seqopt.plan._guard import called, require_proof, require_time, with_numbers
from seqopt.plan._infeasible import claimed, confirmed
from seqopt.plan._paths import PROOF, find_path
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Aim
from seqopt.responses.resources import HERE
from seqopt.work._workers import keep

AIMS = {SUM: Aim.SUM, PEAK: Aim.PEAK}


def able(instance: Instance) -> tuple[str, ...]:
    """Return the names of applicable formulations of an instance, the default first."""
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
    """Solve an instance by a formulation; the plan has the nodes of a path and no steps.

    Raises `ProblemError` if the formulation is not applicable; `SolverError` if its answer fails
    the check.
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
    """Solve a problem of states by a formulation, certified if a proof is requested.

    Raises `InfeasibleError`, naming the brick at which builds stop, and the rule or limit to relax;
    `ProblemError` if there is no such option; `SolverError` if the answer fails its check.
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
    steps = steps_in_hands(ordered(twin, selection.order).space, selection.states, selection.grips)
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
    own = problem.at(selection.order)
    return Plan(problem, own, formulation, selection, certificate, steps, seconds)


def _selected(
    formulation: Formulation,
    problems: tuple[States, States],
    options: Mapping[str, Any],
    *,
    explain: bool,
) -> Solution:
    """Return the formulation's solution, converted to numbers; raise why there is none."""
    (problem, twin), start, name = problems, time.perf_counter(), formulation.name
    limit = float(options.get("seconds", inf))
    solve = partial(formulation.solve, problem, **options)
    if barred(problem) is not None:  # what every plan passes is asked before any is sought
        raise confirmed(twin, name, limit, explain=explain)
    judged = partial(replace, problem, resources=HERE)  # who works for a formulation may change
    try:
        selection = called(name, judged, Solution, solve)
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
