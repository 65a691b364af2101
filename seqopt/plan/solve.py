"""From a problem to its plan: a graph of choices, a formulation, a judge.

A problem becomes a graph: of decisions, or of states of a build; an instance has its arcs. A
formulation chooses a path through it. The judge computes its values and a bound again, from the
problem's own data. What was found and proven is the plan.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from seqopt.errors import (
    InfeasibleError,
    ProblemError,
    SeqoptError,
    SolverError,
    StepError,
    message_of,
)
from seqopt.graph.decisions import Decisions, walk_windows
from seqopt.graph.formulation import End, Formulation, Run, Solution, Watch, formulations, timed
from seqopt.graph.instance import Instance
from seqopt.graph.states.states import States, of_decisions
from seqopt.judge._step_checks import check_shape
from seqopt.plan._answers import Found, find_path, require_fit, require_time
from seqopt.plan.plan import Plan
from seqopt.plan.pose import AIMS, chooses_moves, graph_of
from seqopt.problem.amounts import Amount
from seqopt.problem.problem import Aim, Problem
from seqopt.problem.requirements import LIMIT_TOLERANCE, LINEAR_RANGE, Limit
from seqopt.responses._grip_sets import Moved, most_moved
from seqopt.scene._armed import check_postures
from seqopt.scene.arm import from_arms
from seqopt.sequence._rule_check import check_carried
from seqopt.sequence.steps import Step
from seqopt.work.progress import INTERRUPT

NONE_KEEPS = "no plan keeps it"
UNKNOWN = "whether any plan keeps it is not known"
INTERRUPTED = f"{UNKNOWN} (interrupted)"
Measured = TypeVar("Measured", bound=Any)  # a plan, or a Pareto set
EFFORT = ("seconds", "max_memory")  # of any formulation; responses have a memory of their own


def solve(
    problem: Problem | States | Decisions | Instance,
    formulation: Formulation | str | None = None,
    *,
    proof: bool = True,
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
    return _solve_run(problem, formulation, Run(time_limit, progress, proof, options))


def _solve_run(problem: Any, formulation: Formulation | str | None, run: Run) -> Plan:
    """Solve a problem, or choose from a given graph or instance, within the limits of a run.

    A proof without time is left out: values and bounds are claimed only. Raises `TimeUpError` if
    there is no plan in time.
    """
    if isinstance(problem, Decisions):
        problem = of_decisions(problem)
    if isinstance(problem, States | Instance):
        return _chosen(problem, problem.formulation(formulation), run)
    if not isinstance(problem, Problem):
        kind = type(problem).__name__
        raise ProblemError(f"a {kind} is not a problem; give one that seqopt.pose made")
    moves, found = _fitting(problem, graph_of(problem).formulation(formulation))
    end = time.perf_counter() + run.time_limit

    def best(asked: Problem) -> Plan:
        own = asked is problem  # else the same within the linear range, in the time that is left
        left = run.time_limit if own else max(0.0, end - time.perf_counter())
        how = replace(run, time_limit=left, explains=own)

        def solved(one: Problem) -> Plan:
            with run.clock.needed("posing the problem"):
                graph = graph_of(one, moves=moves)
            return _chosen(graph, found, how)

        plan = solved(asked)
        if asked.scene.has_arms:
            plan = from_arms("with_postures")(asked, plan, solved)

        each = (most_moved(own, plan.steps) for own in plan.graph.scenarios or (plan.engine,))
        return replace(plan, moved=max(each, key=lambda moved: moved.share))

    def interrupted(plan: Plan) -> Plan:
        return replace(plan, selection=replace(plan.selection, stopped=INTERRUPT))

    return replace(best_within(problem, best, lambda p: p.moved, interrupted), problem=problem)


def _fitting(problem: Problem, formulation: Formulation) -> tuple[bool, Formulation]:
    """Return whether a formulation chooses candidates of moves, and it with the asked aim."""
    moves, aim = chooses_moves(problem), formulation.aim
    totals = problem.scenarios and problem.over.aim is Aim.SUM
    if moves and formulation.of_states and not totals:
        return False, formulation
    asked: dict[tuple[Amount, ...], Aim | None] = {(goal,): each for each, goal in AIMS.items()}
    asked[()] = aim  # its own, where none is asked
    could = problem.moves.has_pairs and problem.goals in asked
    could &= not (problem.is_timed or problem.orders)
    if aim is None or not (moves or could):
        return moves, formulation
    return True, replace(formulation, aim=asked[problem.goals])


def _chosen(graph: States | Instance, formulation: Formulation, run: Run) -> Plan:
    """Let a formulation choose from a graph; the judged answer is a plan.

    Raises `InfeasibleError` if no choice is feasible; `ProblemError` if graph, formulation and
    options are incompatible; `SolverError` if an answer fails its check.
    """
    if isinstance(graph, Instance):
        require_time(formulation, run.time_limit)
        found = find_path(graph, formulation, run)
    elif graph.decisions is not None:
        found = _from_decisions(graph, graph.decisions, formulation, run)
    else:
        from seqopt.plan._states import find_states  # noqa: PLC0415  # with their proofs

        found = find_states(graph, formulation, run)
    return Plan(graph, graph.at(found.selection.order), formulation, *found)


def _from_decisions(
    graph: States, decisions: Decisions, formulation: Formulation, run: Run
) -> Found:
    """Choose candidates of all moves, for one scene or over scenarios."""
    require_fit(decisions.budgets, formulation, run.options)
    require_time(formulation, run.time_limit)
    require_time(formulation, run.clock.left)
    limit = min(run.time_limit, run.options.get("seconds", math.inf))
    own = {name: value for name, value in run.options.items() if name not in EFFORT}
    run = replace(run, options=own, time_limit=limit)
    decisions.require_possible(graph.worlds)
    if graph.scenarios and not run.proof:
        raise ProblemError("the costs of all choices are needed; ask for the proof")
    if not run.proof:
        return _by_windows(graph, decisions, formulation, run)
    return _by_all_costs(graph, decisions, formulation, run)


def _by_all_costs(graph: States, decisions: Decisions, formulation: Formulation, run: Run) -> Found:
    """Choose by the costs of all choices; the answer is certified."""
    aim, seconds = formulation.aim or Aim.SUM, dict[str, float]()
    with run.clock.needed("computing the responses of all choices"):
        with timed(seconds, "respond"):
            stages = {} if graph.costs_in_scenarios else decisions.seconds(aim)
        seconds |= stages  # of one scene costs are a stage of their own
        with timed(seconds, "compile"):
            worlds: Any = {"each": graph.costs_in_scenarios, "over": graph.over}
            found = decisions.compiled(formulation.aim, alone=formulation.alone, **worlds)
    path = find_path(found.instance, formulation, run, found.offset)
    choice = found.choice([node for (node,) in path.selection.states])
    seconds |= path.seconds | {"compile": seconds["compile"] + path.seconds["compile"]}
    proof = path.certificate
    with timed(seconds, "verify"):
        if proof is not None:
            spent = {budget.name: budget.spent(choice) for budget in decisions.caps}
            proof = replace(proof, spent=spent)  # amounts below zero and without a bound as well
        steps = _checked(decisions.steps(choice), graph, decisions)
    seconds["verify"] += path.seconds["verify"]
    selection = replace(path.selection, states=decisions.rows(choice))
    return Found(selection, proof, steps, seconds)


def _by_windows(graph: States, decisions: Decisions, formulation: Formulation, run: Run) -> Found:
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
    seconds: dict[str, float] = {}
    with timed(seconds, "search"):
        found = walk_windows(decisions, Watch(run.left))
    with timed(seconds, "verify"):
        steps = _checked(decisions.steps(found.choice), graph, decisions)
    chosen = Solution(decisions.rows(found.choice), (np.nan,), (-np.inf,))
    return Found(chosen, None, steps, seconds, found)


def _checked(steps: tuple[Step, ...], graph: States, decisions: Decisions) -> tuple[Step, ...]:
    """Return steps after checking postures, shape and payloads; raise a `SolverError` otherwise."""
    schedule, limits = decisions.schedule, decisions.limits
    try:
        check_postures(schedule.scene, steps)
        for each in graph.scenarios or (graph.engine,):
            check_shape(each, steps, limits)
        check_carried(graph.network.scene, steps, graph.worlds)
    except StepError as error:
        raise SolverError(f"a choice is not allowed: {error}") from error
    return steps


def on_the_way(plan: Plan) -> Plan:
    """Return the plan; re-raise `KeyboardInterrupt` if its formulation was interrupted."""
    if plan.ended is End.INTERRUPTED:
        raise KeyboardInterrupt
    return plan


def leaves(moved: Moved) -> bool:
    """Return whether displacements exceed the linear range."""
    return moved.share > 1 + LIMIT_TOLERANCE


def best_within(
    problem: Problem,
    measured: Callable[[Problem], Measured],
    farthest: Callable[[Measured], Moved | None],
    interrupted: Callable[[Measured], Measured],
) -> Measured:
    """Return the best result within the linear range, or the best of all if none is feasible.

    ``measured``: solves the problem, with or without the constraint; ``farthest``: displacements of
    a result, if known; ``interrupted``: marks one as stopped by an interrupt. If the second solve
    is interrupted, the first result is returned.
    """
    found = measured(problem)
    moved = farthest(found)
    if problem.says_range or moved is None or not leaves(moved):
        return found
    if found.stopped == INTERRUPT:
        return replace(found, beyond=INTERRUPTED)
    try:
        limit = Limit(LINEAR_RANGE, 1.0)
        return measured(replace(problem, limits=(*problem.limits, limit)))
    except InfeasibleError:
        return replace(found, beyond=NONE_KEEPS)
    except SeqoptError as error:
        return replace(found, beyond=f"{UNKNOWN} ({message_of(error)})")
    except KeyboardInterrupt:
        return replace(interrupted(found), beyond=INTERRUPTED)
