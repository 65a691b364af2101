r"""The free schedule by threshold and reachability, one goal after the other: exact.

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
regrips, which keeps the best states of every brick count, gives a first plan. Then a threshold
rises until states below it connect the empty site to an end; responses are computed only for states
next to those that are reached below it. Among these every goal is a shortest path, with the maximum
instead of the sum for a peak; what is not on a best path of one goal is left out before the
next. A margin of stability comes first: the best one with which states still connect both ends is
found by halving an interval, and all further states must have it. The certificate proves every
value again: below it no path connects the empty site to an end.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from seqopt.errors import InfeasibleError, ProblemError, SeqoptError, TimeUpError
from seqopt.placement.formulation import FormulationKind
from seqopt.placement.free_goals import Measure
from seqopt.placement.free_graph import StateGraph, explore
from seqopt.placement.free_paths import TIED, keep_best, least_from_start, shortest
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.schedule_formulation import ScheduleFormulation
from seqopt.placement.schedule_selection import ScheduleSelection
from seqopt.placement.sturdiest import best_margin
from seqopt.work.memory import free_memory
from seqopt.work.progress import Stage, Tell

FAR_BELOW = 4.0  # what the narrow search finds, over the first threshold
COPIES = 2.0  # of what is kept, that are needed at once while it grows

Watching = Callable[[StateGraph], None]


class _StopError(Exception):
    """Time or memory that was given is used up; says which."""

    def too_little(self) -> SeqoptError:
        """Return what to say where no plan was found before."""
        if str(self) == "time":
            return TimeUpError("no plan was found yet; give more")
        return ProblemError("option max_memory: it is too little to find a plan; give more")


def solve(
    problem: FreeProblem,
    *,
    width: int = 50,
    growth: float = 1.1,
    seconds: float = np.inf,
    max_memory: float = np.inf,
    progress: Tell = lambda _: None,
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
    max_memory : float, optional
        Bytes that states, moves and responses may take, about; then likewise. By default as many as
        are free.
    progress : callable, optional
        Told as a `seqopt.work.Stage` how far each pass through the bricks is.

    Returns
    -------
    ScheduleSelection
        Its bounds are its values, unless time or memory was used up or it was interrupted.

    Raises
    ------
    InfeasibleError
        If no plan is allowed.
    ProblemError, TimeUpError
        If the width is not positive, or memory or time is up before any plan is found.
    """
    if width < 1 or not growth > 1:
        raise ProblemError(
            f"options width={width}, growth={growth:g}: give a whole number from 1 on, and a "
            "number above 1"
        )
    _require_order(problem)
    reached: list[StateGraph] = []
    tell = _watch(problem, (time.perf_counter() + seconds, max_memory), progress, reached)
    return _search(problem, (width, growth), tell, reached)


def _watch(
    problem: FreeProblem,
    most: tuple[float, float],
    progress: Tell,
    reached: list[StateGraph],
) -> Watching:
    """Return what is told every level: it keeps the states and ends the search in time."""
    passes = 0

    def tell(graph: StateGraph) -> None:
        nonlocal passes
        bricks = len(graph.levels) - 1
        passes += bricks == 0
        progress(Stage(f"free schedule, pass {passes}", bricks / problem.space.bricks))
        reached[:] = [graph]
        if time.perf_counter() > most[0]:
            raise _StopError("time")
        room = min(most[1], free_memory() + graph.nbytes)
        if COPIES * (graph.nbytes + problem.sets.nbytes) > room:
            raise _StopError("memory")

    return tell


def _require_order(problem: FreeProblem) -> None:
    margins = [goal.of_margins for goal in problem.goals]
    if sorted(margins, reverse=True) != margins:
        named = ", ".join(map(str, problem.goals))
        raise ProblemError(f"aims {named}: name bond, friction and tilt before all others")


def _search(
    problem: FreeProblem, options: tuple[int, float], tell: Watching, reached: list[StateGraph]
) -> ScheduleSelection:
    """Return the best free schedule, or the first one found where the search is stopped."""
    if problem.goals[0].of_margins:
        try:
            value, bound, rest = best_margin(problem, tell)
        except _StopError as stop:
            raise stop.too_little() from None
        after = _search(rest, options, tell, reached)
        if len(problem.goals) == 1:  # what was chosen after it was nobody's wish
            after = replace(after, objective=(), bound=())
        return replace(after, objective=(value, *after.objective), bound=(bound, *after.bound))
    found, proven = None, [-np.inf]
    try:
        narrow = explore(problem, width=options[0], tell=tell)
        reached.clear()  # of which nothing is proven, and which is used up
        found = _selection(narrow) if narrow.whole else None
        ceiling = found.objective[0] if found else np.inf
        graph = _below(problem, (ceiling, options[1]), tell, proven)
    except (_StopError, KeyboardInterrupt) as stop:
        if found is None and isinstance(stop, _StopError):
            raise stop.too_little() from None
        if found is None:
            raise
        return _unproven(found, reached, proven[-1], str(stop) or "interrupt")
    if not graph.whole:
        raise InfeasibleError("no plan of the free schedule is allowed")
    return _selection(graph)


def _below(
    problem: FreeProblem, options: tuple[float, float], tell: Watching, proven: list[float]
) -> StateGraph:
    """Return the states below the lowest threshold of a rising row that connects start to end.

    What is proven of the first goal is added to a list on the way.
    """
    threshold, (ceiling, growth) = -np.inf, options
    if np.isfinite(ceiling) or problem.goals[0].measure is not Measure.PEAK:
        threshold = ceiling / FAR_BELOW
    while True:
        tied = threshold + TIED * abs(threshold) if np.isfinite(threshold) else threshold
        graph = explore(problem, tied, tell=tell)
        if graph.whole or threshold >= ceiling or graph.excluded == np.inf:
            return graph
        proven.append(graph.excluded)  # of a state that every plan would have to pass, or a larger
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


def _unproven(
    found: ScheduleSelection, reached: list[StateGraph], proven: float, why: str
) -> ScheduleSelection:
    """Return the first plan, and what thresholds and the levels reached prove of the first goal."""
    bound = proven
    for graph in reached:
        bound = max(bound, float(least_from_start(graph, 0)[-1].min()))
    bound = min(bound, found.objective[0])
    rest = (-np.inf,) * (len(found.objective) - 1)
    return ScheduleSelection(found.states, found.objective, (bound, *rest), stopped=why)


FORMULATION = ScheduleFormulation(
    "schedule_search",
    "threshold and reachability among the states of the free schedule",
    FormulationKind.EXACT,
    solve,
)
