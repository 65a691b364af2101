"""Choose among candidates of moves: by their costs, or by the models that a search needs alone."""

from __future__ import annotations

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
from seqopt.graph.layers.costs import Budget
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.layers.layers import Layers, _require_carried, steps_over, travel
from seqopt.graph.scenarios import ScenarioLayers, engine_for
from seqopt.graph.solution import Selection
from seqopt.judge._step_checks import check_shape
from seqopt.judge.certificate import Certificate, _require_anew, certify_partial, judge
from seqopt.plan._guard import readable, require_fit, require_proof, require_time, select
from seqopt.plan.plan import Plan
from seqopt.problem.criteria import Among
from seqopt.problem.problem import Aim, AskedBudget
from seqopt.problem.requirements import LINEAR_RANGE
from seqopt.scene._armed import check_postures
from seqopt.sequence._rule_check import check_carried
from seqopt.sequence.steps import Step
from seqopt.work._clock import INTERRUPT

PROOF = "the proof"  # what it is called where there was no time for it
CHOOSES = {Aim.PEAK: "minimax", Aim.SUM: "overlap_dp"}  # of one scenario, without budgets


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
            free = best_choice(problem, Aim.SUM).choice
            budget = replace(budget, bound=each.bound * budget.spent(free))
        budgets.append(budget)
    return replace(problem, budgets=tuple(budgets)) if budgets else problem


def best_choice(problem: PlacementProblem, aim: Aim) -> Selection:
    """Return the best choice without budgets, judged; an interrupt ends more than this.

    Raises `InfeasibleError` if no choice is allowed; `KeyboardInterrupt` if it was interrupted.
    """
    formulation = find_formulation(CHOOSES[aim])
    found = select(formulation, problem)
    if found.end is End.INTERRUPTED:
        raise KeyboardInterrupt
    judge(problem, found, formulation)
    return found


def solve_layers(graph: PlacementProblem, formulation: Formulation, run: Run) -> Plan:
    """Return the plan of a formulation of candidates, of one scene or over scenarios.

    Raises `InfeasibleError` if no choice is allowed; `ProblemError` if graph, formulation and
    options do not fit together; `SolverError` if an answer is not what is claimed.
    """
    if not isinstance(getattr(graph, "budgets", None), tuple):
        raise ProblemError(
            f"a {type(graph).__name__} is not a problem; give one that seqopt.pose made"
        )
    require_fit(graph, formulation, run.options)
    require_time(formulation, run.time_limit)
    require_time(formulation, run.clock.left)
    if isinstance(graph, Layers):
        graph.require_possible()
    elif isinstance(graph, ScenarioLayers) and isinstance(graph.nominal, Layers):
        _require_carried(graph.nominal.schedule, (graph.nominal.schedule.scene, *graph.scenes))
    if run.lazy:
        require_proof(run.proof)
        return _solve_lazily(graph, formulation, run)
    solving = _solve_all if run.proof else _solve_windows
    return solving(graph, formulation, run)


def on_the_way(plan: Plan) -> Plan:
    """Return a plan, for whoever has more to do than to solve; an interrupt ends that too.

    Raises `KeyboardInterrupt` if its formulation was interrupted.
    """
    if plan.ended is End.INTERRUPTED:
        raise KeyboardInterrupt
    return plan


def _solve_all(graph: PlacementProblem, formulation: Formulation, run: Run) -> Plan:
    """Return the certified plan of a formulation that is given the costs of all choices."""
    seconds: dict[str, float] = {}
    with run.clock.needed("computing the responses of all choices"):
        stages = graph.seconds(formulation.aim or Aim.SUM)  # of costs: solving is timed alone
    with timed(seconds, "solve"):
        selection = select(formulation, graph, Watch(run.left, run.progress), **run.options)
    seconds["compile"] = selection.compile_seconds
    seconds["solve"] -= selection.compile_seconds

    def proven() -> Certificate:
        for layers in _from_cache(graph):
            _require_anew(layers, selection.choice)
        return judge(graph, selection, formulation)

    with timed(seconds, "verify"):
        certificate = run.clock.spare(PROOF, proven, None)
        with readable(formulation.name):
            steps = _checked(graph.steps(selection.choice), graph)
    if certificate is None:
        early = run.clock.left_out[PROOF] == INTERRUPT
        selection = replace(selection, end=End.INTERRUPTED if early else End.STOPPED)
    stages = {**stages, **{stage: seconds[stage] for stage in ("compile", "solve", "verify")}}
    return Plan(graph, graph, formulation, selection, certificate, steps, stages)


def _solve_windows(graph: PlacementProblem, formulation: Formulation, run: Run) -> Plan:
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
        raise ProblemError("the costs of all choices are needed or given; ask for the proof")
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
    chosen = Selection(found.choice, np.nan)
    return Plan(graph, graph, formulation, chosen, None, steps, stages, found)


def _solve_lazily(graph: PlacementProblem, formulation: Formulation, run: Run) -> Plan:
    """Return the certified plan of a search that solves only the models that the proof needs."""
    if not isinstance(graph, Layers):
        raise ProblemError("the costs of all choices are needed or given; leave out lazy")
    if run.options:
        raise ProblemError(f"option {min(run.options)}: a lazy search has no options; leave it out")
    from seqopt.plan.search._window_search import search_pairs  # noqa: PLC0415  # few ask for it

    seconds: dict[str, float] = {}
    with timed(seconds, "search"):
        found = search_pairs(graph, formulation, Watch(run.left, run.progress))
    chosen, along = found.selection, found.along
    with timed(seconds, "verify"):
        certificate = certify_partial(found.costs, chosen, found.objective)
        steps = _checked(graph.steps(chosen.choice), graph)
        _require_anew(graph, chosen.choice, along.met)
    return Plan(graph, graph, formulation, chosen, certificate, steps, seconds, along, found.models)


def _checked(steps: tuple[Step, ...], graph: PlacementProblem) -> tuple[Step, ...]:
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


def _check_shape(graph: PlacementProblem, nominal: Layers, steps: Sequence[Step]) -> None:
    """Raise a `SolverError` if steps leave the linear range in any scenario and may not."""
    if any(limit.label == LINEAR_RANGE for limit in nominal.limits):
        scenes = graph.scenes if isinstance(graph, ScenarioLayers) else ()
        own = (engine_for(nominal.engine, scene) for scene in scenes)
        for engine in own if scenes else (nominal.engine,):
            check_shape(engine, steps, nominal.limits)


def _from_cache(graph: PlacementProblem) -> Iterator[Layers]:
    """Return the layers whose responses may come from files."""
    if isinstance(graph, ScenarioLayers):
        return graph.from_cache
    return iter((graph,) if isinstance(graph, Layers) else ())
