"""Pose a problem: what is asked of a build, and the graph of choices that it becomes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import simplest
from seqopt.errors import ProblemError
from seqopt.graph.layers.compiled import best_in_order
from seqopt.graph.layers.costs import Budget
from seqopt.graph.layers.layers import Layers, candidate_layers, in_scenarios, steps_over, travel
from seqopt.graph.source import CANDIDATES, STATES
from seqopt.graph.states._checks import check_parts
from seqopt.graph.states.states import States, build_states, over_scenarios, within
from seqopt.problem.amounts import MINMAX, SUM, Amount
from seqopt.problem.filters import Filter
from seqopt.problem.problem import (
    WORST_PEAK,
    Aim,
    AskedBudget,
    Orders,
    Problem,
    RobustAim,
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
ORDERS = "orders"  # the graph of states in all orders, beside `CANDIDATES` and `STATES`


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
    graph: Layers | States
    if graph_kind(problem) != CANDIDATES:
        graph = states_of(problem)
    else:
        parse_budgets(problem.budgets)
        graph = _scenarios(problem) if problem.scenarios else _plain_layers(problem)
    posed = replace(problem, criterion=graph.criterion)  # with the numbers of the scene
    posed.graphs.update(problem.graphs)
    return posed


def graph_kind(problem: Problem) -> str:
    """Return the default kind of graph of a problem."""
    if problem.orders is not None:
        return ORDERS
    beside = problem.filters or problem.paths or problem.stands is not None
    asked = problem.is_timed or problem.goals or beside
    return STATES if asked or not in_layers(problem.moves) else CANDIDATES


def in_layers(moves: Schedule | FreeRules) -> bool:
    """Return whether steps have at most two open grips, so that candidates form layers."""
    return getattr(moves, "has_pairs", True)


def usual(problem: Problem) -> str:
    """Return the name of the default formulation of a problem."""
    if problem.orders is not None:
        return "order_search"
    if problem.is_timed or problem.paths:
        return "makespan_labels"
    if graph_kind(problem) == STATES:
        return "schedule_search"
    if problem.scenarios:
        return "scenario_search" if problem.over.aim is Aim.SUM else "minimax"
    return "labels" if problem.budgets else "overlap_dp"


def questions_of(problem: Problem) -> tuple[str, ...]:
    """Return the questions that a formulation of a problem must support."""
    if problem.orders is not None:
        return ("order",)
    if problem.is_timed or problem.paths:
        return ("time",) * problem.is_timed + ("resource",) * bool(problem.paths)
    if not (problem.scenarios and problem.over.aim is Aim.SUM):
        return ("goals",)
    return ("tail", "instance") if graph_kind(problem) == CANDIDATES else ("tail",)


def graph_of(problem: Problem, kind: str = "") -> Any:
    """Return the graph of choices of a problem, cached with what was computed for it.

    ``kind``: ``candidates``, ``states`` or ``orders``; by default as `graph_kind`. Raises
    `ProblemError` if the problem has no such graph.
    """
    kind = kind or graph_kind(problem)
    if kind not in problem.graphs:
        problem.graphs[kind] = BUILDERS[kind](problem)
    return problem.graphs[kind]


def layers_of(problem: Problem) -> Layers:
    """Return the open grips of a problem in layers of candidates, budgets included."""
    found: Layers = graph_of(problem, CANDIDATES)
    return found


def states_of(problem: Problem) -> States:
    """Return the states and moves of a problem."""
    found: States = graph_of(problem, STATES if problem.orders is None else ORDERS)
    return found


def _plain_layers(problem: Problem) -> Layers:
    """Return layers of candidates without budgets."""
    if "plain" not in problem.graphs:
        asked = problem.engine, problem.schedule, problem.criterion, problem.limits
        counted = [b.response for b in parse_budgets(problem.budgets) if b.response]
        also = (*problem.also, *counted)
        problem.graphs["plain"] = candidate_layers(*asked, also, problem.resources)
    found: Layers = problem.graphs["plain"]
    return found


def _layers(problem: Problem) -> Layers:
    """Return the layers of a problem; with scenarios the largest costs in any."""
    _require_candidates(problem)
    if problem.scenarios:
        return _scenarios(problem)
    return _with_budgets(_plain_layers(problem), parse_budgets(problem.budgets))


def _with_budgets(problem: Layers, asked: Sequence[AskedBudget]) -> Layers:
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


def _scenarios(problem: Problem) -> Layers:
    if problem.budgets:
        raise ProblemError(
            f"budget {problem.budgets[0]}: aims over scenarios take none where candidates are "
            "chosen; leave it out, or name aims"
        )
    return in_scenarios(_plain_layers(problem), problem.scenarios, problem.over)


def _require_candidates(problem: Problem) -> None:
    """Raise a `ProblemError` for goals and constraints that layers of candidates do not support."""
    of_states = problem.goals not in ((), *((goal,) for goal in AIMS.values()))
    why = {
        "orders": problem.orders is not None,
        f"aim {', '.join(map(str, problem.goals))}": of_states,
        "stands": problem.stands is not None,
        f"filter {', '.join(map(str, problem.filters))}": bool(problem.filters),
        f"resource {', '.join(map(str, problem.paths))}": bool(problem.paths),
    }
    for name in (name for name, asked in why.items() if asked):
        raise ProblemError(
            f"{name}: it is about states of the build, not about candidates alone; take "
            "schedule_search or another formulation of states"
        )


def _states(problem: Problem) -> States:
    """Return the graph of states of a problem, with goals, constraints and scenarios."""
    from seqopt.sequence._rule_space import FreeSpace  # noqa: PLC0415  # of states alone

    over = problem.over if problem.scenarios else WORST_PEAK
    goals = problem.goals or (AIMS[over.aim],)
    asked = problem.engine, problem.moves, problem.criterion, goals, problem.limits
    found = build_states(*asked, problem.stands)
    check_parts(problem.filters)
    found = replace(found, resources=problem.resources, filters=problem.filters)
    found = replace(found, paths=problem.paths)
    space = found.space
    ends = isinstance(space, FreeSpace) and space.first == space.levels
    if ends and space.ended(space.start()).all():
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


def _in_own_order(problem: Problem) -> States:
    if problem.orders is not None:
        raise ProblemError(
            f"{problem.orders.value} orders: states alone are of one order; take order_search, or "
            "give an order"
        )
    return _states(problem)


def _all_orders(problem: Problem) -> States:
    if problem.orders is None:
        raise ProblemError("an order is given; pose with orders='tied' to seek one")
    if problem.is_timed:
        raise ProblemError("makespan: it is found in one order; give an order, or leave it out")
    if problem.paths:
        raise ProblemError(f"resource {problem.paths[0]}: it is kept in one order; give an order")
    from seqopt.graph._orders import among_orders  # noqa: PLC0415  # few problems seek an order

    return among_orders(_states(problem), problem.orders)


BUILDERS: dict[str, Callable[[Problem], Layers | States]] = {
    CANDIDATES: _layers,
    STATES: _in_own_order,
    ORDERS: _all_orders,
}
