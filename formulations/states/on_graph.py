"""What formulations of states share: the graph of states, and plans from its paths.

A formulation over the graph is a function from a `seqopt.graph.Graph` to a `Choice`: a path, and
what no path stays below; see `on_graph`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from heapq import heappop, heappush
from itertools import pairwise
from operator import le
from typing import NamedTuple

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, Ints
from seqopt.errors import InfeasibleError, ProblemError, SeqoptError, TimeUpError
from seqopt.graph.budgets import Within, within_budgets
from seqopt.graph.explore import Explorer, Key, Visited
from seqopt.graph.graph import Graph
from seqopt.graph.orders import AllOrders, OrderSelection, OrderStates, TooManySetsError, Trial
from seqopt.graph.orders import worth as worth_of
from seqopt.graph.paths import Best, distances, lexicographic, reached, tied
from seqopt.graph.states.states import States
from seqopt.graph.states.visits import FreeStates, explore
from seqopt.interrupts import answered
from seqopt.plan.calling.formulation import Formulation, FormulationKind, On, Watch
from seqopt.plan.calling.guard import StatePath
from seqopt.plan.search.sturdiest import best_margin
from seqopt.responses.resources import HERE, Resources
from seqopt.work.progress import Stage, Tell
from seqopt.work.workers import free_memory

WIDTH = 50  # new states of a brick count from which the narrow search goes on
MOST_PARTS = 5000  # sets of bricks with a newest one, of all orders
COPIES = 2.0  # of what is kept, that are needed at once while it grows

_Values = tuple[float, ...]
Watching = Callable[[Explorer], None]
Search = Callable[[States], StatePath]


class Choice(NamedTuple):
    """A path through a graph, and what its formulation claims of it.

    ``path``: its states, the start left out; none where no path was found in time; ``bounds``: what
    no path stays below in the first goals, those before each being at their values; ``stopped``:
    whether time was over before all was found.
    """

    path: tuple[int, ...]
    bounds: tuple[float, ...] = ()
    stopped: bool = False


class StopError(Exception):
    """Time or memory that was given is used up; says which."""


def on_graph(
    name: str,
    summary: str,
    choose: Callable[[Graph, Watch], Choice],
    kind: FormulationKind = FormulationKind.EXACT,
) -> Formulation:
    """Return the formulation of states that chooses a path through the graph of states.

    ``name``, ``summary``: what it is called, and what it does in a few words; ``choose``: returns a
    `Choice` of a graph whose moves are all on paths from the start to an end; stops when a
    `seqopt.plan.calling.formulation.Watch` says so; ``kind``: what it promises. Result: it takes no
    budgets; its options are ``seconds`` and ``max_memory``. If its first goal is a peak, the graph
    has the states below that of a first plan, by a narrow search. Where time or memory ends early,
    that plan is returned.
    """

    def solve(
        problem: States | AllOrders,
        *,
        seconds: float = np.inf,
        max_memory: float = np.inf,
        progress: Tell = lambda _: None,
        resources: Resources = HERE,
    ) -> StatePath | OrderSelection:
        watch, told = Watch(seconds), resources.progress or progress
        if isinstance(problem, AllOrders):
            asked = watched(problem.states, watch, max_memory, told)
            return best_order(problem, choose, watch, asked)
        if problem.budgets:
            raise ProblemError(
                f"formulation {name}: it takes no budgets; take schedule_search or path_beam"
            )
        tell = watched(problem, watch, max_memory, told)
        return after_margins(problem, lambda rest: _chosen(rest, choose, watch, tell), tell)

    return Formulation(name, summary, kind, None, solve, on=On.STATES, also=(On.ORDERS,))


def best_order(
    problem: AllOrders,
    choose: Callable[[Graph, Watch], Choice],
    watch: Watch,
    tell: Watching,
    width: int | None = None,
) -> OrderSelection:
    """Return the order of the path that is chosen through the states of all orders at once.

    ``width``: how many new states of a set of bricks are kept; by default, if the first goal is a
    peak, those below that of the scene's own order.
    """
    space, order = OrderStates(problem, MOST_PARTS), problem.scene.build_order
    found, own = Explorer(space, width, tell), np.inf
    try:
        if width is None and problem.allows(order):
            own = worth_of(problem, Trial(order, np.inf))
        found.rise(own if space.peaks[0] else np.inf)
        if not found.whole:
            raise InfeasibleError("no order of the bricks has a plan")
        found.refine()
        visited = found.graph()
        choice = choose(on_paths(visited.graph), watch)
    except TooManySetsError:
        raise ProblemError(
            f"scene {problem.scene.name}: its orders have more than {MOST_PARTS} sets of bricks; "
            "take order_search, or give an order"
        ) from None
    except StopError as stop:
        raise _too_little(stop) from None
    value, stopped = own, "time" * choice.stopped
    if choice.path and worth(visited.graph, choice.path)[0] < own:
        value = worth(visited.graph, choice.path)[0]
        order = tuple(dict.fromkeys(part[1] for _, part, _ in visited.of(choice.path)))
    if not np.isfinite(value):
        raise TimeUpError("no order with a plan was found yet; give more")
    bound = min(choice.bounds[0] if choice.bounds else -np.inf, value)
    return OrderSelection(order, value, bound, len(space.parts) - 1, stopped)


def _chosen(
    problem: States, choose: Callable[[Graph, Watch], Choice], watch: Watch, tell: Watching
) -> StatePath:
    """Return the plan of a choice; where time was over, the better one of it and a first plan."""
    first = None
    try:
        first = narrow(problem, WIDTH, tell)
        wide = explore(problem, first.objective[0] if first else np.inf, tell=tell)
        if not wide.whole:
            raise InfeasibleError("no plan is allowed")
        wide.refine()
        graph, states = wide.graph()
        with answered(watch.interrupt):
            choice = choose(on_paths(graph), watch)
    except (StopError, KeyboardInterrupt) as stop:
        return plan_by_then(first, stop)
    stopped = ("interrupt" if watch.interrupted else "time") * choice.stopped
    if choice.path:
        values = worth(graph, choice.path)
        found = selection(Visited(graph, states), Best(choice.path, values))
    if not choice.path or (first and choice.stopped and first.objective < values):
        found = plan_by_then(first, KeyboardInterrupt() if watch.interrupted else StopError("time"))
    bounds = (*choice.bounds, *[-np.inf] * len(graph.peaks))
    bound = tuple(map(min, found.objective, bounds))
    return replace(found, bound=bound, stopped=stopped)


def on_paths(graph: Graph) -> Graph:
    """Return the graph with the moves that are on paths from the start to an end."""
    to_end = np.isfinite(distances(graph, np.ones(len(graph.source)), back=True))
    return graph.only(reached(graph)[graph.source] & to_end[graph.target])


def worth(graph: Graph, path: Sequence[int]) -> tuple[float, ...]:
    """Return what every goal takes of a path."""
    moves = [a * graph.states + b for a, b in pairwise((0, *path))]
    kept = np.isin(graph.source.astype(np.int64) * graph.states + graph.target, moves)
    return lexicographic(graph.only(kept)).values


def unit_flow(graph: Graph) -> tuple[sparse.csc_array, Floats]:
    """Return what leaves states (n,) by a flow, and what does: one from the start, at an end.

    Results: ``matrix`` (n, m + e): by move, then by state in which a build may end; ``right`` (n,).
    """
    ends, moves = np.flatnonzero(graph.ends), np.arange(len(graph.source))
    ones = np.ones(len(moves) + len(ends))
    rows = np.concatenate([graph.source, ends, graph.target])
    columns = np.concatenate([np.arange(len(ones)), moves])
    values = np.concatenate([ones, -np.ones(len(moves))])
    matrix = sparse.csc_array((values, (rows, columns)), shape=(graph.states, len(ones)))
    return matrix, np.eye(1, graph.states)[0]


def best_label(graph: Graph, to_go: Floats, watch: Watch) -> Choice:
    """Return the best path by labels: of every state the vectors of goals that none other beats.

    ``to_go`` (n, g): what every goal takes at least from a state to an end, and no move makes less.

    Notes
    -----
    A label says what goals take of a path to its state and at least of all its continuations. The
    least one, goal by goal, is continued first. Labels that one of their state or a path to an end
    is nowhere above are dropped; up to `seqopt.graph.paths.TIED` counts as one.
    """
    starts = np.searchsorted(graph.source, np.arange(graph.states + 1)).tolist()
    targets, amounts = graph.target.tolist(), graph.amounts.tolist()
    ends, ahead, peaks = graph.ends.tolist(), to_go.tolist(), graph.peaks
    least = tuple(ahead[0])
    heap = [(least, 0, (0.0,) * len(peaks), 0, -1)]
    kept: list[list[_Values]] = [[] for _ in ends]
    popped: list[tuple[int, int]] = []  # state, and which label it continues
    best, last = (np.inf,) * len(peaks), -1
    while heap:
        if len(popped) % 1000 == 0 and watch.over:
            return Choice(_back(popped, last), heap[0][0][:1], stopped=True)
        least, _, taken, state, before = heappop(heap)
        if not _improves(least, best) or _beaten(least, kept[state]):
            continue
        kept[state].append(least)
        popped.append((state, before))
        if ends[state]:
            best, last = taken, len(popped) - 1
        for move in range(starts[state], starts[state + 1]):
            to, more = targets[move], _and(peaks, taken, amounts[move])
            bound = _and(peaks, more, ahead[to])
            if _improves(bound, best) and not _beaten(bound, kept[to]):
                heappush(heap, (bound, move, more, to, len(popped) - 1))
    return Choice(_back(popped, last), best)


def _and(peaks: Sequence[bool], first: Sequence[float], then: Sequence[float]) -> _Values:
    """Return what goals take of two parts of a path together."""
    pairs = zip(peaks, first, then, strict=True)
    return tuple([max(a, b) if peak else a + b for peak, a, b in pairs])


def _improves(bound: _Values, best: _Values) -> bool:
    """Return whether values are below the best in a goal, and not above it in those before."""
    for value, least in zip(bound, best, strict=True):
        if tied(value) < least:
            return True
        if value > tied(least):
            return False
    return False


def _beaten(bound: _Values, others: list[_Values]) -> bool:
    """Return whether one of others is nowhere above."""
    return any(all(map(le, other, bound)) for other in others)


def _back(popped: list[tuple[int, int]], last: int) -> tuple[int, ...]:
    """Return the states of a path by where each label comes from, the start left out."""
    path = []
    while last > 0:
        state, last = popped[last]
        path.append(state)
    return tuple(reversed(path))


def watched(problem: States, watch: Watch, most: float, progress: Tell) -> Watching:
    """Return what is told every level: it says how far it is, and ends the search in time."""

    def tell(found: Explorer) -> None:
        share = found.level / problem.space.levels
        progress(Stage(f"states, pass {found.passes}", share))
        if watch.over:
            raise StopError("time")
        room = min(most, free_memory() + found.nbytes)
        if COPIES * (found.nbytes + problem.nbytes) > room:
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
    margins = [goal.of_margins for goal in problem.goals]
    if sorted(margins, reverse=True) != margins:
        named = ", ".join(map(str, problem.goals))
        raise ProblemError(f"aims {named}: name bond, friction and tilt before all others")
    if not margins[0]:
        return search(problem)
    try:
        value, bound, rest = best_margin(problem, tell)
    except StopError as stop:
        raise _too_little(stop) from None
    after = after_margins(rest, search, tell)
    if len(problem.goals) == 1:  # what was chosen after it was nobody's wish
        after = replace(after, objective=(), bound=())
    return replace(after, objective=(value, *after.objective), bound=(bound, *after.bound))


def narrow(
    problem: States,
    width: int,
    tell: Watching,
    most: Sequence[float] | None = None,
    enough: float = -np.inf,
) -> StatePath | None:
    """Return the best plan through a few states of every brick count, if there is one.

    Where states must stand it is asked of all of them only if the best paths fall; and if ``most``
    is given, only where goals take no more than that without it; ``enough``: as of `Explorer`.
    """
    for standing in (False, True)[: 1 + bool(problem.demands)]:
        space = FreeStates(problem, regrips=False, standing=standing)
        found = Explorer(space, width, tell, enough)
        if found.rise():
            if most is not None and not all(map(le, _exact(problem, found)[1].values, most)):
                return None
            try:
                return best_standing(problem, found)
            except InfeasibleError:
                continue
    return None


def best_standing(problem: States, found: Explorer) -> StatePath:
    """Return the best path through visited states that stand as is demanded."""
    known: set[tuple[int, ...]] = set()
    while True:
        visited, best = _exact(problem, found)
        states = visited.of(best.path)
        if not problem.demands or not _leave_out(problem, found, states, known):
            return selection(visited, best)


def _exact(problem: States, found: Explorer) -> tuple[Visited, Best | Within]:
    """Return the best path through visited states, values close to its own being exact."""
    while True:
        visited = found.graph()
        if problem.budgets:
            best: Best | Within = within_budgets(visited.graph, problem.budgets)
        else:
            best = lexicographic(visited.graph)
        if not found.refine(best.values):
            return visited, best


def selection(visited: Visited, best: Best | Within) -> StatePath:
    """Return a path as a plan, and with it the states that a better one could pass."""
    rows = tuple((level, *state.tolist()) for level, _, state in visited.of(best.path))
    hint = _passable(visited, best.values[0])
    if isinstance(best, Within):
        return StatePath(rows, best.values, best.bounds, hint, best.prices)
    return StatePath(rows, best.values, best.values, hint)


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
    problem: States,
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
