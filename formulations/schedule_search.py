r"""The free schedule by threshold and reachability, one goal after the other: exact.

A state is how many bricks stand and which node each robot holds; a plan is a path from the empty
site to an end of the build, each of its moves a step. Goals :math:`g_1, g_2, \dots` are made least
in their order,

.. math::

   \operatorname{lex\,min}_{s_1, \dots, s_N} \; \bigl( g_1(s_1, \dots, s_N), \;
   g_2(s_1, \dots, s_N), \; \dots \bigr),
   \qquad
   g(s_1, \dots, s_N) = \max_i v(s_i)
   \quad\text{or}\quad
   g(s_1, \dots, s_N) = \sum_i c(s_{i-1}, s_i),

with :math:`v` what a state is worth and :math:`c` what a step costs. A narrow search without
regrips, which keeps the best states of every brick count, gives a first plan. Then a threshold
rises until states below it connect the empty site to an end; responses are computed only for states
next to those that are reached below it. Among these every goal is a shortest path, with the maximum
in the place of the sum for a peak; what is not on a best path of one goal is left out before the
next. A margin of stability comes first: the best one with which states still connect both ends is
found by halving an interval, and all further states must have it. The certificate proves every
value anew: below it no path connects the empty site to an end.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from seqopt.errors import InfeasibleError, ProblemError
from seqopt.placement.formulation import FormulationKind
from seqopt.placement.free_goals import Measure
from seqopt.placement.free_graph import StateGraph, explore
from seqopt.placement.free_paths import TIED, keep_best, least_from_start, shortest
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.schedule_formulation import ScheduleFormulation
from seqopt.placement.schedule_selection import ScheduleSelection
from seqopt.placement.sturdiest import best_margin

FAR_BELOW = 4.0  # what the narrow search finds, over the first threshold


Tell = Callable[[StateGraph], None]


class _TimeUpError(Exception):
    """The time that was given is used up."""


def solve(
    problem: FreeProblem,
    *,
    width: int = 50,
    growth: float = 1.1,
    seconds: float = np.inf,
    progress: Callable[[str], None] = lambda _: None,
) -> ScheduleSelection:
    """Return the best free schedule.

    Parameters
    ----------
    problem : FreeProblem
    width : int, optional
        From how many new states of a brick count the narrow search goes on.
    growth : float, optional
        By how much the threshold rises from one search to the next, over itself.
    seconds : float, optional
        After which the best plan found is returned, and what is proven by then.
    progress : callable, optional
        Told in a few words how far the search is.

    Returns
    -------
    ScheduleSelection
        Its bounds are its values, unless time was up or the search was interrupted.

    Raises
    ------
    InfeasibleError
        If no plan is allowed.
    ProblemError
        If the width is not positive, or time is up before any plan is found.
    """
    if width < 1 or not growth > 1:
        raise ProblemError(
            f"options width={width}, growth={growth:g}: give a whole number from 1 on, and a "
            "number above 1"
        )
    _require_order(problem)
    end = time.perf_counter() + seconds
    reached: list[StateGraph] = []

    def tell(graph: StateGraph) -> None:
        progress(f"{len(graph.levels) - 1} of {problem.space.bricks} bricks")
        reached[:] = [graph]
        if time.perf_counter() > end:
            raise _TimeUpError

    return _search(problem, (width, growth), tell, reached)


def _require_order(problem: FreeProblem) -> None:
    margins = [goal.of_margins for goal in problem.goals]
    if sorted(margins, reverse=True) != margins:
        named = ", ".join(map(str, problem.goals))
        raise ProblemError(f"aims {named}: name bond, friction and tilt before all others")


def _search(
    problem: FreeProblem, options: tuple[int, float], tell: Tell, reached: list[StateGraph]
) -> ScheduleSelection:
    """Return the best free schedule, or the first one found where the search is stopped."""
    if problem.goals[0].of_margins:
        value, bound, rest = best_margin(problem, tell)
        after = _search(rest, options, tell, reached)
        if len(problem.goals) == 1:  # what was chosen after it was nobody's wish
            after = replace(after, objective=(), bound=())
        return replace(after, objective=(value, *after.objective), bound=(bound, *after.bound))
    found = None
    try:
        narrow = explore(problem, width=options[0], tell=tell)
        found = _selection(narrow) if narrow.whole else None
        graph = _below(problem, found.objective[0] if found else np.inf, options[1], tell)
    except (_TimeUpError, KeyboardInterrupt) as stop:
        if found is None and isinstance(stop, KeyboardInterrupt):
            raise
        if found is None:
            raise ProblemError(
                "option seconds: they are too few to find a plan; give more"
            ) from None
        why = "time" if isinstance(stop, _TimeUpError) else "interrupt"
        return _unproven(found, reached[-1], why)
    if not graph.whole:
        raise InfeasibleError("no plan of the free schedule is allowed")
    return _selection(graph)


def _below(problem: FreeProblem, ceiling: float, growth: float, tell: Tell) -> StateGraph:
    """Return the states below the lowest threshold of a rising row that connects start to end."""
    threshold = -np.inf
    if np.isfinite(ceiling) or problem.goals[0].measure is not Measure.PEAK:
        threshold = ceiling / FAR_BELOW
    while True:
        tied = threshold + TIED * abs(threshold) if np.isfinite(threshold) else threshold
        graph = explore(problem, tied, tell=tell)
        if graph.whole or threshold >= ceiling or graph.excluded == np.inf:
            return graph
        threshold = min(ceiling, max(graph.excluded, threshold * growth))
        del graph  # or two of them would need memory at once


def _selection(graph: StateGraph) -> ScheduleSelection:
    """Return the best path through a graph for all goals in their order."""
    values = []
    for goal in range(len(graph.problem.goals)):
        graph, least = keep_best(graph, goal)
        values.append(least)
    path = shortest(graph)
    states = tuple((b, *graph.levels[b].states[row].tolist()) for b, row in path)
    return ScheduleSelection(states, tuple(values), tuple(values))


def _unproven(found: ScheduleSelection, reached: StateGraph, why: str) -> ScheduleSelection:
    """Return the first plan, and what the levels that were reached prove of the first goal."""
    bound = float(least_from_start(reached, 0)[-1].min())
    if reached.problem.goals[0].measure is Measure.PEAK:
        bound = min(bound, found.objective[0])
    rest = (-np.inf,) * (len(found.objective) - 1)
    return ScheduleSelection(found.states, found.objective, (bound, *rest), stopped=why)


FORMULATION = ScheduleFormulation(
    "schedule_search",
    "threshold and reachability among the states of the free schedule",
    FormulationKind.EXACT,
    solve,
)
