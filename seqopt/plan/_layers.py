"""Choose among candidates of moves: by their costs, or by the models that a search needs alone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from seqopt.errors import ProblemError, SolverError, StepError
from seqopt.graph.formulation import (
    End,
    Formulation,
    On,
    Run,
    Watch,
    find_formulation,
    formulations,
    timed,
)
from seqopt.graph.layers.compiled import Compiled, compile_costs, compile_totals
from seqopt.graph.layers.costs import Budget, LayeredCosts
from seqopt.graph.layers.layers import Layers, _require_carried, steps_over, travel
from seqopt.graph.scenarios import ScenarioLayers, engine_for, largest_of
from seqopt.graph.solution import StatePath
from seqopt.judge._step_checks import check_shape
from seqopt.judge.certificate import _require_anew, certify_partial
from seqopt.plan._guard import require_fit, require_proof, require_time
from seqopt.plan._paths import find_path
from seqopt.plan.plan import Plan
from seqopt.problem.criteria import Among
from seqopt.problem.problem import Aim, AskedBudget
from seqopt.problem.requirements import LINEAR_RANGE
from seqopt.scene._armed import check_postures
from seqopt.sequence._rule_check import check_carried
from seqopt.sequence.steps import Step
from seqopt.work._clock import INTERRUPT

CHOOSES = {Aim.PEAK: "minimax", Aim.SUM: "overlap_dp"}  # of one scenario, without budgets
EFFORT = ("seconds", "max_memory")  # of any formulation; responses have a memory of their own
Choices = Layers | ScenarioLayers


def with_budgets(problem: Layers, asked: Sequence[AskedBudget]) -> Layers:
    """Return a problem with budgets; shares are those of its optimum without any.

    ``problem``: posed with the responses that the budgets name.
    """
    budgets: list[Budget] = []
    for each in asked:
        if each.response:
            budget = steps_over(problem, each.response, each.level, each.bound)
        else:
            budget = travel(problem, each.bound)
        if each.share:
            free = best_choice(problem.schedule.scene.name, problem.sums, Aim.SUM)
            budget = replace(budget, bound=each.bound * budget.spent(free))
        budgets.append(budget)
    return replace(problem, budgets=tuple(budgets)) if budgets else problem


def solve_layers(graph: Choices, formulation: Formulation, run: Run) -> Plan:
    """Return the plan of a formulation of candidates, of one scene or over scenarios.

    Raises `InfeasibleError` if no choice is allowed; `ProblemError` if graph, formulation and
    options do not fit together; `SolverError` if an answer is not what is claimed.
    """
    require_fit(graph.budgets, formulation, run.options)
    require_time(formulation, run.time_limit)
    require_time(formulation, run.clock.left)
    limit = min(run.time_limit, run.options.get("seconds", math.inf))
    own = {name: value for name, value in run.options.items() if name not in EFFORT}
    run = replace(run, options=own, time_limit=limit)
    if isinstance(graph, Layers):
        graph.require_possible()
    else:
        _require_carried(graph.nominal.schedule, (graph.nominal.schedule.scene, *graph.scenes))
    if run.lazy:
        require_proof(run.proof)
        return _solve_lazily(graph, formulation, run)
    return (_solve_all if run.proof else _solve_windows)(graph, formulation, run)


def compiled(graph: Choices, aim: Aim | None, name: str = "", *, alone: bool = False) -> Compiled:
    """Return the graph of choices, of one scene or over scenarios, whose sums or peaks count.

    ``alone``: whether with what a search of one move alone is charged; of peaks, with their parts.
    """
    nominal = graph.nominal if isinstance(graph, ScenarioLayers) else graph
    name, nodes = name or nominal.schedule.scene.name, nominal.candidates
    if isinstance(graph, ScenarioLayers) and graph.aim.aim is Aim.SUM:
        layers = graph.layered(Aim.SUM)
        largest_of(layers)  # says if no choice is allowed in all scenarios
        return compile_totals(name, layers, graph.aim, nodes)
    aim = aim or Aim.SUM
    costs = charged = aim.costs(graph)
    if aim is Aim.SUM and alone and isinstance(graph, Layers):
        charged = graph.alone
    found = compile_costs(name, costs, aim, graph.budgets, charged if alone else None, nodes)
    if isinstance(graph, Layers):
        return found
    (goal,) = found.instance.goals
    named = goal._replace(name=f"{goal.name} ({graph.aim})")
    return found._replace(instance=replace(found.instance, goals=(named,)))


def best_choice(name: str, costs: LayeredCosts, aim: Aim) -> tuple[int, ...]:
    """Return the best choice without budgets, judged; an interrupt ends more than this.

    Raises `InfeasibleError` if no choice is allowed; `KeyboardInterrupt` if it was interrupted.
    """
    found = compile_costs(name, costs, aim)
    path = find_path(found.instance, find_formulation(CHOOSES[aim]), Run())
    if path.selection.stopped == INTERRUPT:
        raise KeyboardInterrupt
    return found.choice([node for (node,) in path.selection.states])


def on_the_way(plan: Plan) -> Plan:
    """Return a plan, for whoever has more to do than to solve; an interrupt ends that too.

    Raises `KeyboardInterrupt` if its formulation was interrupted.
    """
    if plan.ended is End.INTERRUPTED:
        raise KeyboardInterrupt
    return plan


def _solve_all(graph: Choices, formulation: Formulation, run: Run) -> Plan:
    """Return the certified plan of a formulation that is given the costs of all choices."""
    seconds: dict[str, float] = {}
    with run.clock.needed("computing the responses of all choices"):
        stages = graph.seconds(formulation.aim or Aim.SUM)  # of costs: solving is timed alone
        with timed(seconds, "compile"):
            found = compiled(graph, formulation.aim, alone=formulation.alone)
    path = find_path(found.instance, formulation, run, found.offset)
    choice = found.choice([node for (node,) in path.selection.states])
    seconds |= path.seconds | {"compile": seconds["compile"] + path.seconds["compile"]}
    proof = path.certificate
    with timed(seconds, "verify"):
        if proof is not None:
            for layers in _from_cache(graph):
                _require_anew(layers, choice)
            spent = {budget.name: budget.spent(choice) for budget in graph.budgets}
            proof = replace(proof, spent=spent)  # amounts below zero and without a bound as well
        steps = _checked(graph.steps(choice), graph)
    seconds["verify"] += path.seconds["verify"]
    rows = tuple(map(tuple, found.instance.states[[s for (s,) in path.selection.states]].tolist()))
    selection = replace(path.selection, states=rows)
    return Plan(graph, graph, formulation, selection, proof, steps, {**stages, **seconds})


def _solve_windows(graph: Choices, formulation: Formulation, run: Run) -> Plan:
    """Return the plan of a search that solves only the models it meets."""
    alone = formulation.window_options
    if alone is None or run.options not in ({}, alone):
        known = formulations(On.LAYERS)
        able = [name for name in known if known[name].window_options is not None]
        options = "".join(f" {name}={value}" for name, value in run.options.items())
        raise ProblemError(
            f"{formulation.name}{options} looks beyond the window of a move and needs all models: "
            f"use {' or '.join(able)} without options, or ask for the proof"
        )
    if not isinstance(graph, Layers):
        raise ProblemError("the costs of all choices are needed; ask for the proof")
    if getattr(graph.criterion, "among", Among.ALL) is not Among.ALL:
        raise ProblemError(
            "ranks among possible candidates need all models: rank among all, or ask for the proof"
        )
    from seqopt.plan.search._window_search import search_windows  # noqa: PLC0415  # few ask for it

    seconds: dict[str, float] = {}
    with timed(seconds, "search"):
        found = search_windows(graph, Watch(run.left), fields=True)
    respond = sum(part.evaluation.seconds for part in (found.alone, *found.shared))
    with timed(seconds, "verify"):
        steps = _checked(graph.steps(found.choice), graph)
        _require_anew(graph, found.choice, found.met)
    stages = {"respond": respond, "rank": seconds["search"] - respond, "verify": seconds["verify"]}
    chosen = StatePath(graph.rows(found.choice), (np.nan,), (-np.inf,))
    return Plan(graph, graph, formulation, chosen, None, steps, stages, found)


def _solve_lazily(graph: Choices, formulation: Formulation, run: Run) -> Plan:
    """Return the certified plan of a search that solves only the models that the proof needs."""
    if not isinstance(graph, Layers):
        raise ProblemError("the costs of all choices are needed; leave out lazy")
    if run.options:
        raise ProblemError(f"option {min(run.options)}: a lazy search has no options; leave it out")
    from seqopt.plan.search._window_search import search_pairs  # noqa: PLC0415  # few ask for it

    seconds: dict[str, float] = {}
    with timed(seconds, "search"):
        found = search_pairs(graph, formulation, Watch(run.left, run.progress))
    chosen, along = found.selection, found.along
    with timed(seconds, "verify"):
        certificate = certify_partial(found.costs, chosen, found.objective)
        steps = _checked(graph.steps(found.choice), graph)
        _require_anew(graph, found.choice, along.met)
    chosen = replace(chosen, states=graph.rows(found.choice))
    return Plan(graph, graph, formulation, chosen, certificate, steps, seconds, along, found.models)


def _checked(steps: tuple[Step, ...], graph: Choices) -> tuple[Step, ...]:
    """Return steps in which arms can be, and robots bear bricks; else a `SolverError` says why."""
    nominal = graph.nominal if isinstance(graph, ScenarioLayers) else graph
    worlds = graph.scenes if isinstance(graph, ScenarioLayers) else ()
    try:
        if isinstance(nominal, Layers):
            check_postures(nominal.schedule.scene, steps)
            _check_shape(graph, nominal, steps)
            check_carried(nominal.engine.network.scene, nominal.schedule, steps, worlds)
    except StepError as error:
        raise SolverError(f"a choice is not allowed: {error}") from error
    return steps


def _check_shape(graph: Choices, nominal: Layers, steps: Sequence[Step]) -> None:
    """Raise a `SolverError` if steps leave the linear range in any scenario and may not."""
    if any(limit.label == LINEAR_RANGE for limit in nominal.limits):
        scenes = graph.scenes if isinstance(graph, ScenarioLayers) else ()
        own = (engine_for(nominal.engine, scene) for scene in scenes)
        for engine in own if scenes else (nominal.engine,):
            check_shape(engine, steps, nominal.limits)


def _from_cache(graph: Choices) -> Iterator[Layers]:
    """Return the layers whose responses may come from files."""
    if isinstance(graph, ScenarioLayers):
        return graph.from_cache
    return iter((graph,) if isinstance(graph, Layers) else ())
