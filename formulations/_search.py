r"""What formulations of states share: first plans, budgets and scenarios, by any choice.

The path of least worst or tail total over scenarios: weights, then labels that they bound.

A path :math:`p` has a total :math:`c_s(p)` in every scenario, and the aim makes
:math:`\max_{w \in W} \sum_s w_s \, c_s(p)` of them, over weights from 0 up to the largest of one
that add up to one. At fixed weights the cheapest path is what a formulation finds for a single sum,
and a bound on all. What the best weights leave open is closed by labels, vectors of totals
(`seqopt.graph._budgets`): with the least from every state on, under each of some weights, a label
has a bound.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import groupby
from math import comb
from operator import itemgetter, le

import numpy as np

from seqopt.arrays import Ints
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, SeqoptError, TimeUpError
from seqopt.graph._budgets import Within, is_beyond, within_budgets
from seqopt.graph._spaces import best_margin, build_space, floors_of_goals
from seqopt.graph.formulation import Solution, Watch
from seqopt.graph.graph import Best, distances, lexicographic, reached, strictly_below, tied
from seqopt.graph.space import Explorer, Key, Space, Visited
from seqopt.graph.states import States
from seqopt.work import Stage, Tell, _free_memory

WIDTH = 50  # new states of a brick count from which the narrow search goes on
COPIES = 2.0  # of what is kept, that are needed at once while it grows
MANY = 500_000  # grip sets, about: to look at all takes longer than a second narrow search
WIDER = 4  # how many times as wide the second narrow search is
FAR_BELOW = 1.2  # an incumbent over the next target; its square after a dive that succeeds
FARTHEST = 1e3  # the same at most
LARGE = 20_000  # states of a cut from which on any of the best paths is enough, not the first
NARROW = 1.005  # from a target to the incumbent, below which no other target is set
GROWN = 1.1  # times as much is kept before it is asked again how much memory is free

Watching = Callable[[Explorer], None]
Search = Callable[[States], Solution]


def has_scene(problem: object) -> bool:
    """Return whether a problem is of states of a scene; an instance is arrays alone."""
    return isinstance(problem, States)


def watched(problem: States, watch: Watch, progress: Tell) -> Watching:
    """Return a callback of explorers: it reports progress, and enforces time and memory limits.

    ``watch``: whose end raises a `StopError`.
    """
    asked = 0.0

    def tell(found: Explorer) -> None:
        share = found.level / problem.space.levels
        progress(Stage(f"states, pass {found.passes}", share))
        if watch.over:
            raise KeyboardInterrupt if watch.interrupted else StopError("time")
        nonlocal asked
        used = COPIES * (found.nbytes + problem.nbytes)
        if used > watch.memory:
            raise StopError("memory")
        if used > GROWN * asked:
            asked = used
            if used > _free_memory() + found.nbytes:
                raise StopError("memory")

    return tell


def plan_by_then(found: Solution | None, stop: StopError | KeyboardInterrupt) -> Solution:
    """Return the incumbent without a bound; raise an error if there is none yet."""
    if found is None:
        raise _too_little(stop) from None
    none = (-np.inf,) * len(found.objective)
    early = str(stop) or "interrupt"
    return replace(found, bound=none, visited=(), prices=(), stopped=early)


def _too_little(stop: StopError | KeyboardInterrupt) -> SeqoptError | KeyboardInterrupt:
    """Return the error of a search that was stopped before it had an incumbent."""
    if isinstance(stop, KeyboardInterrupt):
        return stop
    if str(stop) == "memory":
        return ProblemError("max_memory: it is too little to find a plan; give more")
    return TimeUpError("no plan was found yet; give more time")


def after_margins(problem: States, search: Search, tell: Watching) -> Solution:
    """Return the plan of a search after the margins of stability, which are optimized first."""
    margins = [goal.margins is not None for goal in problem.goals]
    if sorted(margins, reverse=True) != margins:
        named = ", ".join(map(str, problem.goals))
        raise ProblemError(f"aims {named}: name bond, friction and tilt before all others")
    if not margins[0]:
        return search(problem)
    try:
        value, bound, rest, (order, states) = best_margin(problem, tell)
    except StopError as stop:
        raise _too_little(stop) from None
    if len(problem.goals) == 1:  # nothing else was wished
        return Solution(states, (value,), (bound,), order=order)
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
    *,
    every: bool = False,
) -> Solution | None:
    """Return the best plan through a few states of every brick count, if there is one.

    Stability is required of the states of the best paths first, and of all states only if these
    fall; ``most``: upper limits of the goals, above which there is no plan; ``enough``: as of
    `Explorer`; ``every``: whether all orders are searched, not the scene's own alone.
    """
    for standing in (False, True)[: 1 + bool(problem.demands)]:
        space = build_space(problem, regrips=False, every=every, standing=standing)
        found = Explorer(space, width, tell, enough)
        with suppress(NothingFoundError):
            if found.rise(np.inf if most is None else most[0]):
                visited, best = exact_best(found, problem.budgets)
                if most is not None and not all(map(le, best.values, most)):
                    return None
                if not problem.demands:
                    return selected(space, visited, best)
                return best_standing(found, problem.budgets)
    return None


def best_standing(found: Explorer, budgets: Sequence[float] = ()) -> Solution:
    """Return the best path through visited states that pass the expensive filters."""
    while True:
        visited, best = exact_best(found, budgets)
        if not close_fallen(found, visited, best.path):
            return selected(found.space, visited, best)


def close_fallen(found: Explorer, visited: Visited, path: Sequence[int]) -> bool:
    """Exclude states of a path that fail expensive filters; return whether there are any.

    With each, those of its part that are already proven to fail are excluded.
    """
    fallen, space = False, found.space
    for level, key, state in visited.of(path):
        if not space.stand(key, state[None])[0]:
            fallen = True
            found.close((level, key), state[None])
            for *part, states in visited.states:
                if part == [level, key]:
                    found.close((level, key), states[space.known(key, states) < 0])
    return fallen


def exact_best(
    found: Explorer, budgets: Sequence[float] = (), among: Mapping[Key, Sequence[int]] | None = None
) -> tuple[Visited, Best | Within]:
    """Return the best path through visited states, values close to its own being exact.

    ``among``: as of `Explorer.graph`. Raises `InfeasibleError` if there is none though all states
    were visited; `NothingFoundError` if some were not.
    """
    while True:
        visited = found.graph(among)
        graph = visited.graph
        try:
            best = within_budgets(graph, budgets) if budgets else lexicographic(graph)
        except InfeasibleError as error:
            raise found.without_plan(str(error)) from None
        if not found.refine(best.values, among):
            return visited, best


def selected(space: Space, visited: Visited, best: Best | Within) -> Solution:
    """Return a path as a plan, with the states that a better path could pass as a hint.

    These are left out where an order was sought: rows of other orders mean other things.
    """
    (graph, states), value = visited, best.values[0]
    order, rows = space.path(visited.of(best.path))
    hint = tuple[Ints, ...]()
    if not order:
        kept = graph.amounts[:, 0] <= tied(value) if graph.peaks[0] else None
        parts = np.split(reached(graph, kept), np.cumsum([len(own) for *_, own in states])[:-1])
        hint = tuple(own[inside] for (*_, own), inside in zip(states, parts, strict=True))
    bounds, prices = best.values, tuple[tuple[float, ...], ...]()
    if isinstance(best, Within):
        bounds, prices = best.bounds, best.prices
    path = rows, best.values, bounds, hint, prices
    return Solution(*path, order=order, effort=space.effort)


@dataclass(frozen=True)
class Options:
    """Options of a search; ``expensive``: filters are, so first plans keep to lower bounds."""

    width: int
    growth: float
    expensive: bool


class ThresholdSearch:
    """A search through a space: incumbent, lower bound of the first goal, and visited states.

    ``floors``: lower bounds of all goals that are known before; ``caps``: on the last ones, which
    are budgets; ``growth``: of the threshold from one search to the next. A cut proves the first
    goal where it is a worst value, and there are no budgets.
    """

    def __init__(
        self,
        space: Space,
        tell: Watching = lambda _: None,
        *,
        floors: Sequence[float] = (),
        caps: Sequence[float] = (),
        growth: float = 1.1,
    ) -> None:
        self._caps, self._growth, self._far = caps, growth, FAR_BELOW
        self._peak = space.peaks[0]
        self._cuts = self._peak and not caps
        self.wide = Explorer(space, tell=tell)
        self.incumbent: Solution | None = None
        self.floors = tuple(floors or [-np.inf] * len(space.peaks))
        self.bound = self.floors[0]

    @property
    def is_best(self) -> bool:
        """Whether the incumbent is optimal, as it attains the lower bounds of all goals."""
        found = self.incumbent
        return bool(found and not self._caps and all(map(le, found.objective, self.floors)))

    def misses_floor(self, problem: States) -> bool:
        """Return whether states up to it, which stay visited, prove that every plan exceeds it.

        It is not known where more models would be solved for that than by a wider search.
        """
        floor, trial, most = self.floors[0], self.wide.copy(), (1 + WIDER) * problem.models

        def tell(found: Explorer) -> None:
            self.wide.tell(found)
            if problem.models > most:
                raise _TooManyError

        trial.tell = tell
        try:
            attained = self._cuts and trial.dive(floor) and self._takes(trial)
            if attained or not self._cuts or trial.whole or trial.rise(floor):
                return False  # what takes as much as the floor would stay visited below a later cut
        except _TooManyError:
            return False
        self.wide, trial.tell = trial, self.wide.tell
        return trial.excluded > floor

    def best(self, start: float = -np.inf) -> Solution:
        """Return the best path, by a threshold that rises until states below it reach an end.

        ``start``: a threshold that is known to be low enough for the first search.
        """
        threshold = start
        if self.incumbent or not self._peak:
            threshold = max(start, self._ceiling / FAR_BELOW, self.bound)
        below = self._ceiling if self._cuts else np.inf
        while True:
            if self._cuts and self._dives(threshold, below):
                if self.is_best and self.incumbent:
                    return self.incumbent
                self._far = min(self._far**2, FARTHEST)
                threshold = below = self._target
                continue
            nothing = None
            if self.wide.rise(threshold, below):
                try:
                    return best_standing(self.wide, self._caps)
                except NothingFoundError as error:
                    nothing = error
            lower = self.wide.excluded
            # of a state that every plan would have to pass, or a larger
            self.bound = max(self.bound, min(lower, self._ceiling))
            if self.incumbent and lower >= strictly_below(below):
                if below < self._ceiling:
                    self._far = FAR_BELOW
                    threshold = below = self._target
                    continue
                if all(map(le, self.incumbent.objective[1:], self.floors[1:])):
                    visited, effort = self.wide.visited(), self.wide.space.effort
                    return replace(self.incumbent, visited=visited, effort=effort)
                if self.wide.counts:
                    return self._fewest(self._ceiling)
                threshold, below = below, np.inf  # later goals need the states that take as much
                continue
            if lower == np.inf:
                raise nothing or self.wide.without_plan("no plan is allowed")
            grown = threshold * self._growth if np.isfinite(threshold) else -np.inf
            threshold = max(lower, min(self._ceiling, grown))

    def _fewest(self, value: float) -> Solution:
        """Return the best path of fewest steps at a value of the first goal, which is proven.

        Only states are visited through which a path could take as few steps (A*, level by level);
        of those on paths of the fewest a few where there are many, unless goals follow.
        """
        cut, space = self.wide.visited(), self.wide.space
        self.wide = Explorer(space, tell=self.wide.tell)
        self.wide.threshold = value
        while (most := self.wide.fewest_left) < np.inf:
            every = len(space.peaks) > 2 or sum(map(len, cut)) < LARGE
            for visit in (self.wide.dive, self.wide.rise)[every:]:
                if visit(value, most=most):
                    best = best_standing(self.wide)
                    if best.objective[0] <= tied(value):
                        return replace(best, visited=cut)
        raise self.wide.without_plan("no plan is allowed")

    @property
    def _ceiling(self) -> float:
        return self.incumbent.objective[0] if self.incumbent else np.inf

    @property
    def _target(self) -> float:
        """Upper limit of the next incumbent: halfway to the bound, or any better one near it."""
        middle = (max(self.bound, self._ceiling / self._far) * self._ceiling) ** 0.5
        return middle if middle * NARROW < self._ceiling else self._ceiling

    def _dives(self, threshold: float, below: float) -> bool:
        """Return whether a dive finds a better incumbent; states that it visits stay visited."""
        if self.incumbent is None or np.isinf(below):
            return False  # what lies below a first threshold is seldom all that a path needs
        trial = self.wide.copy()
        if trial.dive(threshold, below) and self._takes(trial):
            return True
        self.wide = trial
        return False

    def _takes(self, trial: Explorer) -> bool:
        """Return whether the way of a dive to its end is a better plan, which is then kept."""
        if rows := trial.way():
            way, best = exact_best(trial, among=rows)
            if best.values[0] < self._ceiling:
                if not close_fallen(trial, way, best.path):
                    self.incumbent = selected(trial.space, way, best)
                    return True
                with suppress(InfeasibleError, NothingFoundError):  # of what stands
                    self.incumbent = best_standing(trial)
                    return True
        return False


def threshold_search(
    problem: States, options: Options, tell: Watching, most: int | None = None
) -> ThresholdSearch:
    """Return the search through the states of a problem; ``most``: as of `build_space`."""
    floors, caps = tuple(map(tied, floors_of_goals(problem))), problem.budgets
    space = build_space(problem, most=most)
    return ThresholdSearch(space, tell, floors=floors, caps=caps, growth=options.growth)


def search_states(problem: States, options: Options, tell: Watching) -> Solution:
    """Return the best plan of a problem, or the incumbent where the search is stopped."""
    search = threshold_search(problem, options, tell)
    try:
        # in a large problem a wider search may spare most of all states
        sets = comb(2 * len(problem.network.inner), problem.space.robots)
        many = sets * problem.space.levels > MANY
        for wider in (1, WIDER):
            if wider > 1 and not many and (search.incumbent or options.expensive):
                break  # it pays where the first one found nothing
            if wider > 1 and search.incumbent and search.misses_floor(problem):
                break
            if search.is_best and search.incumbent:
                return search.incumbent
            plans = [search.incumbent, _first(problem, options, search.floors, wider, tell)]
            search.incumbent = min(filter(None, plans), key=lambda p: p.objective, default=None)
            if search.is_best and search.incumbent:
                return search.incumbent
        if search.incumbent is None and problem.budgets:  # before thresholds are tried
            totals = replace(problem, goals=problem.goals[len(problem.aims) :], budgets=())
            every = Explorer(build_space(totals), tell=tell)
            if every.rise() and is_beyond(every.graph().graph, problem.budgets):
                raise InfeasibleError("no plan is within all budgets")
        return search.best(first_threshold(problem, options))
    except (StopError, KeyboardInterrupt) as stop:
        return unproven(plan_by_then(search.incumbent, stop), search.wide, search.bound)


def _first(
    problem: States, options: Options, floors: Sequence[float], wider: int, tell: Watching
) -> Solution | None:
    """Return a first plan; where that is expensive, only if it attains the lower bounds."""
    width, enough = wider * options.width, floors[0] if wider > 1 else -np.inf
    most = floors if options.expensive else None
    if most and problem.each and not problem.demands:
        found = _in_all(problem, narrow(problem.each[0], width, tell, most, enough), floors)
        if found:
            return found
    return narrow(problem, width, tell, most, enough)


def first_threshold(problem: States, options: Options) -> float:
    """Return the first threshold of the first goal: over scenarios the best plan of the first.

    Its value is an upper bound if it is feasible in all scenarios; else its value in the first one
    is a lower bound. Minus infinity without scenarios, or of a sum.
    """
    if not (problem.each and problem.goals[0].is_peak):
        return -np.inf
    first = replace(problem.each[0], goals=problem.aims, budgets=())  # budgets are of the scene
    search = threshold_search(first, options, lambda _: None)
    search.incumbent = narrow(first, WIDTH, lambda _: None)
    one = search.best()
    inside = _in_all(problem, one, (np.inf,) * len(problem.goals))
    return (inside or one).objective[0]


def _in_all(problem: States, one: Solution | None, most: Sequence[float]) -> Solution | None:
    """Return a plan of one scenario with its values over all; None if it is infeasible in any.

    Also None if a goal is then above ``most``.
    """
    worst, peak = np.full(len(problem.goals), -np.inf), problem.goals[0].is_peak
    own = problem.at(one.order if one else ())
    for level, same in groupby(one.states if one else (), key=itemgetter(0)):
        values, allowed = own.values(level, np.array([state for _, *state in same]), most=most[0])
        worst = np.maximum(worst, values.max(axis=0))
        if not allowed.all() or (peak and worst[0] > most[0]):
            return None
    if one is None:
        return None
    pairs = zip(problem.goals, worst.tolist(), one.objective, strict=False)
    objective = tuple(w if goal.is_peak else value for goal, w, value in pairs)
    inside = all(map(le, objective, most))
    return replace(one, objective=objective, bound=objective) if inside else None


def unproven(found: Solution, wide: Explorer, proven: float) -> Solution:
    """Return the incumbent with the bound of the first goal from thresholds and reached levels."""
    bound = proven
    if not wide.space.peaks[0] and wide.level:
        graph, states = wide.graph()
        least = distances(graph, graph.amounts[:, 0])
        level = np.repeat([level for level, *_ in states], [len(rows) for *_, rows in states])
        bound = float(least[level == wide.level].min(initial=np.inf))
    return replace(found, bound=(min(bound, found.objective[0]), *found.bound[1:]))


class _TooManyError(Exception):
    """More models are solved than a wider search would need."""


class StopError(Exception):
    """The limit of time or of memory, as its text says, is reached."""
