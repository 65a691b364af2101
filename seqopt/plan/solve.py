"""From a problem to its plan: a graph of states, a formulation, a judge.

A problem becomes the graph of the states of its builds; an instance has its arcs. A formulation
chooses a path through it. The judge computes its values and a bound again, from the problem's own
data. What was found and proven is the plan.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

from seqopt.errors import InfeasibleError, ProblemError, SeqoptError, message_of
from seqopt.graph.formulation import End, Formulation, Run, as_formulation
from seqopt.graph.instance import Instance
from seqopt.graph.states import States
from seqopt.plan._answers import find_path, require_time
from seqopt.plan.plan import Plan
from seqopt.plan.pose import default_formulation, graph_of
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import LIMIT_TOLERANCE, LINEAR_RANGE, Limit
from seqopt.responses._grip_sets import Moved, most_moved
from seqopt.scene.arm import from_arms
from seqopt.work.progress import INTERRUPT

NONE_KEEPS = "no plan keeps it"
UNKNOWN = "whether any plan keeps it is not known"
INTERRUPTED = f"{UNKNOWN} (interrupted)"
Measured = TypeVar("Measured", bound=Any)  # a plan, or a Pareto set


def solve(
    problem: Problem | States | Instance,
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
    if isinstance(problem, States | Instance):
        return _chosen(problem, problem.formulation(formulation), run)
    if not isinstance(problem, Problem):
        kind = type(problem).__name__
        raise ProblemError(f"a {kind} is not a problem; give one that seqopt.pose made")
    given, problem = problem, without_shares(problem, run)
    found = as_formulation(
        formulation or default_formulation(problem), *graph_of(problem).questions
    )
    end = time.perf_counter() + run.time_limit

    def best(asked: Problem) -> Plan:
        own = asked is problem  # else the same within the linear range, in the time that is left
        left = run.time_limit if own else max(0.0, end - time.perf_counter())
        how = replace(run, time_limit=left, explains=own)

        def solved(one: Problem) -> Plan:
            with run.clock.needed("posing the problem"):
                graph = graph_of(one, found.aim)
            return _chosen(graph, found, how)

        plan = solved(asked)
        if asked.scene.has_arms:
            plan = from_arms("with_postures")(asked, plan, solved)

        each = (most_moved(own, plan.steps) for own in plan.graph.scenarios or (plan.engine,))
        return replace(plan, moved=max(each, key=lambda moved: moved.share))

    def interrupted(plan: Plan) -> Plan:
        return replace(plan, selection=replace(plan.selection, stopped=INTERRUPT))

    return replace(best_within(problem, best, lambda p: p.moved, interrupted), problem=given)


def without_shares(problem: Problem, run: Run | None = None) -> Problem:
    """Return a problem whose budgets are amounts: shares of what the best plan without them takes.

    ``run``: of the clock that runs.
    """
    shares = [cap for cap in problem.budgets if cap.share]
    if not shares:
        return problem
    from seqopt.judge._schedules import plan_values  # noqa: PLC0415  # with its proofs

    free = replace(problem, budgets=())
    plan = _solve_run(free, None, Run(proof=False, clock=(run or Run()).clock))
    asked = replace(graph_of(free), goals=tuple(cap.amount for cap in shares))
    taken = dict(zip(shares, plan_values(asked, plan.steps), strict=True))
    caps = (
        replace(c, bound=c.bound * taken[c], share=False) if c.share else c for c in problem.budgets
    )
    return replace(problem, budgets=tuple(caps))


def _chosen(graph: States | Instance, formulation: Formulation, run: Run) -> Plan:
    """Let a formulation choose from a graph; the judged answer is a plan.

    Raises `InfeasibleError` if no choice is feasible; `ProblemError` if graph, formulation and
    options are incompatible; `SolverError` if an answer fails its check.
    """
    require_time(formulation, run.time_limit)
    if isinstance(graph, Instance):
        found = find_path(graph, formulation, run)
    else:
        from seqopt.plan._states import find_states  # noqa: PLC0415  # with their proofs

        found = find_states(graph, formulation, run)
    return Plan(graph, graph.at(found.selection.order), formulation, *found)


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
