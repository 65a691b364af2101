"""Choose the states of a build, and certify them."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from math import inf, isfinite
from typing import Any

from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph._candidates import walk
from seqopt.graph._spaces import barred, steps_in_hands
from seqopt.graph.formulation import Formulation, FormulationKind, Run, Solution, Watch
from seqopt.graph.states import States
from seqopt.judge._schedules import judge_schedule, ordered
from seqopt.plan._answers import Found, called, proven, with_numbers
from seqopt.plan._infeasible import claimed, confirmed
from seqopt.work._workers import keep

COUNTED = ("each", "stability")  # of a problem: they know what was computed


def find_states(problem: States, formulation: Formulation, run: Run) -> Found:
    """Find states of a build by a formulation, certified if a proof is requested.

    Raises `InfeasibleError`, naming the brick at which builds stop, and the rule or limit to relax;
    `ProblemError` if there is no such option; `SolverError` if the answer fails its check.
    """
    formulation.require_options(run.options)
    start = time.perf_counter()
    told: dict[str, Any] = {} if run.progress is None else {"progress": run.progress}
    watch = Watch(min(run.left, run.options.get("seconds", inf)), run.progress)
    limit = {"watch": watch} if formulation.watched else {"seconds": run.left}
    limit = limit if formulation.watched or isfinite(run.left) else {}
    with keep(problem.resources.executor, problem.resources.workers):
        with run.clock.needed("finding a first plan"):
            options = {**run.options, **told, **limit}
            selection = _selected(formulation, problem, options, run)
        stopped = run.clock.why(selection.stopped)
        selection = replace(selection, stopped=stopped, trace=watch.trace)
        solved = time.perf_counter()
        if run.proof and run.progress is not None:
            run.progress("proving that no plan is better")
        twin = replace(problem, answers={})  # it knows nothing that was computed for the search
        space = ordered(twin, selection.order).space
        steps = steps_in_hands(space, selection.states, selection.grips)
        hint = dict(enumerate(selection.visited, start=twin.space.first))
        exact = formulation.kind is FormulationKind.EXACT
        judge = partial(judge_schedule, twin, selection, steps, hint, exact=exact)
        selection, certificate = proven(selection, judge, run)
    problem.certified.update(twin.certified)
    written = selection.compile_seconds
    seconds = {"compile": written, "solve": solved - start - written}
    seconds["verify"] = time.perf_counter() - solved
    return Found(selection, certificate, steps, seconds)


def _walks(problem: States, formulation: Formulation, run: Run) -> bool:
    """Return whether a formulation looks at one decision after the other, and no proof is asked.

    What a single step does not tell is not looked at: whether it stands, and what paths must keep.
    """
    alone = formulation.window_options
    asked = not run.proof and alone is not None and run.options in ({}, alone)
    asked &= all(goal.of_criterion for goal in problem.aims)
    beside = problem.scenarios or problem.budgets or problem.demands or problem.paths
    return asked and problem.rules.names_robots() and not beside


def _for_search(problem: States) -> States:
    """Return a copy for a formulation: what it changes is its own, and the judge keeps its own."""
    own = replace(problem, judged={})
    known = {key: vars(problem)[key] for key in COUNTED if key in vars(problem)}
    if "each" in known:
        known["each"] = tuple(map(_for_search, known["each"]))
    vars(own).update(known)
    return own


def _selected(
    formulation: Formulation, problem: States, options: Mapping[str, Any], run: Run
) -> Solution:
    """Return the formulation's solution, converted to numbers; raise why there is none."""
    start, name, exact = time.perf_counter(), formulation.name, formulation.looks_at_all
    limit = min(run.left, float(options.get("seconds", inf)))
    if barred(problem) is not None:  # what every plan passes is asked before any is sought
        raise confirmed(replace(problem), name, limit, explain=run.explains)
    if _walks(problem, formulation, run):
        return walk(problem, Watch(run.left))
    own = _for_search(problem)
    try:
        selection = called(name, Solution, partial(formulation.solve, own, **options))
    except InfeasibleError as error:
        left = limit - (time.perf_counter() - start)
        why = confirmed(replace(problem), name, left, exact=exact, explain=run.explains)
        standing = problem.standing
        if type(why) is SolverError and standing is not None and standing.curing is not None:
            said = (
                f"{error} in which all states stand while mortar cures, though some are once it "
                "has; more robots may help, or mortar with some bond from 0 s on"
            )
            why = claimed(name, said, exact=exact)
        raise why from None
    vars(problem).update({key: vars(own)[key] for key in COUNTED if key in vars(own)})
    return with_numbers(name, selection, len(problem.goals))
