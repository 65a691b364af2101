"""From a question to its plan: a problem, its graph of states, a formulation, a judge.

A problem is what is asked of a build (`pose`). It becomes the graph of the states of its builds; an
instance has its arcs. A formulation chooses a path through it (`solve`). The judge computes its
values and a bound again, from the problem's own data. What was found and proven is the plan.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from seqopt._registry import Later, required
from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import simplest
from seqopt.errors import InfeasibleError, ProblemError, SeqoptError, message_of
from seqopt.graph.formulation import End, Formulation, Run, as_formulation
from seqopt.graph.states import States, build_states, over_scenarios, within
from seqopt.plan.plan import Given, Plan
from seqopt.problem.amounts import MINMAX, SUM, Amount
from seqopt.problem.criteria import Criterion
from seqopt.problem.problem import WORST_PEAK, Aim, Budget, Orders, Problem, RobustAim, check_parts
from seqopt.problem.requirements import LIMIT_TOLERANCE, LINEAR_RANGE, Filter, Limit, Resource
from seqopt.responses._grip_sets import HERE, Moved, Resources, most_moved
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE, FreeRules, _require_buildable
from seqopt.sequence.schedule import Schedule
from seqopt.stability.standing import Standing
from seqopt.work import INTERRUPT

if TYPE_CHECKING:
    from seqopt.scene.scenarios import Scenarios

ANSWERS, PROOFS = Later("seqopt.plan._answers"), Later("seqopt.judge._schedules")  # 20 ms
ORDERS = Later("seqopt.graph._spaces")  # few problems seek an order
NONE_KEEPS = "no plan keeps it"
UNKNOWN = "whether any plan keeps it is not known"
INTERRUPTED = f"{UNKNOWN} (interrupted)"
Measured = TypeVar("Measured", bound=Any)  # a plan, or a Pareto set


def pose(  # noqa: PLR0913  # every question is a word of its own
    engine: Engine,
    moves: Schedule | FreeRules,
    criterion: Criterion,
    goals: Sequence[Amount | str] | str = (),
    limits: Sequence[Limit | Filter | Resource | str] | str = (),
    *,
    budgets: Sequence[Budget | str] | str = (),
    stands: Standing | Mortar | str | None = None,
    scenarios: Scenarios | Sequence[Scene] = (),
    over: RobustAim | str = WORST_PEAK,
    orders: Orders | str | None = None,
    resources: Resources = HERE,
) -> Problem:
    """Create a `Problem` of a build; strings are parsed.

    Parameters
    ----------
    engine, moves, criterion : Engine, Schedule or FreeRules, Criterion
        What has the scene, what can be chosen, what a step costs; of ``auto`` its simplest level.
    goals : sequence of Amount or str, optional
        As ``"minmax,steps"``, over states; by default the sum of the costs of open grips or the
        largest, as the formulation minimizes, and of rules the worst step.
    limits, budgets, stands, scenarios, over, orders, resources : optional
        As of `Problem`: ``"F_largest=300"``, ``"travel=3.5m"``, ``"dry"``, `seqopt.scenarios`,
        ``"cvar=0.9"`` (or ``worst-peak``, ``worst-total``), ``"tied"`` or ``"any"``.

    Returns
    -------
    Problem
        Nothing is computed yet, except scales that a criterion takes from the scene.

    Raises
    ------
    ProblemError
        If there is no such response, no grip is open, or parts of the question are incompatible.

    Examples
    --------
    >>> import seqopt
    >>> engine = seqopt.make_engine("auto", seqopt.load_scene("arch25"))
    >>> worst = seqopt.CRITERIA["worst-ratio"]
    >>> seqopt.pose(engine, seqopt.FreeRules(), worst, "minmax,steps", budgets="regrips=3")
    Problem('arch25', 'free', criterion 'worst-ratio', minmax, steps, 1 budget)
    """
    engine = simplest(engine)
    problem = Problem(engine, moves, criterion).but(
        goals=goals,
        limits=limits,
        budgets=budgets,
        stands=stands,
        scenarios=scenarios,
        over=over,
        orders=orders,
        resources=resources,
    )
    posed = replace(problem, criterion=graph_of(problem).criterion)  # with the scene's numbers
    posed.graphs.update(problem.graphs)
    return posed


def chooses_moves(problem: Problem) -> bool:
    """Return whether candidates of moves are chosen by default, as the formulation minimizes."""
    beside = problem.filters or problem.paths or problem.stands is not None or problem.orders
    return problem.moves.has_pairs and not (problem.is_timed or problem.goals or beside)


def graph_of(problem: Problem, aim: Aim | None = None) -> States:
    """Return the states and moves of a problem, cached with what was computed for them.

    ``aim``: what the formulation minimizes where the problem names no goal; by default of open
    grips the sum of costs, of free rules the worst step; over scenarios as these are joined. Raises
    `ProblemError` if the problem has no such graph.
    """
    if chooses_moves(problem) and not problem.moves.moves:
        raise ProblemError(
            f"schedule {problem.method}: with {len(problem.scene.bricks)} bricks it leaves no grip "
            "open; there is nothing to choose, analyze its steps"
        )
    aim = aim or (Aim.SUM if chooses_moves(problem) else Aim.PEAK)
    aim = problem.over.aim if problem.scenarios else aim
    goals = problem.goals or ({Aim.SUM: SUM, Aim.PEAK: MINMAX}[aim],)
    if goals not in problem.graphs:
        found = _build_graph(replace(problem, goals=goals))
        known = next(iter(problem.graphs.values()), found)
        problem.graphs[goals] = replace(found, answers=known.answers, judged=known.judged)
    out: States = problem.graphs[goals]
    return out


def _build_graph(problem: Problem) -> States:
    """Return the graph of a problem, with goals, constraints, scenarios and orders."""
    over = problem.over if problem.scenarios else WORST_PEAK
    if problem.orders is not None and problem.is_timed:
        raise ProblemError("makespan: it is found in one order; give an order, or leave it out")
    if problem.orders is not None and problem.paths:
        raise ProblemError(f"resource {problem.paths[0]}: it is kept in one order; give an order")
    if problem.method == FREE:
        _require_buildable(problem.engine.network, problem.moves.free())
    asked = problem.engine, problem.moves, problem.criterion, problem.goals, problem.limits
    found = build_states(*asked, problem.stands)
    check_parts(problem.filters, problem.scene, problem.moves)
    found = replace(found, resources=problem.resources, filters=problem.filters)
    found = replace(found, paths=problem.paths)
    space = found.space
    if space.first == space.levels and space.ended(space.start()).all():
        raise ProblemError("nothing is left to plan: the build begins as it may end")
    if problem.is_timed and found.free_rules.takes_down:
        raise ProblemError(
            "aim makespan: how long it takes to take bricks away is not modeled; leave "
            "direction=take-down out"
        )
    if problem.paths and problem.scenarios and over.aim is Aim.SUM:
        raise ProblemError(f"resource {problem.paths[0]}: totals over scenarios take none")
    caps: dict[Amount | str, float] = {c.amount: c.bound for c in problem.budgets if not c.share}
    found = within(found, caps) if caps else found
    if found.standing is not None and found.standing.curing is not None and not found.is_timed:
        raise ProblemError(
            "curing: it says how long steps wait; add makespan to the aims, as makespan,steps"
        )
    found = over_scenarios(found, problem.scenarios, over) if problem.scenarios else found
    sought: States = found if problem.orders is None else ORDERS.among_orders(found, problem.orders)
    return sought


def default_formulation(problem: Problem) -> str:
    """Return the name of the formulation that solves a problem if none is named."""
    graph = graph_of(problem)
    if not chooses_moves(problem):
        return graph.default_formulation
    if problem.scenarios and graph.totals:
        return "overlap_dp"
    if problem.scenarios:
        return "schedule_search" if problem.budgets else "minimax"
    return "labels" if problem.budgets else "overlap_dp"


def solve(
    problem: Problem | States | Given,
    formulation: Formulation | str | None = None,
    *,
    proof: bool = True,
    time_limit: float = math.inf,
    progress: Callable[[Any], object] | None = None,
    options: Mapping[str, Any] | Sequence[str] = (),
) -> Plan:
    """Solve a problem by a formulation and check the answer from the problem's own data.

    Parameters
    ----------
    problem : Problem or Instance
        From `seqopt.pose` or `seqopt.read_instance`; or a graph of choices, as of `graph_of`.
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
    options : mapping or sequence of str, optional
        Options of the formulation, as ``{"width": 10}`` or ``["width=10"]``.

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
    if isinstance(problem, Given):
        return problem.solved(formulation, run)
    if isinstance(problem, States):
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
            if not own:
                graph = replace(graph, answers=graph_of(problem, found.aim).answers)
            return _chosen(graph, found, how)

        plan = solved(asked)
        if asked.scene.has_arms:
            plan = required("with_postures")(asked, plan, solved)
        moved = None if plan.certificate is None else plan.certificate.moved
        worlds = plan.states.each or (plan.states,)
        each = (most_moved(one.engine, plan.steps, one.screened) for one in worlds)
        return replace(plan, moved=moved or max(each, key=lambda moved: moved.share))

    def interrupted(plan: Plan) -> Plan:
        return replace(plan, selection=replace(plan.selection, stopped=INTERRUPT))

    return replace(best_within(problem, best, lambda p: p.moved, interrupted), problem=given)


def _chosen(graph: States, formulation: Formulation, run: Run) -> Plan:
    """Let a formulation choose from a graph; the judged answer is a plan."""
    found = ANSWERS.find(graph, formulation, run)
    return Plan(graph, graph.at(found.selection.order), formulation, *found)


def without_shares(problem: Problem, run: Run | None = None) -> Problem:
    """Return a problem whose budgets are amounts: shares of what the best plan without them takes.

    ``run``: of the clock that runs.
    """
    shares = [cap for cap in problem.budgets if cap.share]
    if not shares:
        return problem
    free = replace(problem, budgets=())
    plan = _solve_run(free, None, Run(proof=False, clock=(run or Run()).clock))
    asked = replace(graph_of(free), goals=tuple(cap.amount for cap in shares))
    taken = dict(zip(shares, PROOFS.plan_values(asked, plan.steps), strict=True))
    caps = (
        replace(c, bound=c.bound * taken[c], share=False) if c.share else c for c in problem.budgets
    )
    return replace(problem, budgets=tuple(caps))


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
