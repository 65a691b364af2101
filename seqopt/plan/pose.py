"""Pose a problem: what is asked of a build, and the graph of choices that it becomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import simplest
from seqopt.errors import ProblemError
from seqopt.graph.decisions import pose_decisions
from seqopt.graph.states.states import States, build_states, of_decisions, over_scenarios, within
from seqopt.problem.amounts import MINMAX, SUM, Amount
from seqopt.problem.filters import Filter
from seqopt.problem.problem import (
    WORST_PEAK,
    Aim,
    Orders,
    Problem,
    RobustAim,
    check_parts,
    parse_budgets,
)
from seqopt.problem.requirements import Criterion, Limit
from seqopt.problem.standing import Standing
from seqopt.responses.resources import HERE, Resources
from seqopt.scene.scenarios import Scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import Schedule

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
    also: Sequence[str] = (),
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
    limits, budgets, stands, scenarios, over, orders, also, resources : optional
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
    Problem('arch25', 'free', criterion 'worst-ratio', minmax, steps, 1 budgets)
    """
    asked = {"goals": goals, "limits": limits, "budgets": budgets, "stands": stands}
    worlds = {"scenarios": scenarios, "over": over, "orders": orders}
    more = {"also": also, "resources": resources}
    problem = Problem.asked(simplest(engine), moves, criterion, **asked, **worlds, **more)
    posed = replace(problem, criterion=graph_of(problem).criterion)  # with the scene's numbers
    posed.graphs.update(problem.graphs)
    return posed


def chooses_moves(problem: Problem) -> bool:
    """Return whether candidates of moves are chosen by default, as the formulation minimizes."""
    beside = problem.filters or problem.paths or problem.stands is not None or problem.orders
    return problem.moves.has_pairs and not (problem.is_timed or problem.goals or beside)


def graph_of(problem: Problem, *, moves: bool | None = None) -> States:
    """Return the graph of choices of a problem, cached with what was computed for it.

    ``moves``: whether candidates of moves are chosen, not states; by default as `chooses_moves`.
    Raises `ProblemError` if the problem has no such graph.
    """
    of_moves = chooses_moves(problem) if moves is None else moves
    name = "moves" if of_moves else "states"
    if name not in problem.graphs:
        problem.graphs[name] = (_of_moves if of_moves else _of_states)(problem)
    found: States = problem.graphs[name]
    return found


def states_of(problem: Problem) -> States:
    """Return the states and moves of a problem."""
    return graph_of(problem, moves=False)


def _of_moves(problem: Problem) -> States:
    """Return the graph of candidates of moves; over scenarios with limits that hold in all.

    Raises a `ProblemError` for goals and constraints that candidates of moves do not support.
    """
    why = {
        "orders": problem.orders is not None,
        f"aim {', '.join(map(str, problem.goals))}": problem.goals not in ((), (SUM,), (MINMAX,)),
        "stands": problem.stands is not None,
        f"filter {', '.join(map(str, problem.filters))}": bool(problem.filters),
        f"resource {', '.join(map(str, problem.paths))}": bool(problem.paths),
    }
    if (name := next((name for name, asked in why.items() if asked), None)) is not None:
        raise ProblemError(
            f"{name}: it is about states of the build, not about candidates alone; take "
            "schedule_search or another formulation of states"
        )
    budgets = parse_budgets(problem.budgets)
    if problem.scenarios and budgets:
        raise ProblemError(
            f"budget {problem.budgets[0]}: aims over scenarios take none where candidates are "
            "chosen; leave it out, or name aims"
        )
    also = (*problem.also, *(budget.response for budget in budgets if budget.response))
    asked = problem.engine, problem.schedule, problem.criterion, problem.limits
    decisions = pose_decisions(*asked, also, problem.resources)
    found = of_decisions(replace(decisions, budgets=budgets))
    return over_scenarios(found, problem.scenarios, problem.over) if problem.scenarios else found


def _of_states(problem: Problem) -> States:
    """Return the graph of states, of all orders where one is sought."""
    if problem.orders is None:
        return _states(problem)
    if problem.is_timed:
        raise ProblemError("makespan: it is found in one order; give an order, or leave it out")
    if problem.paths:
        raise ProblemError(f"resource {problem.paths[0]}: it is kept in one order; give an order")
    from seqopt.graph._orders import among_orders  # noqa: PLC0415  # few problems seek an order

    return among_orders(_states(problem), problem.orders)


def _states(problem: Problem) -> States:
    """Return the graph of states of a problem, with goals, constraints and scenarios."""
    over = problem.over if problem.scenarios else WORST_PEAK
    goals = problem.goals or (AIMS[over.aim],)
    asked = problem.engine, problem.moves, problem.criterion, goals, problem.limits
    found = build_states(*asked, problem.stands)
    check_parts(problem.filters)
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
    if caps := parse_budgets(problem.budgets, of_states=True):
        found = within(found, {cap.name: cap.bound for cap in caps})
    if found.standing is not None and found.standing.curing is not None and not found.is_timed:
        raise ProblemError(
            "curing: it says how long steps wait; add makespan to the aims, as makespan,steps"
        )
    return over_scenarios(found, problem.scenarios, over) if problem.scenarios else found
