"""From a problem to its plan: a graph of choices, a formulation, a judge.

A problem becomes a graph: layers of candidates, states of a build, or the arcs of an instance. A
formulation chooses a path through it. The judge computes its values and a bound again, from the
problem's own data. What was found and proven is the plan.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from seqopt.errors import ProblemError, SolverError, StepError
from seqopt.graph._windows import Windows, walk_windows
from seqopt.graph.formulation import (
    End,
    Formulation,
    Run,
    Solution,
    Watch,
    as_formulation,
    formulations,
    timed,
)
from seqopt.graph.instance import Instance
from seqopt.graph.layers.compiled import compile_layers
from seqopt.graph.layers.layers import Layers
from seqopt.graph.source import ARCS, CANDIDATES, STATES, Source
from seqopt.graph.states.states import States
from seqopt.judge._step_checks import check_shape
from seqopt.judge.certificate import _require_anew
from seqopt.plan._guard import require_fit, require_proof, require_time
from seqopt.plan._paths import Found, find_path, judged
from seqopt.plan._range import best_within
from seqopt.plan.plan import Plan
from seqopt.plan.pose import AIMS, graph_kind, graph_of, in_layers, questions_of, usual
from seqopt.problem.amounts import Amount
from seqopt.problem.problem import Aim, Problem
from seqopt.problem.requirements import LINEAR_RANGE
from seqopt.scene._armed import check_postures
from seqopt.scene.arm import from_arms
from seqopt.sequence._rule_check import check_carried
from seqopt.sequence.steps import Step

EFFORT = ("seconds", "max_memory")  # of any formulation; responses have a memory of their own


def solve(
    problem: Problem | Layers | States | Instance,
    formulation: Formulation | str | None = None,
    *,
    proof: bool = True,
    lazy: bool = False,
    time_limit: float = math.inf,
    progress: Callable[[Any], object] | None = None,
    **options: Any,
) -> Plan:
    """Solve a problem by a formulation and check the answer from the problem's own data.

    Parameters
    ----------
    problem : Problem or Instance
        From `seqopt.pose` or `seqopt.read_instance`; or a graph of choices, as of
        `seqopt.plan.pose.graph_of`.
    formulation : Formulation or str, optional
        Or a name in `seqopt.formulations`; by default the fastest exact one that there is for it.
    proof : bool, optional
        False: no gap is known; ``cascade`` or ``rank_search`` solve only models that they need.
    lazy : bool, optional
        Solve only the models that the proof needs, as is always done where states are chosen.
    time_limit : float, optional
        Seconds of choosing after which it returns its best choice and a bound, as at an interrupt;
        without proof of all it does: an error names the moves that were chosen by then. An
        interrupt of the proof leaves that out: values and bounds are then claimed.
    progress : callable, optional
        Called with every better choice and bound as it is found, or with a few words.
    **options
        Options of the formulation.

    Returns
    -------
    Plan

    Raises
    ------
    InfeasibleError, ProblemError, SolverError
        If no choice is allowed, the arguments do not fit together, or a solver or claim fails.

    Examples
    --------
    >>> import seqopt
    >>> problem = seqopt.optimize("arch25").problem
    >>> seqopt.solve(problem, "overlap_lp").status
    <Status.OPTIMAL: 'optimal'>
    """
    return _solve_run(problem, formulation, Run(time_limit, progress, proof, lazy, options))


def _solve_run(problem: Any, formulation: Formulation | str | None, run: Run) -> Plan:
    """Solve a problem, or choose from a given graph or instance, within the limits of a run.

    Parts without time are skipped and noted by the clock: without the proof, values and bounds are
    claimed only. Raises `TimeUpError` if there is no plan in time.
    """
    if isinstance(problem, Source):
        return _chosen(problem, problem.formulation(formulation), run)
    if not isinstance(problem, Problem):
        kind = type(problem).__name__
        raise ProblemError(f"a {kind} is not a problem; give one that seqopt.pose made")
    found = as_formulation(formulation or usual(problem), *questions_of(problem))
    kind, found = _fitting(problem, found)
    end = time.perf_counter() + run.time_limit

    def best(asked: Problem) -> Plan:
        own = asked is problem  # else the same within the linear range, in the time that is left
        left = run.time_limit if own else max(0.0, end - time.perf_counter())
        how = replace(run, time_limit=left, explains=own)

        def solved(one: Problem) -> Plan:
            with run.clock.needed("posing the problem"):
                graph = graph_of(one, kind)
            return _chosen(graph, found, how)

        plan = solved(asked)
        return from_arms("with_postures")(asked, plan, solved) if asked.scene.has_arms else plan

    return replace(best_within(problem, best, run.clock), problem=problem)


def _fitting(problem: Problem, formulation: Formulation) -> tuple[str, Formulation]:
    """Return the kind of graph that a formulation takes, and the formulation with the asked aim."""
    kind, aim = graph_kind(problem), formulation.aim
    totals = problem.scenarios and problem.over.aim is Aim.SUM
    if kind == CANDIDATES and formulation.of_states and not totals:
        return STATES, formulation
    asked: dict[tuple[Amount, ...], Aim | None] = {(goal,): each for each, goal in AIMS.items()}
    asked[()] = aim  # its own, where none is asked
    of_candidates = in_layers(problem.moves) and problem.goals in asked and not problem.is_timed
    if aim is None or not (kind == CANDIDATES or (kind == STATES and of_candidates)):
        return kind, formulation
    return CANDIDATES, replace(formulation, aim=asked[problem.goals])


def _chosen(graph: Any, formulation: Formulation, run: Run) -> Plan:
    """Let a formulation choose from a graph; the judged answer is a plan.

    Raises `InfeasibleError` if no choice is feasible; `ProblemError` if graph, formulation and
    options are incompatible; `SolverError` if an answer fails its check.
    """
    found = ROUTES[graph.kind](graph, formulation, run)
    return Plan(graph, graph.at(found.selection.order), formulation, *found)


def _from_arcs(instance: Instance, formulation: Formulation, run: Run) -> Found:
    """Choose a path through an instance; it has no steps."""
    require_time(formulation, run.time_limit)
    if run.lazy:
        raise ProblemError("an instance has all its costs; leave out lazy")
    return find_path(instance, formulation, run)


def _from_layers(graph: Layers, formulation: Formulation, run: Run) -> Found:
    """Choose candidates of all moves, for one scene or over scenarios."""
    require_fit(graph.budgets, formulation, run.options)
    require_time(formulation, run.time_limit)
    require_time(formulation, run.clock.left)
    limit = min(run.time_limit, run.options.get("seconds", math.inf))
    own = {name: value for name, value in run.options.items() if name not in EFFORT}
    run = replace(run, options=own, time_limit=limit)
    graph.require_possible()
    if run.lazy:
        require_proof(run.proof)
        return _by_pairs(graph, formulation, run)
    return (_by_all_costs if run.proof else _by_windows)(graph, formulation, run)


def _by_all_costs(graph: Layers, formulation: Formulation, run: Run) -> Found:
    """Choose by the costs of all choices; the answer is certified."""
    seconds: dict[str, float] = {}
    with run.clock.needed("computing the responses of all choices"):
        stages = graph.seconds(formulation.aim or Aim.SUM)  # of costs: solving is timed alone
        with timed(seconds, "compile"):
            found = compile_layers(graph, formulation.aim, alone=formulation.alone)
    path = find_path(found.instance, formulation, run, found.offset)
    choice = found.choice([node for (node,) in path.selection.states])
    seconds |= path.seconds | {"compile": seconds["compile"] + path.seconds["compile"]}
    proof = path.certificate
    with timed(seconds, "verify"):
        if proof is not None:
            for layers in graph.from_cache:
                _require_anew(layers, choice)
            spent = {budget.name: budget.spent(choice) for budget in graph.budgets}
            proof = replace(proof, spent=spent)  # amounts below zero and without a bound as well
        steps = _checked(graph.steps(choice), graph)
    seconds["verify"] += path.seconds["verify"]
    rows = tuple(map(tuple, found.instance.states[[s for (s,) in path.selection.states]].tolist()))
    selection = replace(path.selection, states=rows)
    return Found(selection, proof, steps, {**stages, **seconds})


def _by_windows(graph: Layers, formulation: Formulation, run: Run) -> Found:
    """Choose by a window search that evaluates only the models it visits; without certificate."""
    alone = formulation.window_options
    if alone is None or run.options not in ({}, alone):
        known = formulations("costs")
        able = [name for name in known if known[name].window_options is not None]
        options = "".join(f" {name}={value}" for name, value in run.options.items())
        raise ProblemError(
            f"{formulation.name}{options} looks beyond the window of a move and needs all models: "
            f"use {' or '.join(able)} without options, or ask for the proof"
        )
    if graph.scenes:
        raise ProblemError("the costs of all choices are needed; ask for the proof")
    seconds: dict[str, float] = {}
    with timed(seconds, "search"):
        found = walk_windows(graph, Watch(run.left))
    with timed(seconds, "verify"):
        steps = _checked(graph.steps(found.choice), graph)
        _require_anew(graph, found.choice, found.met)
    chosen = Solution(graph.rows(found.choice), (np.nan,), (-np.inf,))
    return Found(chosen, None, steps, seconds, found)


def _by_pairs(graph: Layers, formulation: Formulation, run: Run) -> Found:
    """Choose by only the models that the optimality proof needs; the answer is certified."""
    if graph.scenes:
        raise ProblemError("the costs of all choices are needed; leave out lazy")
    if run.options:
        raise ProblemError(f"option {min(run.options)}: a lazy search has no options; leave it out")
    from seqopt.graph._lazy_pairs import prove_lazily  # noqa: PLC0415  # few ask for it

    seconds, watch = dict[str, float](), Watch(run.left, run.progress)
    with timed(seconds, "search"):
        found = prove_lazily(graph, formulation, watch)
        solved, nodes = found.bounds.compiled(unknown=False)
        path = find_path(solved, formulation, Run(proof=False)).selection
        passed = nodes[[node for (node,) in path.states]]
        floors, nodes = found.bounds.compiled(unknown=True)
    with timed(seconds, "verify"):
        states = tuple((node,) for node in np.searchsorted(nodes, passed).tolist())
        bound = (min(path.objective[0], watch.bound),)
        claimed = replace(path, states=states, bound=bound, trace=watch.trace)
        claimed = replace(claimed, stopped=found.stopped)
        certificate = judged(floors, formulation, claimed)
        firsts = np.cumsum([1, *map(len, graph.candidates[:-1])])
        along = Windows(graph, (passed - firsts).tolist())
        steps = _checked(graph.steps(along.choice), graph)
        _require_anew(graph, along.choice, along.met)
    chosen = replace(claimed, states=graph.rows(along.choice))
    return Found(chosen, certificate, steps, seconds, along, found.models)


def _checked(steps: tuple[Step, ...], graph: Layers) -> tuple[Step, ...]:
    """Return steps after checking postures, shape and payloads; raise a `SolverError` otherwise."""
    engine, schedule = graph.engine, graph.schedule
    try:
        check_postures(schedule.scene, steps)
        if any(limit.label == LINEAR_RANGE for limit in graph.limits):
            for each in graph.scenarios or (engine,):
                check_shape(each, steps, graph.limits)
        check_carried(engine.network.scene, schedule, steps, graph.scenes)
    except StepError as error:
        raise SolverError(f"a choice is not allowed: {error}") from error
    return steps


def _from_states(graph: States, formulation: Formulation, run: Run) -> Found:
    """Choose the states of a build."""
    from seqopt.plan._states import find_states  # noqa: PLC0415  # with their proofs

    return find_states(graph, formulation, run)


ROUTES: dict[str, Callable[[Any, Formulation, Run], Found]] = {
    CANDIDATES: _from_layers,
    STATES: _from_states,
    ARCS: _from_arcs,
}


def on_the_way(plan: Plan) -> Plan:
    """Return the plan; re-raise `KeyboardInterrupt` if its formulation was interrupted."""
    if plan.ended is End.INTERRUPTED:
        raise KeyboardInterrupt
    return plan
