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
regrips, which keeps the best states of every brick count, gives an incumbent. It is the best if it
takes no more than what all plans have in common: the finished structure at their end, and as many
steps as bricks and robots call for. If not, let its first goal be :math:`z`. The set

.. math::

   R(t) = \{ s : \text{a path from the start to } s \text{ has } v < t \text{ throughout} \}

grows with a rising threshold :math:`t`. While :math:`R(t)` has no end, the least :math:`v` next to
it is a lower bound. Where it has one there is a better incumbent, which a *dive* finds early: it
visits the states of :math:`R(t)` with the most bricks first, few at a time. When :math:`R(z)` has
no end, the states next to it are a cut: :math:`z` is the least worst value, and no response was
computed beyond that cut but for the dives. Later goals need the states that take :math:`z` too;
among these every goal is a shortest path, and what is on none is left out before the next.

Responses have six digits until these do not decide. Where states must stand or be good in
scenarios, which is expensive, a first plan is sought without that, and kept only if it is then the
best; what the best plan of the first scenario takes in all is then where the threshold starts.
Whether states stand is asked only of those on the best path; where one falls, the next best path is
sought without it (Dellin and Srinivasa, A unifying formalism for shortest path problems with
expensive edge evaluations via lazy best-first search over paths with edge selectors, 2016). A
margin of stability comes first: the best one with which states still connect both ends is found by
halving an interval, and all further states must have it.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import groupby
from math import comb
from operator import itemgetter, le

import numpy as np

from formulations.labels import relaxed
from formulations.on_graph import path_of_instance
from formulations.states._search import (
    WIDTH,
    Watching,
    after_margins,
    best_standing,
    best_total,
    narrow,
    plan_by_then,
    shortest,
    watched,
)
from formulations.states._totals import StopError
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError
from seqopt.graph._budgets import is_beyond
from seqopt.graph._explore import Explorer
from seqopt.graph.formulation import Formulation, FormulationKind, Watch
from seqopt.graph.instance import Instance
from seqopt.graph.paths import distances, strictly_below, tied
from seqopt.graph.solution import StatePath
from seqopt.graph.states._visits import FreeStates, floors_of_goals
from seqopt.graph.states.states import States
from seqopt.work.progress import Tell

MANY = 500_000  # grip sets, about: to look at all takes longer than a second narrow search
WIDER = 4  # how many times as wide the second narrow search is
FAR_BELOW = 4.0  # what the narrow search finds, over the first threshold


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
        return path_of_instance(problem, relaxed, Watch(seconds))
    tell = watched(problem, Watch(seconds), max_memory, progress)
    if problem.totals:
        return best_total(problem, shortest, Watch(seconds), tell)
    dear = bool(problem.demands or problem.each) and min(seconds, max_memory) == np.inf
    options = _Options(width, growth, dear)
    return after_margins(problem, lambda rest: _Search(rest, options, tell).run(), tell)


@dataclass(frozen=True)
class _Options:
    """How to search; ``dear``: whether a first plan is worth its time only if it is the best."""

    width: int
    growth: float
    dear: bool


class _Search:
    """A search on its way: the incumbent, the lower bound of the first goal, and what is visited.

    ``cuts``: whether a cut proves the first goal: it is a worst value, and there are no budgets.
    """

    def __init__(self, problem: States, options: _Options, tell: Watching = lambda _: None) -> None:
        self._problem, self._options, self._tell = problem, options, tell
        self._peak = problem.goals[0].is_peak
        self._cuts = self._peak and not problem.budgets
        self._wide = Explorer(FreeStates(problem), tell=tell)
        self.incumbent: StatePath | None = None
        self.bound = -np.inf

    def run(self) -> StatePath:
        """Return the best path, or the incumbent where the search is stopped."""
        problem, floors = self._problem, tuple(map(tied, floors_of_goals(self._problem)))
        self.bound = floors[0]
        try:
            # in a large problem a wider search may spare most of all states
            sets = comb(2 * len(problem.network.inner), problem.space.robots)
            many = sets * problem.space.levels > MANY
            for wider in (1, WIDER):
                if wider > 1 and not many and (self.incumbent or self._options.dear):
                    break  # it is worth its time where the first one found nothing
                plans = [self.incumbent, self._first(floors, wider)]
                found = min(filter(None, plans), key=lambda p: p.objective, default=None)
                self.incumbent = found
                if found and not problem.budgets and all(map(le, found.objective, floors)):
                    return found  # no plan is better
            if found is None and problem.budgets:
                _require_room(problem, self._tell)
            return self.best()
        except (StopError, KeyboardInterrupt) as stop:
            return _unproven(plan_by_then(self.incumbent, stop), self._wide, self.bound)

    def _first(self, floors: tuple[float, ...], wider: int) -> StatePath | None:
        """Return a first plan; where that is expensive, only if it takes no more than floors."""
        problem, width = self._problem, wider * self._options.width
        enough = floors[0] if wider > 1 else -np.inf
        most = floors if self._options.dear else None
        if most and problem.each and not problem.demands:
            found = _in_all(
                problem, narrow(problem.each[0], width, self._tell, most, enough), floors
            )
            if found:
                return found
        return narrow(problem, width, self._tell, most, enough)

    def best(self) -> StatePath:
        """Return the best plan, by a threshold that rises until states below it reach an end."""
        problem, threshold = self._problem, -np.inf
        if self.incumbent or not self._peak:
            threshold = max(self._ceiling / FAR_BELOW, self.bound)
        if problem.each and self._peak:
            threshold = max(_of_one(problem, self._options), self.bound)
        below = self._ceiling if self._cuts else np.inf
        while True:
            if self._cuts and self._dives(threshold, below):
                threshold = below = self._ceiling
                continue
            nothing = None
            if self._wide.rise(threshold, below):
                try:
                    return best_standing(problem, self._wide)
                except NothingFoundError as error:
                    nothing = error
            lower = self._wide.excluded
            if self.incumbent and lower >= strictly_below(below):
                if len(problem.goals) == 1:
                    return replace(self.incumbent, visited=self._wide.visited())
                threshold, below = below, np.inf  # later goals need the states that take as much
                continue
            if lower == np.inf:
                raise nothing or self._wide.without_plan("no plan is allowed")
            # of a state that every plan would have to pass, or a larger
            self.bound = max(self.bound, lower)
            grown = threshold * self._options.growth if np.isfinite(threshold) else -np.inf
            threshold = max(lower, min(self._ceiling, grown))

    @property
    def _ceiling(self) -> float:
        return self.incumbent.objective[0] if self.incumbent else np.inf

    def _dives(self, threshold: float, below: float) -> bool:
        """Return whether a dive finds a better incumbent; what it visits in vain stays visited."""
        if self._wide.passes == 0 or (np.isinf(below) and self.incumbent):
            return False  # what lies below a first threshold is seldom all that a path needs
        trial = self._wide.copy()
        if trial.dive(threshold, below):
            with suppress(InfeasibleError, NothingFoundError):  # of what stands
                self.incumbent = best_standing(self._problem, trial)
                return True
        self._wide = trial
        return False


def _require_room(problem: States, tell: Watching) -> None:
    """Raise an `InfeasibleError` if every plan exceeds a budget, before thresholds are tried."""
    totals = problem.goals[len(problem.aims) :]
    every = Explorer(FreeStates(replace(problem, goals=totals, budgets=())), tell=tell)
    if every.rise() and is_beyond(every.graph().graph, problem.budgets):
        raise InfeasibleError("no plan is within all budgets")


def _of_one(problem: States, options: _Options) -> float:
    """Return what the plan that is best in the first scenario takes in all; at least in that one.

    What is below the former is enough to be looked at, where that plan is allowed in all.
    """
    first = replace(problem.each[0], goals=problem.aims, budgets=())  # budgets are of the scene
    search = _Search(first, options)
    search.incumbent = narrow(first, WIDTH, lambda _: None)
    one = search.best()
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
    objective = tuple(w if goal.is_peak else value for goal, w, value in pairs)
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
    answers=("goals", "tail", "instance"),
    takes_budgets=True,
)
