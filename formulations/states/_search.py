"""What formulations of states share: first plans, budgets, scenarios and orders, by any choice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from operator import le

import numpy as np

from formulations.choice import Choice, Choose
from formulations.states._totals import LeastTotal, StopError, cheapest_by, least_total
from seqopt._interrupts import answered
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, SeqoptError, TimeUpError
from seqopt.graph._budgets import Within, within_budgets
from seqopt.graph._explore import Explorer, Visited
from seqopt.graph.formulation import Watch, find_formulation
from seqopt.graph.graph import Graph
from seqopt.graph.orders import (
    MOST_PARTS,
    AllOrders,
    OrderSelection,
    OrderStates,
    Trial,
    order_value,
)
from seqopt.graph.paths import Best, _on_paths, lexicographic, path_values, reached, tied
from seqopt.graph.solution import StatePath
from seqopt.graph.states._visits import FreeStates, ScenarioSums, explore
from seqopt.graph.states.states import States
from seqopt.plan.search._margin_search import best_margin, bisected, with_margin
from seqopt.problem.amounts import STEPS
from seqopt.problem.problem import RobustAim
from seqopt.work._workers import free_memory
from seqopt.work.progress import Stage, Tell

WIDTH = 50  # new states of a brick count from which the narrow search goes on
COPIES = 2.0  # of what is kept, that are needed at once while it grows
GROWN = 1.1  # times as much is kept before it is asked again how much memory is free

Watching = Callable[[Explorer], None]
Search = Callable[[States], StatePath]


def best_order(
    problem: AllOrders, choose: Choose, watch: Watch, tell: Watching, width: int | None = None
) -> OrderSelection:
    """Return the order of the path that is chosen through the states of all orders at once.

    ``width``: how many new states of a set of bricks are kept, where these are enough to find a
    plan; by default, if the first goal is a peak, those below that of the scene's own order.
    """
    try:
        if problem.states.goals[0].margins:
            return _order_of_margin(problem, tell)
        if width is not None:
            with suppress(NothingFoundError):
                return _order_of_path(problem, choose, watch, tell, width)
        return _order_of_path(problem, choose, watch, tell, None)
    except StopError as stop:
        if str(stop) == "memory":
            raise ProblemError(
                f"scene {problem.scene.name}: the states of all orders do not fit the memory; "
                "give an order"
            ) from None
        raise _too_little(stop) from None


def _order_of_path(
    problem: AllOrders, choose: Choose, watch: Watch, tell: Watching, width: int | None
) -> OrderSelection:
    """Return the order of a path that is chosen by a first goal that is no margin."""
    states, order = problem.states, problem.scene.build_order
    space = OrderStates(problem, MOST_PARTS)
    found = Explorer(space, width, tell)
    own = np.inf  # or the value of the scene's own order, if it is one of those asked for
    if problem.allows(order) and not (width or states.totals or states.budgets):
        own = order_value(problem, Trial(order, np.inf))
    found.rise(own if space.peaks[0] else np.inf)
    if not found.whole:
        raise found.without_plan("no order of the bricks has a plan")
    if states.totals:
        return _order_of_total(found, problem, choose, watch)
    if states.budgets:
        return _order_within(found, problem, len(space.parts) - 1)
    found.refine()
    visited = found.graph()
    chosen_ = choose(visited.graph.only(_on_paths(visited.graph)), watch)
    path, value, stopped = chosen_.path, own, "time" * chosen_.stopped
    if path and path_values(visited.graph, path)[0] < own:
        value, order = path_values(visited.graph, path)[0], problem.order_of(visited.of(path))
    if not np.isfinite(value):
        raise TimeUpError("no order with a plan was found yet; give more")
    bound = min(chosen_.bounds[0] if chosen_.bounds else -np.inf, value)
    return OrderSelection(order, value, bound, len(space.parts) - 1, stopped)


def _order_of_margin(problem: AllOrders, tell: Watching) -> OrderSelection:
    """Return the order with the best margin of stability, by halving an interval."""
    name, states = problem.states.goals[0].name, problem.states
    goals = (STEPS, *states.goals[len(states.aims) :])

    def demanding(value: float) -> tuple[Visited, Best | Within] | None:
        asked = replace(with_margin(states, name, value), goals=goals)
        found = Explorer(OrderStates(replace(problem, states=asked), MOST_PARTS), tell=tell)
        if not found.rise():
            return None
        with suppress(InfeasibleError):  # of budgets
            return exact_best(found, states.budgets)
        return None

    low, high = bisected(name, lambda value: demanding(value) is not None)
    found = demanding(high)
    assert found is not None  # as it was before
    order = problem.order_of(found[0].of(found[1].path))
    value = find_formulation("schedule_search").solve(problem.at(order)).objective[0]
    return OrderSelection(order, value, min(low, value), 0)


def _order_within(found: Explorer, problem: AllOrders, evaluated: int) -> OrderSelection:
    """Return the order of a path within budgets that is good in the first goal."""
    visited, best = exact_best(found, problem.states.budgets)
    order = problem.order_of(visited.of(best.path))
    plan = find_formulation("schedule_search").solve(problem.at(order))
    value, bound = plan.objective[0], best.bounds[0] if isinstance(best, Within) else -np.inf
    return OrderSelection(order, value, min(bound, value), evaluated)


def _order_of_total(
    found: Explorer, problem: AllOrders, choose: Choose, watch: Watch
) -> OrderSelection:
    """Return the order of the path of least total over scenarios."""
    visited, best = _least_total(found, problem.states.over, choose, watch)
    stopped, parts = "time" * watch.over, len({part for _, part, _ in visited.states})
    order, weights = problem.order_of(visited.of(best.path)), tuple(best.weights.tolist())
    return OrderSelection(order, best.value, best.bound, parts - 1, stopped, weights)


def _least_total(
    found: Explorer, aim: RobustAim, choose: Choose, watch: Watch
) -> tuple[Visited, LeastTotal]:
    visited = found.graph()
    graph = visited.graph.only(_on_paths(visited.graph))
    return visited, least_total(graph, aim, cheapest_by(choose, watch), watch)


def shortest(graph: Graph, _: Watch) -> Choice:
    """Return the path that is best in one goal after the other, by shortest paths."""
    return Choice(*lexicographic(graph))


def best_total(
    problem: States, choose: Choose, watch: Watch, tell: Watching, width: int | None = None
) -> StatePath:
    """Return the plan of least total over scenarios.

    ``choose``: paths of least sum; ``width``: how many new states of a brick count are kept; by
    default all, without which no plan is proven to be the least.
    """
    space = ScenarioSums(problem, regrips=width is None, standing=bool(problem.demands))
    try:
        found = Explorer(space, width, tell)
        if not found.rise():
            if width is not None:
                return best_total(problem, choose, watch, tell)
            raise found.without_plan("no plan is allowed")
        visited, best = _least_total(found, problem.over, choose, watch)
    except StopError as stop:
        raise _too_little(stop) from None
    plan = _selection(visited, Best(best.path, (best.value,)))
    prices, bound = (tuple(best.weights.tolist()),), (best.bound,)
    return replace(plan, bound=bound, prices=prices, stopped="time" * watch.over)


def chosen(problem: States, choose: Choose, watch: Watch, tell: Watching) -> StatePath:
    """Return the plan of a choice; where time was over, the better one of it and a first plan."""
    first = None
    try:
        first = narrow(problem, WIDTH, tell)
        wide = explore(problem, first.objective[0] if first else np.inf, tell=tell)
        if not wide.whole:
            raise wide.without_plan("no plan is allowed")
        wide.refine()
        graph, states = wide.graph()
        graph = replace(graph, caps=problem.budgets)
        with answered(watch.interrupt):
            best = choose(graph.only(_on_paths(graph)), watch)
    except (StopError, KeyboardInterrupt) as stop:
        return plan_by_then(first, stop)
    stopped = ("interrupt" if watch.interrupted else "time") * best.stopped
    if best.path:
        values = path_values(graph, best.path)
        found = _selection(Visited(graph, states), Best(best.path, values))
    if not best.path or (first and best.stopped and first.objective < values):
        found = plan_by_then(first, KeyboardInterrupt() if watch.interrupted else StopError("time"))
    known = (*best.bounds, *[-np.inf] * (graph.goals - len(best.bounds)))
    bound = tuple(map(min, found.objective, (*known, *found.objective[graph.goals :])))
    return replace(found, bound=bound, stopped=stopped, prices=best.prices)


def watched(problem: States, watch: Watch, most: float, progress: Tell) -> Watching:
    """Return what is told part by part: it says how far it is, and ends the search in time."""
    asked = 0.0

    def tell(found: Explorer) -> None:
        share = found.level / problem.space.levels
        progress(Stage(f"states, pass {found.passes}", share))
        if watch.over:
            raise StopError("time")
        nonlocal asked
        used = COPIES * (found.nbytes + problem.nbytes)
        if used > most:
            raise StopError("memory")
        if used > GROWN * asked:
            asked = used
            if used > free_memory() + found.nbytes:
                raise StopError("memory")

    return tell


def plan_by_then(found: StatePath | None, stop: StopError | KeyboardInterrupt) -> StatePath:
    """Return a first plan, of which nothing is proven; raise an error if there is none yet."""
    if found is None:
        raise _too_little(stop) from None
    none = (-np.inf,) * len(found.objective)
    return StatePath(found.states, found.objective, none, stopped=str(stop) or "interrupt")


def _too_little(stop: StopError | KeyboardInterrupt) -> SeqoptError | KeyboardInterrupt:
    """Return what to say where no plan was found before."""
    if isinstance(stop, KeyboardInterrupt):
        return stop
    if str(stop) == "memory":
        return ProblemError("option max_memory: it is too little to find a plan; give more")
    return TimeUpError("no plan was found yet; give more")


def after_margins(problem: States, search: Search, tell: Watching) -> StatePath:
    """Return what is found once margins of stability, which come first, are at their best."""
    margins = [goal.margins is not None for goal in problem.goals]
    if sorted(margins, reverse=True) != margins:
        named = ", ".join(map(str, problem.goals))
        raise ProblemError(f"aims {named}: name bond, friction and tilt before all others")
    if not margins[0]:
        return search(problem)
    try:
        value, bound, rest, states = best_margin(problem, tell)
    except StopError as stop:
        raise _too_little(stop) from None
    if len(problem.goals) == 1:  # nothing else was wished
        return StatePath(tuple(states), (value,), (bound,))
    try:
        after = after_margins(rest, search, tell)
    except InfeasibleError as error:
        if not (problem.is_timed and problem.budgets):
            raise
        # margins are not sought within budgets of time: with another one there may be a plan
        raise NothingFoundError(f"with the best {problem.goals[0]}, {error}") from None
    prices = ((0.0,) * len(problem.budgets), *after.prices) if problem.budgets else ()
    objective, bounds = (value, *after.objective), (bound, *after.bound)
    return replace(after, objective=objective, bound=bounds, prices=prices)


def narrow(
    problem: States,
    width: int,
    tell: Watching,
    most: Sequence[float] | None = None,
    enough: float = -np.inf,
) -> StatePath | None:
    """Return the best plan through a few states of every brick count, if there is one.

    Where states must stand it is asked of all of them only if the best paths fall; ``most``: what
    goals may take of it, whether states stand or not; ``enough``: as of `Explorer`.
    """
    for standing in (False, True)[: 1 + bool(problem.demands)]:
        space = FreeStates(problem, regrips=False, standing=standing)
        found = Explorer(space, width, tell, enough)
        with suppress(NothingFoundError):
            if found.rise(np.inf if most is None else most[0]):
                visited, best = exact_best(found, problem.budgets)
                if most is not None and not all(map(le, best.values, most)):
                    return None
                if not problem.demands:
                    return _selection(visited, best)
                return best_standing(problem, found)
    return None


def best_standing(problem: States, found: Explorer) -> StatePath:
    """Return the best path through visited states that stand as is demanded."""
    while True:
        visited, best = exact_best(found, problem.budgets)
        if not close_fallen(problem, found, visited, best.path):
            return _selection(visited, best)


def close_fallen(problem: States, found: Explorer, visited: Visited, path: Sequence[int]) -> bool:
    """Exclude states of a path that are not proven to stand; return whether there are any.

    With each go those of its part that are known to fall: none of these is asked.
    """
    fallen = False
    for level, key, state in visited.of(path) if problem.demands else ():
        if not problem.stand(level, state[None])[0]:
            fallen = True
            found.close((level, key), state[None])
            for *part, states in visited.states:
                if part == [level, key]:
                    found.close((level, key), states[problem.recalled(level, states) < 0])
    return fallen


def exact_best(found: Explorer, budgets: Sequence[float] = ()) -> tuple[Visited, Best | Within]:
    """Return the best path through visited states, values close to its own being exact.

    Raises `InfeasibleError` if there is none though all states were visited; `NothingFoundError` if
    some were not.
    """
    while True:
        visited = found.graph()
        graph = visited.graph
        try:
            best = within_budgets(graph, budgets) if budgets else lexicographic(graph)
        except InfeasibleError as error:
            raise found.without_plan(str(error)) from None
        if not found.refine(best.values):
            return visited, best


def _selection(visited: Visited, best: Best | Within) -> StatePath:
    """Return a path as a plan, and with it the states that a better one could pass."""
    (graph, states), value = visited, best.values[0]
    rows = tuple((level, *state.tolist()) for level, _, state in visited.of(best.path))
    kept = graph.amounts[:, 0] <= tied(value) if graph.peaks[0] else None
    parts = np.split(reached(graph, kept), np.cumsum([len(own) for *_, own in states])[:-1])
    hint = tuple(own[inside] for (*_, own), inside in zip(states, parts, strict=True))
    if isinstance(best, Within):
        return StatePath(rows, best.values, best.bounds, hint, best.prices)
    return StatePath(rows, best.values, best.values, hint)
