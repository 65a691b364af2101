"""Choose the states of a build, whatever the schedule."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import partial
from typing import Any

from seqopt.errors import InfeasibleError
from seqopt.graph.states.states import States
from seqopt.graph.states.visits import steps_of
from seqopt.plan.calling.formulation import Formulation, FormulationKind
from seqopt.plan.calling.guard import StatePath, called, with_numbers
from seqopt.plan.calling.selecting import require_proof
from seqopt.plan.calling.watch import Run
from seqopt.plan.judge.infeasible import confirmed
from seqopt.plan.judge.schedules import judge_schedule
from seqopt.plan.plan import Plan
from seqopt.responses.resources import HERE
from seqopt.work.workers import keep

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
    told = {} if run.progress is None else {"progress": run.progress}
    limit = {} if math.isinf(run.time_limit) else {"seconds": run.time_limit}
    with keep(graph.resources.executor, graph.resources.workers):
        return _solved(graph, formulation, {**run.options, **told, **limit}, proof=run.proof)


def _solved(
    problem: States, formulation: Formulation, options: Mapping[str, Any], *, proof: bool
) -> Plan:
    """Return the plan of a formulation, judged."""
    start, twin = time.perf_counter(), replace(problem)  # which no formulation can reach
    selection = _selected(formulation, problem, twin, options)
    solved = time.perf_counter()
    if proof and "progress" in options:
        options["progress"]("proving that no plan is better")
    steps = steps_of(twin.space, selection.states)
    hint = dict(enumerate(selection.visited))
    exact = formulation.kind is FormulationKind.EXACT
    certificate = judge_schedule(twin, selection, steps, hint, exact=exact) if proof else None
    problem.certified.update(twin.certified)
    seconds = {"solve": solved - start, "verify": time.perf_counter() - solved}
    return Plan(problem, problem, formulation, selection, certificate, steps, seconds)


def _judged(problem: States) -> States:
    """Return what a formulation must not change; who works for it may."""
    return replace(problem, resources=HERE)


def _selected(
    formulation: Formulation, problem: States, twin: States, options: Mapping[str, Any]
) -> StatePath:
    """Return what a formulation says, with numbers where numbers belong; or why there is none."""
    start, name = time.perf_counter(), formulation.name
    solve = partial(formulation.solve, problem, **options)
    try:
        selection = called(name, partial(_judged, problem), StatePath, solve)
    except InfeasibleError:
        left = float(options.get("seconds", math.inf)) - (time.perf_counter() - start)
        raise confirmed(twin, name, left) from None
    for kept in [*vars(problem)]:  # whatever it left behind, but counts of what was computed
        if kept not in (*(f.name for f in fields(problem)), *COUNTED):
            del vars(problem)[kept]
    return with_numbers(name, selection, len(problem.goals))
