"""Pose a problem: what is asked of a build, and the graph of states that it becomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import simplest
from seqopt.errors import ProblemError
from seqopt.graph.states import States, build_states, over_scenarios, within
from seqopt.problem.amounts import MINMAX, SUM, Amount
from seqopt.problem.criteria import Criterion
from seqopt.problem.problem import WORST_PEAK, Aim, Orders, Problem, RobustAim, check_parts
from seqopt.problem.requirements import Filter, Limit, require_parts
from seqopt.responses._grip_sets import HERE, Resources
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.stability.standing import Standing

if TYPE_CHECKING:
    from seqopt.scene.scenarios import Scenarios

AIMS = {Aim.SUM: SUM, Aim.PEAK: MINMAX}


def pose(  # noqa: PLR0913  # every question is a word of its own
    engine: Engine,
    moves: Schedule | FreeRules,
    criterion: Criterion,
    goals: Sequence[Amount] | str = (),
    limits: Sequence[Limit | Filter | str] | str = (),
    *,
    budgets: Sequence[str] | str = (),
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
    asked = {"goals": goals, "limits": limits, "budgets": budgets, "stands": stands}
    worlds = {"scenarios": scenarios, "over": over, "orders": orders}
    engine = simplest(engine)
    require_parts(engine, moves, criterion)
    problem = Problem.asked(engine, moves, criterion, **asked, **worlds, resources=resources)
    posed = replace(problem, criterion=graph_of(problem).criterion)  # with the scene's numbers
    posed.graphs.update(problem.graphs)
    return posed


def chooses_moves(problem: Problem) -> bool:
    """Return whether candidates of moves are chosen by default, as the formulation minimizes."""
    beside = problem.filters or problem.paths or problem.stands is not None or problem.orders
    return problem.moves.has_pairs and not (problem.is_timed or problem.goals or beside)


def goals_of(problem: Problem, aim: Aim | None = None) -> tuple[Amount, ...]:
    """Return the goals of a problem; where it names none, what a formulation minimizes.

    Over scenarios that is as these are joined. ``aim``: of the formulation; by default of open
    grips the sum of costs, of free rules the worst step.
    """
    if problem.goals:
        return problem.goals
    usual = Aim.SUM if chooses_moves(problem) else Aim.PEAK
    return (AIMS[problem.over.aim if problem.scenarios else aim or usual],)


def graph_of(problem: Problem, aim: Aim | None = None) -> States:
    """Return the states and moves of a problem, cached with what was computed for them.

    ``aim``: as of `goals_of`. Raises `ProblemError` if the problem has no such graph.
    """
    goals = goals_of(problem, aim)
    if chooses_moves(problem) and not problem.moves.moves:
        raise ProblemError(
            f"schedule {problem.method}: with {len(problem.scene.bricks)} bricks it leaves no grip "
            "open; there is nothing to choose, analyze its steps"
        )
    if goals not in problem.graphs:
        found = _of_states(replace(problem, goals=goals))
        known = next(iter(problem.graphs.values()), found)
        problem.graphs[goals] = replace(found, answers=known.answers, judged=known.judged)
    out: States = problem.graphs[goals]
    return out


def default_formulation(problem: Problem) -> str:
    """Return the name of the formulation that solves a problem if none is named."""
    graph = graph_of(problem)
    if not chooses_moves(problem):
        return graph.default_formulation
    if problem.scenarios and graph.totals:
        return "scenario_search"
    if problem.scenarios:
        return "schedule_search" if problem.budgets else "minimax"
    return "labels" if problem.budgets else "overlap_dp"


def _of_states(problem: Problem) -> States:
    """Return the graph of states, of all orders where one is sought."""
    if problem.orders is None:
        return _states(problem)
    if problem.is_timed:
        raise ProblemError("makespan: it is found in one order; give an order, or leave it out")
    if problem.paths:
        raise ProblemError(f"resource {problem.paths[0]}: it is kept in one order; give an order")
    from seqopt.graph._spaces import among_orders  # noqa: PLC0415  # few problems seek an order

    return among_orders(_states(problem), problem.orders)


def _states(problem: Problem) -> States:
    """Return the graph of states of a problem, with goals, constraints and scenarios."""
    over = problem.over if problem.scenarios else WORST_PEAK
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
    return over_scenarios(found, problem.scenarios, over) if problem.scenarios else found
