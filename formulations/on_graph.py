"""What formulations of paths share: a graph goes in, a path and its lower bounds come out.

A formulation is a function from a `seqopt.graph.graph.Graph` to a `Choice`: a path and its lower
bounds. The graph is that of the open grips of a schedule, of the states of a
free schedule, of all orders, or of an instance; see `on_graph`. One of your own needs this import
alone:

>>> from formulations.on_graph import (
...     Aim, Choice, FormulationKind, Graph, Watch, on_graph, onward, path_values,
... )
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from formulations._search import (
    WIDTH,
    StopError,
    Watching,
    _too_little,
    after_margins,
    has_scene,
    narrow,
    plan_by_then,
    selected,
    watched,
)
from seqopt.arrays import Floats, Ints, Terse
from seqopt.errors import InfeasibleError, ProblemError, SolverError, TimeUpError
from seqopt.graph._budgets import (
    Joint,
    LabelSearch,
    Plane,
    Polyhedron,
    Sums,
    highest_bound,
    widening,
    within_budgets,
)
from seqopt.graph._spaces import build_space, explore
from seqopt.graph.formulation import Formulation, FormulationKind, Solution, Watch, formulations
from seqopt.graph.graph import (
    TAIL,
    Best,
    Contracted,
    Graph,
    _on_paths,
    _target_sums,
    contracted,
    distances,
    is_path,
    lexicographic,
    moves_along,
    path_values,
    strictly_below,
    tied,
)
from seqopt.graph.space import Explorer, Visited
from seqopt.graph.states import States
from seqopt.problem.problem import WORST_TOTAL, Aim, RobustAim, cvar
from seqopt.work import Tell, _answered

_Cheapest = Callable[[Graph], tuple[tuple[int, ...], float]]
STEPS = 400  # weights that are tried at most
CLOSE = 1e-9  # differences that are none, over the size of the values
LABELS = 16_384  # of a level that are continued at most


class Choice(NamedTuple):
    """A path through a graph, its start left out and empty where none was found in time.

    ``bounds``: lexicographic lower bounds of the first goals, those before each being at their
    values; ``stopped``: whether time was over before all was found; ``prices``: by goal, the
    multipliers of caps and of the sums before it that prove its bound; ``compile_seconds``: what
    writing a program down took.
    """

    path: tuple[int, ...]
    bounds: tuple[float, ...] = ()
    stopped: bool = False
    prices: tuple[tuple[float, ...], ...] = ()
    compile_seconds: float = 0.0


Choose = Callable[..., Choice]
"""Takes a graph whose moves are all on paths from the start to an end, a `Watch` and options."""


def onward(graph: Graph) -> Graph:
    """Return the graph of moves after which fewer moves are left to an end."""
    left = distances(graph, np.ones(len(graph.source)), back=True)
    return graph.only(left[graph.target] < left[graph.source])


def greedy(graph: Graph, charged: Floats) -> tuple[int, ...]:
    """Return the path that always takes the move which is charged least, (m,), the first of ties.

    ``graph``: every move leads on to an end.
    """
    state, path = 0, list[int]()
    while not graph.ends[state]:
        moves = graph.moves_from(state)
        state = int(graph.target[moves][np.argmin(charged[moves])])
        path.append(state)
    return tuple(path)


def at_hand(graph: Graph, *ways: tuple[int, ...]) -> tuple[int, ...]:
    """Return the first path within the caps: of some, what is cheapest now, what is least capped.

    Empty if none of these is within all caps.
    """
    ahead, every = onward(graph), np.ones(graph.states, dtype=bool)
    ways += (greedy(ahead, ahead.amounts[:, 0]),)
    ways += tuple(
        lexicographic(graph.bare(c, every)).path for c in range(graph.goals, len(graph.peaks))
    )
    for path in ways:
        taken = graph.amounts[moves_along(graph, path)][:, graph.goals :].sum(axis=0)
        if (taken <= np.array([tied(cap) for cap in graph.caps])).all():
            return path
    return ()


def shortest(graph: Graph, watch: Watch) -> Choice:
    """Return the path that is best goal after goal; one that is at hand where time is over."""
    if watch.over:
        return Choice(at_hand(graph), stopped=True)
    return Choice(*lexicographic(graph))


def within_caps(graph: Graph, watch: Watch, most: int = 0) -> Choice:
    """Return the best path met within caps, with Lagrangian bounds; exact without caps.

    ``most``: how many labels may be kept to close the gap of a sum.
    """
    if not graph.caps:
        return shortest(graph, watch)
    found = within_budgets(graph, graph.caps, watch, most)
    goals = zip(found.values[: graph.goals], found.bounds, strict=False)
    is_open = any(bound < strictly_below(value) for value, bound in goals)
    stopped = watch.over or (most > 0 and is_open)
    return Choice(found.path, found.bounds[: graph.goals], stopped, found.prices)


def best_total(
    problem: States, choose: Choose, watch: Watch, tell: Watching, width: int | None = None
) -> Solution:
    """Return the plan of least total over scenarios, with its bound and scenario weights.

    ``choose``: paths of least sum; ``width``: how many new states of a brick count are kept; by
    default all, without which no plan is proven to be the least.
    """
    demands = bool(problem.demands)
    space = build_space(problem, regrips=width is None, standing=demands)
    try:
        found = Explorer(space, width, tell)
        if not found.rise():
            if width is not None:
                return best_total(problem, choose, watch, tell)
            raise found.without_plan("no plan is allowed")
        visited = found.graph()
        short = _decisions(problem, visited.graph)
        best = least_total(short.graph, problem.over, cheapest_by(choose, watch), watch)
    except StopError as stop:
        raise _too_little(stop) from None
    plan = selected(space, visited, Best(short.expanded(best.path), (best.value,)))
    prices, bound = (tuple(best.weights.tolist()),), (best.bound,)
    return replace(plan, bound=bound, prices=prices, stopped="time" * watch.over)


def chosen(
    problem: States,
    choose: Choose,
    watch: Watch,
    tell: Watching,
    *,
    alone: bool = False,
    every: bool = False,
) -> Solution:
    """Return the plan of a choice; where time was over, the better one of it and the incumbent.

    ``alone``: whether it is charged as of `Graph.alone`, where grips are open; ``every``: whether
    it chooses among all states, not those alone that are as good as a first plan.
    """
    first = None
    try:
        first = None if every else narrow(problem, WIDTH, tell)
        wide = explore(problem, first.objective[0] if first else np.inf, tell=tell)
        if not wide.whole:
            raise wide.without_plan("no plan is allowed")
        wide.refine()
        graph, states = wide.graph()
        graph = replace(graph, caps=problem.budgets)
        if alone and problem.rules.names_robots() and problem.goals[0].of_criterion:
            own = [problem.candidates.charges(level, rows) for level, _, rows in states]
            graph = replace(graph, alone=np.concatenate(own)[graph.target])
        short = _decisions(problem, graph)
        with _answered(watch.interrupt):
            best = choose(short.graph, watch)
    except (StopError, KeyboardInterrupt) as stop:
        return plan_by_then(first, stop)
    stopped = "interrupt" if watch.interrupted else "time" * best.stopped
    if best.path:
        path = short.expanded(best.path)
        values = path_values(graph, path)
        found = selected(wide.space, Visited(graph, states), Best(path, values))
    if not best.path or (first and best.stopped and first.objective < values):
        found = plan_by_then(first, KeyboardInterrupt() if watch.interrupted else StopError("time"))
    known = (*best.bounds, *[-np.inf] * (graph.goals - len(best.bounds)))
    known = (*known, *found.objective[graph.goals :])
    bound = tuple(map(_without_rounding, found.objective, known))
    return replace(
        found,
        bound=bound,
        stopped=stopped,
        prices=best.prices,
        compile_seconds=best.compile_seconds,
    )


def _decisions(problem: States, graph: Graph) -> Contracted:
    """Return the moves on paths to ends; where grips are open each with the forced ones behind."""
    kept, every = graph.only(_on_paths(graph)), np.arange(graph.states)
    if problem.rules.moves:
        return contracted(kept)
    return Contracted(kept, every, kept.target.astype(np.int64), every)


def cheapest_by(choose: Choose, watch: Watch) -> _Cheapest:
    """Return an oracle of the shortest path and its lower bound."""

    def cheapest(graph: Graph) -> tuple[tuple[int, ...], float]:
        found = choose(graph, watch)
        if not found.path:
            raise StopError("time")
        return found.path, found.bounds[0] if found.bounds else -np.inf

    return cheapest


class LeastTotal(NamedTuple):
    """Incumbent, its value, lower bound and the weights (S,) that prove most of it."""

    path: tuple[int, ...]
    value: float
    bound: float
    weights: Floats


def least_total(graph: Graph, aim: RobustAim, cheapest: _Cheapest, watch: Watch) -> LeastTotal:
    """Return the path of least total.

    ``graph``: with a sum for every scenario, all of it on paths from the start to ends;
    ``cheapest``: an oracle of the shortest path through a graph with one goal, and its bound.
    """
    best = by_weights(graph, aim, cheapest, watch)
    if watch.over or best.bound >= best.value - CLOSE * abs(best.value):
        return best._replace(bound=min(best.bound, best.value))
    growth = Joint(graph, [_Totals(graph, aim, best.weights)])
    known = LabelSearch(None, best.value, best.bound)  # labels close the gap that weights leave
    found = widening(growth, np.zeros(0), known, watch, LABELS)
    path = best.path if found.arcs is None else tuple(graph.target[found.arcs].tolist())
    return LeastTotal(path, found.cost, found.bound, best.weights)


def by_weights(graph: Graph, aim: RobustAim, cheapest: _Cheapest, watch: Watch) -> LeastTotal:
    """Return the best path met on the way to the weights of the highest lower bound."""
    count, best = len(graph.peaks), LeastTotal((), np.inf, -np.inf, np.zeros(0))

    def met(weights: Floats) -> Plane:
        nonlocal best
        sums = (graph.amounts @ weights)[:, None]
        path, bound = cheapest(Graph(graph.source, graph.target, sums, (False,), graph.ends))
        totals = graph.amounts[moves_along(graph, path)].sum(axis=0)
        if aim.value(totals) < best.value:
            best = best._replace(path=path, value=aim.value(totals))
        return Plane(0.0, totals, bound)

    def ended(bound: float) -> bool:
        watch.tell(best.value, bound)
        return watch.over

    region = Polyhedron(aim.most(count), counts=np.ones(count))
    start = np.full(count, 1.0 / count)
    weights, bound = highest_bound(met, start, region, ended, rounds=STEPS, closed=CLOSE)
    return best._replace(bound=bound, weights=weights)


class _Totals(Sums):
    """The totals of all scenarios, bounded by weights (S,), and by single scenarios."""

    def __init__(self, graph: Graph, aim: RobustAim, weights: Floats) -> None:
        scenarios, self._aim = len(weights), aim
        single = np.eye(scenarios if aim.most(scenarios) >= 1 else 0, scenarios)
        self._weights = np.vstack([weights, single])
        left = [distances(graph, graph.amounts @ own, back=True) for own in self._weights]
        super().__init__(graph.amounts, np.array([np.inf]), np.column_stack(left))

    def bounds(self, state: Ints, values: Floats) -> Floats:
        """Return a lower bound of the aim by totals of paths, (N, 1)."""
        weighed = values @ self._weights.T + self._left[state]
        return np.asarray(weighed.max(axis=1, keepdims=True))

    def totals(self, values: Floats) -> Floats:
        """Return the aim of totals, (N, 1)."""
        return self._aim.each(values)[:, None]


def path_of_instance(instance: Any, choose: Choose, watch: Watch) -> Solution:
    """Return the chosen path of an instance; its states are the numbers of nodes.

    ``instance``: has ``asked``, the graph of its goals and caps, and ``goals``.
    """
    graph, goal = instance.asked, instance.goals[0]
    if goal.kind == TAIL:
        aim = WORST_TOTAL  # the tail of which one scenario may have all the weight
        if goal.most < 1.0:
            aim = cvar(max(0.0, 1.0 - 1.0 / (goal.most * len(goal.columns))))
        least = least_total(graph, aim, cheapest_by(choose, watch), watch)
        found = Choice(least.path, (least.bound,), watch.over, (tuple(least.weights.tolist()),))
    else:
        found = choose(graph, watch)
    if not found.path:
        raise TimeUpError("no path was found yet; give more time")
    values = path_values(graph, found.path)[: graph.goals]
    if goal.kind == TAIL:
        values = (_target_sums(goal, np.array(values)),)
    bounds = (*found.bounds, *[-np.inf] * (len(values) - len(found.bounds)))
    states = tuple((node,) for node in found.path)
    early = ("interrupt" if watch.interrupted else "time") * found.stopped
    watch.tell(values[0], min(values[0], bounds[0]))  # the trace ends with what is claimed
    return Solution(
        states,
        values,
        tuple(map(_without_rounding, values, bounds)),
        (),
        found.prices,
        early,
        trace=watch.trace,
        compile_seconds=found.compile_seconds,
    )


def _without_rounding(value: float, bound: float) -> float:
    """Return a lower bound that is no larger than its value by rounding alone."""
    return value if value < bound <= tied(value) else bound


@dataclass(frozen=True, repr=False)
class OnGraph(Terse):
    """The ``solve`` of a formulation that chooses a path through a graph."""

    name: str
    choose: Choose = field(repr=False)
    takes_budgets: bool
    search: Callable[..., Solution] | None = field(default=None, repr=False)
    alone: bool = False

    @property
    def __signature__(self) -> inspect.Signature:
        """The problem, the options of what it chooses by, and its own."""
        problem, *own = [*inspect.signature(type(self).__call__).parameters.values()][1:-1]
        return inspect.Signature([problem, *self._own_options().values(), *own])

    def _own_options(self) -> dict[str, inspect.Parameter]:
        """Return the options of what it chooses by, by name."""
        found = inspect.signature(self.choose).parameters
        return {n: p for n, p in found.items() if p.kind is inspect.Parameter.KEYWORD_ONLY}

    def _checked(self, graph: Graph, watch: Watch, **options: Any) -> Choice:
        """Return the choice, which is one; a path leads along moves from the start to an end."""
        found: object = self.choose(graph, watch, **options)
        if not isinstance(found, Choice):
            kind = type(found).__name__
            raise SolverError(f"formulation {self.name} returned a {kind}, not a Choice")
        if not (found.path or found.stopped or graph.ends[0]):
            raise InfeasibleError("no path leads to an end")
        if found.path and not is_path(graph, found.path):
            raise SolverError(
                f"formulation {self.name}: its path does not lead along moves of the graph from "
                "the start to an end"
            )
        return found

    def __call__(
        self,
        problem: Any,
        *,
        watch: Watch | None = None,
        seconds: float = np.inf,
        max_memory: float = np.inf,
        progress: Tell = lambda _: None,
        **options: Any,
    ) -> Solution:
        """Return the plan of the chosen path, or the incumbent at the limit of time or memory.

        Raises a `ProblemError` if there are budgets that it does not take.
        """
        watch = watch or Watch(seconds)
        watch.memory = min(watch.memory, max_memory)
        choose = partial(self._checked, **options)
        if not has_scene(problem):
            if problem.caps and not self.takes_budgets:
                raise ProblemError(f"formulation {self.name}: it takes no caps; take labels")
            return path_of_instance(problem, choose, watch)
        tell = watched(problem, watch, progress)
        if self.search is not None:
            own = {name: p.default for name, p in self._own_options().items()} | options
            return self.search(problem, watch, tell, **own)
        if problem.budgets and not self.takes_budgets:
            able = [name for name, each in formulations("goals").items() if each.takes_budgets]
            budget = problem.names[len(problem.aims)]
            raise ProblemError(
                f"{self.name}: the budget {budget!r} couples all moves; use {' or '.join(able)}"
            )
        if problem.totals:
            return best_total(problem, choose, watch, tell)

        def search(rest: States) -> Solution:
            return chosen(rest, choose, watch, tell, alone=self.alone)

        return after_margins(problem, search, tell)


__all__ = [
    "Aim",
    "Choice",
    "FormulationKind",
    "Graph",
    "Watch",
    "on_graph",
    "onward",
    "path_values",
]
PATHS = ("goals", "tail", "order", "instance")  # what a path through a graph answers


def on_graph(  # noqa: PLR0913  # the fields of a formulation
    name: str,
    summary: str,
    choose: Choose,
    kind: FormulationKind = FormulationKind.EXACT,
    *,
    aim: Aim | None = None,
    takes_budgets: bool = False,
    windowed: tuple[tuple[str, int | str], ...] | None = None,
    answers: tuple[str, ...] = PATHS,
    alone: bool = False,
    search: Callable[..., Solution] | None = None,
) -> Formulation:
    """Return the formulation that chooses a path through a graph.

    Parameters
    ----------
    name, summary : str
        What it is called, and what it does in a few words.
    choose : callable
        Returns a `Choice` of a `Graph` whose moves are all on paths from the start to an end; stops
        when a `Watch` says so; its options are keyword arguments with defaults. Of states whose
        first goal is a peak, the graph has those below that of a first plan, by a narrow search.
    kind : FormulationKind, optional
        What it promises.
    aim, takes_budgets, windowed, answers, alone : optional
        As of `seqopt.graph.formulation.Formulation`.
    search : callable, optional
        Chooses from states that it explores itself; takes them, a `Watch`, a callback of explorers
        and the same options.

    Returns
    -------
    Formulation
    """
    solve = OnGraph(name, choose, takes_budgets, search, alone)
    return Formulation(name, summary, kind, aim, solve, takes_budgets, windowed, answers, alone)
