"""Solve layered problems of candidates: from all costs, or only from the models a search needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from seqopt.errors import ProblemError, SolverError, StepError
from seqopt.graph.formulation import End, Formulation, Run, Watch, formulations, timed
from seqopt.graph.layers.compiled import best_in_order, compile_layers
from seqopt.graph.layers.costs import Budget
from seqopt.graph.layers.layers import Layers, steps_over, travel
from seqopt.graph.solution import Solution
from seqopt.judge._step_checks import check_shape
from seqopt.judge.certificate import _require_anew
from seqopt.plan._guard import require_fit, require_proof, require_time
from seqopt.plan._paths import find_path, judged
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Aim, AskedBudget
from seqopt.problem.requirements import LINEAR_RANGE
from seqopt.scene._armed import check_postures
from seqopt.sequence._rule_check import check_carried
from seqopt.sequence.steps import Step

EFFORT = ("seconds", "max_memory")  # of any formulation; responses have a memory of their own


def with_budgets(problem: Layers, asked: Sequence[AskedBudget]) -> Layers:
    """Return a problem with budgets; a share refers to the optimum without budgets.

    ``problem``: must evaluate the responses of the budgets.
    """
    budgets: list[Budget] = []
    for each in asked:
        if each.response:
            budget = steps_over(problem, each.response, each.level, each.bound)
        else:
            budget = travel(problem, each.bound)
        if each.share:
            free = best_in_order([(problem.sums, Aim.SUM)])
            budget = replace(budget, bound=each.bound * budget.spent(free))
        budgets.append(budget)
    return replace(problem, budgets=tuple(budgets)) if budgets else problem


def solve_layers(graph: Layers, formulation: Formulation, run: Run) -> Plan:
    """Solve layers by a formulation of candidates, for one scene or over scenarios.

    Raises `InfeasibleError` if no choice is feasible; `ProblemError` if graph, formulation and
    options are incompatible; `SolverError` if an answer fails its check.
    """
    require_fit(graph.budgets, formulation, run.options)
    require_time(formulation, run.time_limit)
    require_time(formulation, run.clock.left)
    limit = min(run.time_limit, run.options.get("seconds", math.inf))
    own = {name: value for name, value in run.options.items() if name not in EFFORT}
    run = replace(run, options=own, time_limit=limit)
    graph.require_possible()
    if run.lazy:
        require_proof(run.proof)
        return _solve_lazily(graph, formulation, run)
    return (_solve_all if run.proof else _solve_windows)(graph, formulation, run)


def on_the_way(plan: Plan) -> Plan:
    """Return the plan; re-raise `KeyboardInterrupt` if its formulation was interrupted."""
    if plan.ended is End.INTERRUPTED:
        raise KeyboardInterrupt
    return plan


def _solve_all(graph: Layers, formulation: Formulation, run: Run) -> Plan:
    """Solve with the costs of all choices; return the certified plan."""
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
    return Plan(graph, graph, formulation, selection, proof, steps, {**stages, **seconds})


def _solve_windows(graph: Layers, formulation: Formulation, run: Run) -> Plan:
    """Solve by a window search that evaluates only the models it visits; without certificate."""
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
    from seqopt.plan.search._window_search import search_windows  # noqa: PLC0415  # few ask for it

    seconds: dict[str, float] = {}
    with timed(seconds, "search"):
        found = search_windows(graph, Watch(run.left), fields=True)
    respond = sum(part.evaluation.seconds for part in (found.alone, *found.shared))
    with timed(seconds, "verify"):
        steps = _checked(graph.steps(found.choice), graph)
        _require_anew(graph, found.choice, found.met)
    stages = {"respond": respond, "rank": seconds["search"] - respond, "verify": seconds["verify"]}
    chosen = Solution(graph.rows(found.choice), (np.nan,), (-np.inf,))
    return Plan(graph, graph, formulation, chosen, None, steps, stages, found)


def _solve_lazily(graph: Layers, formulation: Formulation, run: Run) -> Plan:
    """Solve with only the models that the optimality proof needs; return the certified plan."""
    if graph.scenes:
        raise ProblemError("the costs of all choices are needed; leave out lazy")
    if run.options:
        raise ProblemError(f"option {min(run.options)}: a lazy search has no options; leave it out")
    from seqopt.plan.search._pair_search import search_pairs  # noqa: PLC0415  # few ask for it

    seconds: dict[str, float] = {}
    with timed(seconds, "search"):
        found = search_pairs(graph, formulation, Watch(run.left, run.progress))
    along, choice = found.along, found.along.choice
    with timed(seconds, "verify"):
        certificate = judged(found.instance, formulation, found.selection)
        steps = _checked(graph.steps(choice), graph)
        _require_anew(graph, choice, along.met)
    chosen = replace(found.selection, states=graph.rows(choice))
    return Plan(graph, graph, formulation, chosen, certificate, steps, seconds, along, found.models)


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
