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
regrips, which keeps the best states of every brick count, gives a first plan; where states must
stand or be good in scenarios, which is dear to ask of them all, only if time or memory is limited;
what the best plan of the first scenario takes in all is then where the threshold starts. It rises
until states below it connect the empty site to an end; responses are computed only for states
next to those that are reached below it, and with six digits until their value is close to that of
the plan. Among these every goal is a shortest path, with the maximum instead of the sum for a peak;
what is not on a best path of one goal is left out before the next. Whether states stand is asked
only of those on the best path; where one falls, the next best path is sought without it (Dellin and
Srinivasa, A unifying formalism for shortest path problems with expensive edge evaluations via lazy
best-first search over paths with edge selectors, 2016). A margin of stability comes first: the best
one with which states still connect both ends is found by halving an interval, and all further
states must have it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from seqopt.arrays import Ints
from seqopt.errors import InfeasibleError, ProblemError, SeqoptError, TimeUpError
from seqopt.graph.budgets import Within, within_budgets
from seqopt.graph.explore import Explorer
from seqopt.graph.parts import Key, Visited
from seqopt.graph.paths import Best, distances, lexicographic, reached, tied
from seqopt.placement.formulation import FormulationKind
from seqopt.placement.free_goals import Measure
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.free_states import FreeStates
from seqopt.placement.schedule_formulation import ScheduleFormulation
from seqopt.placement.schedule_selection import ScheduleSelection
from seqopt.placement.sturdiest import best_margin
from seqopt.work.memory import free_memory
from seqopt.work.progress import Stage, Tell

FAR_BELOW = 4.0  # what the narrow search finds, over the first threshold
ONE_WIDTH = 50  # states of a brick count from which the narrow search of one scenario goes on
COPIES = 2.0  # of what is kept, that are needed at once while it grows

Watching = Callable[[Explorer], None]


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
    reached: list[Explorer] = []
    tell = _watch(problem, (time.perf_counter() + seconds, max_memory), progress, reached)
    dear = bool(problem.demands or problem.each) and min(seconds, max_memory) == np.inf
    return _search(problem, (0 if dear else width, growth), tell, reached)


def _watch(
    problem: FreeProblem,
    most: tuple[float, float],
    progress: Tell,
    reached: list[Explorer],
) -> Watching:
    """Return what is told every level: it keeps the states and ends the search in time."""

    def tell(found: Explorer) -> None:
        share = found.level / problem.space.levels
        progress(Stage(f"free schedule, pass {found.passes}", share))
        reached[:] = [found]
        if time.perf_counter() > most[0]:
            raise _StopError("time")
        room = min(most[1], free_memory() + found.nbytes)
        if COPIES * (found.nbytes + problem.nbytes) > room:
            raise _StopError("memory")

    return tell


def _require_order(problem: FreeProblem) -> None:
    margins = [goal.of_margins for goal in problem.goals]
    if sorted(margins, reverse=True) != margins:
        named = ", ".join(map(str, problem.goals))
        raise ProblemError(f"aims {named}: name bond, friction and tilt before all others")


def _search(
    problem: FreeProblem, options: tuple[int, float], tell: Watching, reached: list[Explorer]
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
    wide = Explorer(FreeStates(problem), tell=tell)
    try:
        found = _narrow(problem, options[0], tell) if options[0] else None
        reached.clear()  # of which nothing is proven
        ceiling = found.objective[0] if found else np.inf
        return _best(problem, wide, (ceiling, options[1]), proven)
    except (_StopError, KeyboardInterrupt) as stop:
        if found is None and isinstance(stop, _StopError):
            raise stop.too_little() from None
        if found is None:
            raise
        return _unproven(found, wide, proven[-1], str(stop) or "interrupt")


def _narrow(problem: FreeProblem, width: int, tell: Watching) -> ScheduleSelection | None:
    """Return the best plan through a few states of every brick count, if there is one.

    Where states must stand it is asked of all of them only if the best paths fall.
    """
    for standing in (False, True)[: 1 + bool(problem.demands)]:
        narrow = Explorer(FreeStates(problem, regrips=False, standing=standing), width, tell)
        if narrow.rise():
            try:
                return _standing(problem, narrow)
            except InfeasibleError:
                continue
    return None


def _best(
    problem: FreeProblem, wide: Explorer, options: tuple[float, float], proven: list[float]
) -> ScheduleSelection:
    """Return the best plan below the lowest threshold of a rising row that connects both ends.

    What is proven of the first goal is added to a list on the way.
    """
    threshold, (ceiling, growth) = -np.inf, options
    if np.isfinite(ceiling) or problem.goals[0].measure is not Measure.PEAK:
        threshold = ceiling / FAR_BELOW
    if problem.each and problem.goals[0].measure is Measure.PEAK:
        threshold = _of_one(problem, options)
    while True:
        if wide.rise(threshold):
            try:
                return _standing(problem, wide)
            except InfeasibleError:  # of what stands
                pass
        if wide.excluded == np.inf:
            raise InfeasibleError("no plan of the free schedule is allowed")
        proven.append(wide.excluded)  # of a state that every plan would have to pass, or a larger
        grown = threshold * growth if np.isfinite(threshold) else -np.inf
        threshold = max(wide.excluded, min(ceiling, grown))


def _of_one(problem: FreeProblem, options: tuple[float, float]) -> float:
    """Return what the plan that is best in the first scenario takes in all; at least in that one.

    What is below the former is enough to be looked at, where that plan is allowed in all.
    """
    first = problem.each[0]
    narrow = _narrow(first, ONE_WIDTH, lambda _: None)
    ceiling = np.inf if narrow is None else narrow.objective[0]
    one = _best(first, Explorer(FreeStates(first)), (ceiling, options[1]), [])
    worst = -np.inf
    for level, *state in one.states:
        values, allowed = problem.values(level, np.array([state]))
        if not allowed[0]:
            return one.objective[0]
        worst = max(worst, float(values[0, 0]))
    return worst


def _standing(problem: FreeProblem, found: Explorer) -> ScheduleSelection:
    """Return the best path through visited states that stand as is demanded."""
    known: set[tuple[int, ...]] = set()
    while True:
        visited, best = _exact(problem, found)
        states = visited.of(best.path)
        if not problem.demands or not _leave_out(problem, found, states, known):
            rows = tuple((level, *state.tolist()) for level, _, state in states)
            hint = _passable(visited, best.values[0])
            if isinstance(best, Within):
                return ScheduleSelection(rows, best.values, best.bounds, hint, best.prices)
            return ScheduleSelection(rows, best.values, best.values, hint)


def _exact(problem: FreeProblem, found: Explorer) -> tuple[Visited, Best | Within]:
    """Return the best path through visited states, values close to its own being exact."""
    while True:
        visited = found.graph()
        if problem.budgets:
            best: Best | Within = within_budgets(visited.graph, problem.budgets)
        else:
            best = lexicographic(visited.graph)
        if not found.refine(best.values):
            return visited, best


def _passable(visited: Visited, value: float) -> tuple[Ints, ...]:
    """Return the states that paths within a value of the first goal can pass, by brick count."""
    graph, states = visited
    kept = graph.amounts[:, 0] <= tied(value) if graph.peaks[0] else None
    inside = reached(graph, kept)
    ends = np.cumsum([len(rows) for _, _, rows in states])
    return tuple(
        rows[inside[end - len(rows) : end]] for end, (_, _, rows) in zip(ends, states, strict=True)
    )


def _leave_out(
    problem: FreeProblem,
    found: Explorer,
    states: list[tuple[int, Key, Ints]],
    known: set[tuple[int, ...]],
) -> bool:
    """Leave out states of a path that do not stand; return whether there were any.

    Those that are known to stand are not asked again; what stands joins them.
    """
    fallen = False
    for level, part, state in states:
        row = (level, *state.tolist())
        if row in known:
            continue
        if problem.stand(level, state[None])[0]:
            known.add(row)
        else:
            found.close((level, part), state[None])
            fallen = True
    return fallen


def _unproven(
    found: ScheduleSelection, wide: Explorer, proven: float, why: str
) -> ScheduleSelection:
    """Return the first plan, and what thresholds and the levels reached prove of the first goal."""
    bound = proven
    if not wide.peaks[0] and wide.level:
        graph, states = wide.graph()
        least = distances(graph, graph.amounts[:, 0])
        count = [len(rows) for level, _, rows in states if level <= wide.level]
        last = [len(rows) for level, _, rows in states if level == wide.level]
        bound = float(least[sum(count) - sum(last) : sum(count)].min(initial=np.inf))
    rest = (-np.inf,) * (len(found.objective) - 1)
    bound = min(bound, found.objective[0])
    return ScheduleSelection(found.states, found.objective, (bound, *rest), stopped=why)


FORMULATION = ScheduleFormulation(
    "schedule_search",
    "threshold and reachability among the states of the free schedule",
    FormulationKind.EXACT,
    solve,
)
