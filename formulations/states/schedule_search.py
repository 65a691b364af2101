r"""The states of a build by threshold and reachability, one goal after the other: exact.

A state is how many bricks stand and which node each robot holds; a plan is a path from the empty
site to an end of the build, each of its moves a step. Goals :math:`g_1, g_2, \dots` are minimized
in their order,

.. math::

   \operatorname{lex\,min}_{s_1, \dots, s_N} \; \bigl( g_1(s_1, \dots, s_N), \;
   g_2(s_1, \dots, s_N), \; \dots \bigr),
   \qquad
   g(s_1, \dots, s_N) = \max_i v(s_i)
   \quad\text{or}\quad
   g(s_1, \dots, s_N) = \sum_i c(s_{i-1}, s_i),

with :math:`v` the value of a state and :math:`c` the cost of a step. A narrow search without
regrips, which keeps the best states of every brick count, gives a first plan. It is the best if it
takes no more than what all plans have in common: the finished structure at their end, and as many
steps as bricks and robots call for. Where there are many states a second one, somewhat wider, keeps
any of those that take no more. Where states must stand or be good in scenarios, which is dear
to ask of them all, it is sought without that, and kept only if it is then the best; what the best
plan of the first scenario takes in all is then where the threshold starts. It rises until states
below it connect the empty site to an end; responses are computed only for states next to those that
are reached below it, and with six digits until their value is close to that of the plan. Among
these every goal is a shortest path, with the maximum instead of the sum for a peak; what is not on
a best path of one goal is left out before the next. Whether states stand is asked only of those on
the best path; where one falls, the next best path is sought without it (Dellin and Srinivasa, A
unifying formalism for shortest path problems with expensive edge evaluations via lazy best-first
search over paths with edge selectors, 2016). A margin of stability comes first: the best
one with which states still connect both ends is found by halving an interval, and all further
states must have it.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import groupby
from math import comb
from operator import itemgetter, le

import numpy as np

from formulations.states._search import (
    WIDTH,
    StopError,
    Watching,
    after_margins,
    best_standing,
    best_total,
    narrow,
    plan_by_then,
    shortest,
    watched,
)
from formulations.states.on_graph import _path_of_instance
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph._budgets import is_beyond
from seqopt.graph._explore import Explorer
from seqopt.graph.instances.instance import Instance
from seqopt.graph.paths import distances, lexicographic, tied
from seqopt.graph.states._visits import FreeStates, floors_of_goals
from seqopt.graph.states.states import States
from seqopt.plan.calling._guard import StatePath
from seqopt.plan.calling.formulation import Formulation, FormulationKind, On, Watch
from seqopt.problem.problem import Measure
from seqopt.work.progress import Tell

FAR_BELOW = 4.0  # what the narrow search finds, over the first threshold
MANY = 500_000  # grip sets, about: to look at all takes longer than a second narrow search
WIDER = 4  # how many times as wide that one is


def solve(
    problem: States | Instance,
    *,
    width: int = 50,
    growth: float = 1.1,
    seconds: float = np.inf,
    max_memory: float = np.inf,
    progress: Tell = lambda _: None,
) -> StatePath:
    """Return the best path.

    ``width``: from how many new states of a brick count the narrow search goes on; ``growth``: of
    the threshold from one search to the next, over itself; ``seconds``, ``max_memory`` (bytes, by
    default all that are free): after which, or above which, the best plan found is returned, and
    what is proven by then. Raises `InfeasibleError` if no plan is allowed; `ProblemError`,
    `TimeUpError` if an option is none, or memory or time is up before any plan is found.
    """
    if width < 1 or not growth > 1:
        raise ProblemError(
            f"options width={width}, growth={growth:g}: give a whole number from 1 on, and a "
            "number above 1"
        )
    if isinstance(problem, Instance):
        return _path_of_instance(problem, lambda g, _: (*lexicographic(g), False), Watch(seconds))
    tell = watched(problem, Watch(seconds), max_memory, progress)
    if problem.totals:
        return best_total(problem, shortest, Watch(seconds), tell)
    dear = bool(problem.demands or problem.each) and min(seconds, max_memory) == np.inf
    options = _Options(width, growth, dear)
    return after_margins(problem, lambda rest: _search(rest, options, tell), tell)


@dataclass(frozen=True)
class _Options:
    """How to search; ``dear``: whether a first plan is worth its time only if it is the best."""

    width: int
    growth: float
    dear: bool
    enough: float = -np.inf


def _search(problem: States, options: _Options, tell: Watching) -> StatePath:
    """Return the best path, or the first one found where the search is stopped."""
    floors = tuple(map(tied, floors_of_goals(problem)))
    found, proven = None, [floors[0]]
    wide = Explorer(FreeStates(problem), tell=tell)
    many = comb(2 * len(problem.network.inner), problem.space.robots) * problem.space.levels > MANY
    try:
        wider = replace(options, width=WIDER * options.width, enough=floors[0])
        for each in (options, wider)[: 1 + many]:
            plans = [found, _first(problem, each, floors, tell)]
            found = min(filter(None, plans), key=lambda p: p.objective, default=None)
            if found and not problem.budgets and all(map(le, found.objective, floors)):
                return found  # no plan is better
        ceiling = found.objective[0] if found else np.inf
        if found is None and problem.budgets:
            _require_room(problem, tell)
        return _best(problem, wide, (ceiling, options.growth), proven)
    except (StopError, KeyboardInterrupt) as stop:
        return _unproven(plan_by_then(found, stop), wide, proven[-1])


def _first(
    problem: States, options: _Options, floors: tuple[float, ...], tell: Watching
) -> StatePath | None:
    """Return a first plan; where that is dear, only if it takes no more than floors of goals."""
    most, enough = floors if options.dear else None, options.enough
    if options.dear and problem.each and not problem.demands:
        found = _in_all(problem, narrow(problem.each[0], options.width, tell, most, enough), floors)
        if found:
            return found
    return narrow(problem, options.width, tell, most, enough)


def _require_room(problem: States, tell: Watching) -> None:
    """Raise an `InfeasibleError` if every plan exceeds a budget, before thresholds are tried."""
    totals = problem.goals[len(problem.aims) :]
    every = Explorer(FreeStates(replace(problem, goals=totals, budgets=())), tell=tell)
    if every.rise() and is_beyond(every.graph().graph, problem.budgets):
        raise InfeasibleError("no plan is within all budgets")


def _best(
    problem: States, wide: Explorer, options: tuple[float, float], proven: list[float]
) -> StatePath:
    """Return the best plan below the lowest threshold of a rising row that connects both ends.

    What is proven of the first goal is added to a list on the way.
    """
    threshold, (ceiling, growth) = -np.inf, options
    if np.isfinite(ceiling) or problem.goals[0].measure is not Measure.PEAK:
        threshold = max(ceiling / FAR_BELOW, proven[0])
    if problem.each and problem.goals[0].measure is Measure.PEAK:
        threshold = max(_of_one(problem, options), proven[0])
    while True:
        if wide.rise(threshold):
            with suppress(InfeasibleError):  # of what stands
                return best_standing(problem, wide)
        if wide.excluded == np.inf:
            raise InfeasibleError("no plan is allowed")
        # of a state that every plan would have to pass, or a larger
        proven.append(max([wide.excluded, *proven[-1:]]))
        grown = threshold * growth if np.isfinite(threshold) else -np.inf
        threshold = max(wide.excluded, min(ceiling, grown))


def _of_one(problem: States, options: tuple[float, float]) -> float:
    """Return what the plan that is best in the first scenario takes in all; at least in that one.

    What is below the former is enough to be looked at, where that plan is allowed in all.
    """
    first = replace(problem.each[0], goals=problem.aims, budgets=())  # budgets are of the scene
    found = narrow(first, WIDTH, lambda _: None)
    ceiling = np.inf if found is None else found.objective[0]
    one = _best(first, Explorer(FreeStates(first)), (ceiling, options[1]), [-np.inf])
    inside = _in_all(problem, one, (np.inf,) * len(problem.goals))
    return (inside or one).objective[0]


def _in_all(problem: States, one: StatePath | None, most: tuple[float, ...]) -> StatePath | None:
    """Return a plan of one scenario, valued in all; None if in any it is not allowed.

    Or if goals then take more of it than ``most``.
    """
    worst = np.full(len(problem.goals), -np.inf)
    for level, same in groupby(one.states if one else (), key=itemgetter(0)):
        values, allowed = problem.values(level, np.array([state for _, *state in same]))
        if not allowed.all():
            return None
        worst = np.maximum(worst, values.max(axis=0))
    if one is None:
        return None
    pairs = zip(problem.goals, worst.tolist(), one.objective, strict=False)
    objective = tuple(w if goal.measure is Measure.PEAK else value for goal, w, value in pairs)
    inside = all(map(le, objective, most))
    return replace(one, objective=objective, bound=objective) if inside else None


def _unproven(found: StatePath, wide: Explorer, proven: float) -> StatePath:
    """Return the first plan, and what thresholds and the levels reached prove of the first goal."""
    bound = proven
    if not wide.peaks[0] and wide.level:
        graph, states = wide.graph()
        least = distances(graph, graph.amounts[:, 0])
        level = np.repeat([level for level, *_ in states], [len(rows) for *_, rows in states])
        bound = float(least[level == wide.level].min(initial=np.inf))
    return replace(found, bound=(min(bound, found.objective[0]), *found.bound[1:]))


FORMULATION = Formulation(
    "schedule_search",
    "threshold and reachability among the states of a build",
    FormulationKind.EXACT,
    None,
    solve,
    on=On.STATES,
    also=(On.GRAPHS,),
    takes_budgets=True,
)
