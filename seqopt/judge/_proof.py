"""Lower bounds of all plans: a graph rebuilt by the second book of rules, then arithmetic on it.

Only the states that a better plan could pass are rebuilt. The states that a search visited may be
given, so that many are valued in one batch; those that it left out are found all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph._orders import order_rules, upward
from seqopt.graph.formulation import Solution
from seqopt.graph.graph import Graph, LabelProof
from seqopt.graph.paths import (
    FAILS,
    PASSES,
    _lazy_path,
    cut,
    lexicographic,
    lexicographic_bounds,
    potentials,
    reached,
    tied,
)
from seqopt.graph.states.states import States
from seqopt.judge._bounds import Book, Closed, SumBook, TwinBook, is_beyond, kept_below, limit_below
from seqopt.judge._rule_moves import RuleTables, Transitions
from seqopt.judge._states import Filter, Reachable, StateEvaluator
from seqopt.judge._twin import twin_of
from seqopt.judge.arithmetic import budget_bounds
from seqopt.network.build import build_network
from seqopt.problem.amounts import NONE
from seqopt.problem.resources import StepArrays
from seqopt.scene.scene import Order, in_order
from seqopt.sequence._rule_check import RuleBook
from seqopt.sequence._rule_space import node_numbers

Key = tuple[frozenset[int], int]  # bricks that stand, and the newest
MOST = 5000  # sets of bricks that are looked at
BELOW = 1e-9  # by how much a plan must be better, over the size of the value


class TooManyPartsError(ProblemError):
    """There are more sets of bricks than a proof may visit."""


class OneSchedule:
    """The states of one schedule, a part for every level.

    ``evaluator``: of its states; ``levels``: after the start.
    """

    def __init__(self, problem: States) -> None:
        self.evaluator = StateEvaluator(problem)
        tables = self.evaluator.tables
        self.levels = range(max(1, tables.first), tables.last + 1)

    @property
    def first(self) -> Any:
        """The part in which builds begin."""
        return self.evaluator.tables.first

    def least(self) -> tuple[float, ...]:
        """Return lower bounds of goals that are known before anything is rebuilt."""
        return self.evaluator.least()

    def at(self, part: Any) -> tuple[int, StateEvaluator]:
        """Return the level of a part, and the evaluator of its states."""
        return part, self.evaluator

    def evaluators(self) -> tuple[StateEvaluator, ...]:
        """Return all that evaluated states so far."""
        return (self.evaluator,)

    def to_part(self, part: Any, evaluator: StateEvaluator, states: Ints) -> Ints:
        """Return states that are passed from part to part as rows of one."""
        return states

    def from_part(self, part: Any, states: Ints) -> Ints:
        """Return rows of a part as they are passed on."""
        return states

    def onward(self, part: Any, found: Reachable) -> Iterator[tuple[Any, Transitions]]:
        """Yield the parts of later levels that follow, with the transitions that lead there."""
        yield from ((move.level, move) for move in found.onward if move.level > part)


class AllOrders(OneSchedule):
    """The states of all feasible orders; of a take-down those of the build that it reverses.

    ``evaluator``: of the scene's own order: what all orders have in common.
    """

    def __init__(self, problem: States) -> None:
        self._problem = replace(upward(problem), resources=problem.resources.alone())
        self._rules, scene = order_rules(problem), problem.network.scene
        self.evaluator = StateEvaluator(replace(self._problem, orders=None))
        self._known = dict[Key, StateEvaluator]()
        self.levels = range(max(1, len(self._rules.stands)), len(scene.bricks) + 1)
        self._nodes = {brick.name: brick.nodes for brick in scene.bricks}
        own = (node for name in scene.build_order for node in self._nodes[name])
        self._place = {node: place for place, node in enumerate(own, start=1)}

    @property
    def first(self) -> Key:
        stands = self._rules.stands
        return frozenset(stands), stands[-1] if stands else 0

    def at(self, part: Key) -> tuple[int, StateEvaluator]:
        if part not in self._known:
            if len(self._known) > MOST:  # the start is looked at too
                raise TooManyPartsError(f"more than {MOST} sets of bricks; nothing is proven")
            self._known[part] = StateEvaluator(self._problem.at(self._order(part)))
        return len(part[0]), self._known[part]

    def evaluators(self) -> tuple[StateEvaluator, ...]:
        return self.evaluator, *self._known.values()

    def to_part(self, part: Key, evaluator: StateEvaluator, states: Ints) -> Ints:
        rows = self._renumbered(self._order(part), states, back=True)
        return evaluator.tables.in_order(rows)

    def from_part(self, part: Key, states: Ints) -> Ints:
        return self._renumbered(self._order(part), states)

    def onward(self, part: Key, found: Reachable) -> Iterator[tuple[Key, Transitions]]:
        problem, (stand, _) = self._problem, part
        own = self.from_part(part, found.states)
        for brick in self._rules.next_bricks(stand) if len(own) else ():
            order = self._order(part, brick)
            worlds = tuple(in_order(scene, order) for scene in problem.worlds)
            book = RuleBook(build_network(self._rules.scene, order), problem.free_rules, worlds)
            tables = RuleTables(book, [], parks=problem.parks)
            rows = self._renumbered(order, own, back=True)
            for move in tables.successors(len(stand), rows):
                if move.level > len(stand) and len(move.states):
                    states = self._renumbered(order, move.states)
                    yield (stand | {brick}, brick), move._replace(states=states)

    def _renumbered(self, order: Order, states: Ints, *, back: bool = False) -> Ints:
        """Return states with places in the scene's own order for those in another, or back."""
        place = np.array([0, *(self._place[n] for name in order for n in self._nodes[name])])
        place = np.argsort(place) if back else place
        robots = len(self._problem.free_rules.team(self._rules.scene))
        out = states.copy()
        held = states[:, :robots]  # negative where a free robot was last
        out[:, :robots] = np.sign(held) * place[np.abs(held)]
        return out

    def _order(self, key: Key, following: int | None = None) -> Order:
        """Return an order that begins with a set, its newest brick last, and maybe another one."""
        own, (stand, newest) = self._rules.scene.build_order, key
        first = [name for name in own if name in stand and name != newest]
        last = [newest] if stand else []
        last += [] if following is None else [following]
        return (*first, *last, *(n for n in own if n not in stand and n != following))


Hint = Mapping[int, Ints]  # states that a search visited, by level


class Rebuilt:
    """The states of a space that pass a filter, part by part, and the moves between them.

    ``parts``, ``levels``, ``evaluators``, ``states``: of the part in which builds begin, then of
    all others; of one schedule parts are levels.
    """

    def __init__(self, space: OneSchedule, asked: Filter, hint: Hint | None = None) -> None:
        self._space, self._asked, self._hint = space, asked, hint or {}
        part = space.first
        level, evaluator = space.at(part)
        start = evaluator.tables.start()
        self._peaks = tuple(goal.is_peak for goal in evaluator.problem.goals)
        self.parts, self.states = [part], [start]  # the start needs no test
        self.levels, self.evaluators = [level], [evaluator]
        self._ends, self._count, self._spent = [np.zeros(1, dtype=bool)], 1, np.zeros(1)
        none = np.zeros(0, dtype=np.int64)
        self._moves = [(none, none, np.zeros((0, len(self._peaks))))]
        self._coming: dict[int, dict[Any, list[tuple[Ints, Transitions]]]] = {}
        for own in self._hint:
            self._coming[own] = {own: []}
        onward = [*evaluator.tables.successors(level, start)]
        first = Reachable(none, start, np.zeros(0), onward, self._spent)
        self._go_on(part, level, first, 0)
        for level in space.levels:
            for part, coming in self._coming.pop(level, {}).items():
                self._add(part, coming)

    def _go_on(self, part: Any, level: int, found: Reachable, count: int) -> None:
        """Add the successors of states, whose numbers begin at a count, and within a start."""
        within = [(part, move) for move in found.onward if move.level == level and not count]
        within = [(p, m._replace(states=self._space.from_part(p, m.states))) for p, m in within]
        for to, move in [*within, *self._space.onward(part, found)]:
            arrivals = self._coming.setdefault(move.level, {}).setdefault(to, [])
            arrivals.append((move.source + count, move))

    def _add(self, part: Any, coming: Sequence[tuple[Ints, Transitions]]) -> None:
        """Add the states of a part that are reached, and the moves to them."""
        level, evaluator = self._space.at(part)
        none = evaluator.tables.start()[:0]
        coming = [
            (source, move._replace(states=self._space.to_part(part, evaluator, move.states)))
            for source, move in coming
        ]
        entries = [none, self._hint.get(level, none), *(move.states for _, move in coming)]
        limited = np.isfinite(self._asked.steps)
        far = np.full(len(entries[1]), np.inf if limited else 0.0)
        spent = [far, *(self._spent[source] + limited for source, _ in coming)]
        given = np.concatenate(entries), np.concatenate(spent)
        found = evaluator.reachable(level, *given, self._asked)
        self._spent = np.concatenate([self._spent, found.spent])
        within = [(m.source + self._count, m) for m in found.onward if m.level == level]
        order = np.argsort(found.codes, kind="stable")
        for source, move in [*coming, *within]:
            wanted = evaluator.tables.codes(move.states)
            at = np.searchsorted(found.codes, wanted, sorter=order)
            kept = at < len(order)
            kept[kept] = found.codes[order[at[kept]]] == wanted[kept]
            target, taken = order[at[kept]], move._replace(distance=move.distance[kept])
            amounts = evaluator.amounts(found.values[target], taken)
            self._moves.append((source[kept], self._count + target, amounts))
        self._go_on(part, level, found, self._count)
        self._count += len(found.states)
        self.parts.append(part)
        self.levels.append(level)
        self.evaluators.append(evaluator)
        self.states.append(found.states)
        self._ends.append(evaluator.tables.ends(level, found.states))

    def graph(self) -> Graph:
        """Return them as a graph; the moves are then used up."""
        source, target, amounts = map(np.concatenate, zip(*self._moves, strict=True))
        self._moves.clear()
        rows = source.astype(np.int32), target.astype(np.int32)
        return Graph(*rows, amounts, self._peaks, np.concatenate(self._ends))

    def part_of(self) -> Ints:
        """Return by state the index of its part, (n,)."""
        return np.repeat(np.arange(len(self.states)), [*map(len, self.states)])


class Proof:
    """Lower bounds of all plans of a problem, and whether there is any plan.

    ``hint`` (mapping of int to (n, c) int): states of its one order that are likely to be passed,
    by level, as of `seqopt.sequence._rule_space.FreeSpace`; only time depends on them;
    ``evaluator``: of its states, of all orders in the scene's own; ``states``: how many states a
    better plan could pass. Raises `TooManyPartsError` where there are too many to be looked at.
    """

    def __init__(self, problem: States, hint: Hint | None = None) -> None:
        self._space = OneSchedule(problem) if problem.orders is None else AllOrders(problem)
        self.evaluator = self._space.evaluator
        given = hint if problem.orders is None else None
        self._hint = {} if given is None else as_rows(problem, self.evaluator, given)
        self.states = 0

    @property
    def models(self) -> int:
        """How many models the proof solved."""
        return sum(each.models for each in self._space.evaluators())

    def rebuilt(self, asked: Filter, *, hinted: bool = True) -> Rebuilt:
        """Return the states that pass a filter."""
        return Rebuilt(self._space, asked, self._hint if hinted else None)

    def bounds(self, values: Sequence[float]) -> tuple[float, ...]:
        """Return lexicographic lower bounds of the goals.

        ``values``: of every goal; bounds of margins mean nothing. Infinite where there is no plan.
        """
        least = self._space.least()
        if not self._leaves_room(values, least):
            self.states = 1  # a cut before the end alone
            return least
        found = self._by_cut(values, least)
        if found is not None:
            return found
        bounds = partial(lexicographic_bounds, values=values)
        out = self._where_states_stand(self.rebuilt(Filter(values)), values, bounds)
        if self._leaves_room(values, out):
            exact = self.rebuilt(Filter(values, exact=True))
            out = self._where_states_stand(exact, values, bounds)
        return out

    def bounds_first(self, value: float) -> bool:
        """Return whether a value is a lower bound of the first goal, if that is a worst value."""
        first = self.evaluator.problem.goals[0]
        if not first.is_peak or first.margins:
            return False
        if not self._leaves_room((value,), self._space.least()):
            return True
        return self._reaches_no_end((value,))

    def _by_cut(self, values: Sequence[float], least: Sequence[float]) -> tuple[float, ...] | None:
        """Return the bounds that follow if states strictly below a worst value reach no end.

        Goals after it take no more than every plan does, by what is known of all; or the next one
        counts steps, and only states on paths of fewer steps are looked at, of as many where more
        goals follow. None where that proves too little.
        """
        evaluator = self.evaluator
        goals, closed = evaluator.problem.goals, not self._leaves_room(values[1:], least[1:])
        twin = twin_of(goals[1]) if len(goals) > 1 else None
        counts = twin is not None and twin.to_go is not None and not evaluator.demands(())
        if not goals[0].is_peak or evaluator.margins or not (closed or counts):
            return None
        if not self._reaches_no_end(values):
            return None
        if closed:
            return tuple(values)
        below, steps = self.states, round(values[1]) - (len(values) == 2)
        graph = self.rebuilt(Filter(values, steps=steps)).graph()
        self.states = below + int(reached(graph).sum())
        out = (values[0], *lexicographic_bounds(graph, values)[1:])
        return None if self._leaves_room(values, out) else out

    def _reaches_no_end(self, values: Sequence[float]) -> bool:
        graph = self.rebuilt(Filter(values, strict=True)).graph()
        seen = reached(graph)
        self.states = int(seen.sum())
        return not graph.ends[seen].any()

    def _where_states_stand(
        self,
        rebuilt: Rebuilt,
        values: Sequence[float],
        bounds: Callable[[Graph], tuple[float, ...]],
    ) -> tuple[float, ...]:
        """Return bounds of paths; states of a better one that are proven to fall are left out."""
        graph = rebuilt.graph()
        while True:
            out = bounds(graph)
            better = self._leaves_room(values, out)
            fallen = self._fallen(rebuilt, graph, values) if better else ()
            if not len(fallen):
                self.states = int(reached(graph).sum())
                return out
            graph = graph.only(~np.isin(graph.target, fallen))

    def budget_bounds(
        self,
        values: Sequence[float],
        claimed: Sequence[float],
        multipliers: Sequence[Sequence[float]],
    ) -> tuple[float, ...]:
        """Return Lagrangian bounds of plans within budgets, by multipliers that are claimed."""
        caps, margins = self.evaluator.problem.budgets, values[: self.evaluator.margins]
        stand = margins if self.evaluator.demands(margins) else None
        rebuilt = self.rebuilt(Filter(values, stand, exact=True))
        self.states = sum(map(len, rebuilt.states))
        return budget_bounds(rebuilt.graph(), values, claimed, (caps, multipliers))

    def label_bounds(self, values: Sequence[float], found: Solution) -> tuple[float, ...]:
        """Return bounds of plans with resources, by labels that are claimed."""
        rebuilt = self.rebuilt(Filter(values, exact=True))
        by_labels = label_bounds(self.evaluator, rebuilt, values, found)
        margins = tuple(values[: self.evaluator.margins])
        return self._where_states_stand(rebuilt, values, lambda g: (*margins, *by_labels(g)))

    def is_impossible(self, margins: Sequence[float] = ()) -> bool:
        """Return whether no plan is feasible, or none in which all states have such margins.

        ``margins``: of the first goals; states must stand if that is demanded.
        """
        caps = self.evaluator.problem.budgets
        if self.evaluator.bars(margins):
            self.states = max(self.states, 1)
            return True
        if self.evaluator.demands(margins) and not caps:
            return self._falls_everywhere(margins)
        graph = self.rebuilt(Filter((), margins)).graph()
        self.states = max(self.states, graph.states)
        if not caps:
            return not graph.ends[reached(graph)].any()
        first = len(graph.peaks) - len(caps)
        return is_beyond(graph, [*enumerate(caps, start=first)])

    def _falls_everywhere(self, margins: Sequence[float]) -> bool:
        """Return whether states that are proven to fall, or to lack margins, leave no path.

        Which are asked is of no account: without those that fall, no end may be reached.
        """
        rebuilt = self.rebuilt(Filter(), hinted=False)
        graph, parts = rebuilt.graph(), rebuilt.part_of()
        starts = np.searchsorted(parts, np.arange(len(rebuilt.states)))
        known = np.zeros(graph.states, dtype=np.int64)
        known[0] = PASSES

        def states(part: int, rows: Ints) -> tuple[int, Ints, Sequence[float]]:
            return rebuilt.levels[part], rebuilt.states[part][rows - starts[part]], margins

        def ask(part: int, rows: Ints) -> Ints:
            may = rebuilt.evaluators[part].may_stand(*states(part, rows))
            return np.where(may, PASSES, FAILS)

        def known_before(part: int, rows: Ints) -> Ints:
            return rebuilt.evaluators[part].known_to_stand(*states(part, rows))

        _lazy_path(graph, parts, known, ask, known_before)
        left = reached(graph, (known != FAILS)[graph.target])
        self.states = max(self.states, int(left.sum()))
        return not graph.ends[left].any()

    def _leaves_room(self, values: Sequence[float], bounds: Sequence[float]) -> bool:
        """Return whether bounds leave room for a better plan, in goals that are no margins."""
        room = [not b >= v - BELOW * abs(v) for v, b in zip(values, bounds, strict=False)]
        return any(room[self.evaluator.margins :])

    def _fallen(self, rebuilt: Rebuilt, graph: Graph, values: Sequence[float]) -> Ints:
        """Return the states of the best path that are proven to fall."""
        margins, none = values[: self.evaluator.margins], np.zeros(0, dtype=np.int64)
        if not self.evaluator.demands(margins):
            return none
        try:
            path = np.array(lexicographic(graph).path)
        except InfeasibleError:
            return none
        out, first = [none], 0
        parts = zip(rebuilt.evaluators, rebuilt.levels, rebuilt.states, strict=True)
        for evaluator, level, rows in parts:
            own = path[(path >= first) & (path < first + len(rows))]
            if len(own):
                out.append(own[~evaluator.may_stand(level, rows[own - first], margins)])
            first += len(rows)
        return np.concatenate(out)


def as_rows(problem: States, evaluator: StateEvaluator, hint: Hint) -> dict[int, Ints]:
    """Return states of a search as rows of the tables, by level.

    Raises `SolverError` if a row is no state: it has too few numbers, or names no node.
    """
    tables, columns = evaluator.tables, [r for kind in problem.space.kinds for r in kind.robots]
    order = [columns.index(r) for r in tables.team]
    width, nodes = tables.start().shape[1], len(node_numbers(problem.network))
    out = {}
    for level, rows in hint.items():
        if rows.shape[1] != width or (np.abs(rows[:, : len(order)]) > nodes).any():
            raise SolverError(f"states that were visited with {level} bricks are none")
        own = rows[:, [*order, *range(len(order), width)]].astype(tables.start().dtype)
        out[level] = tables.in_order(own)
    return out


def label_bounds(
    evaluator: StateEvaluator, rebuilt: Any, values: Sequence[float], found: Solution
) -> Callable[[Graph], tuple[float, ...]]:
    """Return lower bounds of the goals after those about margins, by labels, on rebuilt subgraphs.

    ``rebuilt``: states, as of `seqopt.judge._proof.Rebuilt`; ``values``: of all goals; ``found``:
    what is claimed, with labels. The function raises `SolverError` if labels are given that do not
    prove what is claimed.
    """
    rows = _LabeledRows(evaluator, rebuilt, values, found)
    return lambda graph: _GoalProofs(rows, graph, values, found).bounds()


class _LabeledRows:
    """The states that a better build could pass, by number, in the columns of the judge.

    ``level`` (n,); ``rows`` (n, c); ``timed``: the same in time, if that counts.
    """

    def __init__(
        self, evaluator: StateEvaluator, rebuilt: Any, values: Sequence[float], found: Solution
    ) -> None:
        self.evaluator, self._rebuilt = evaluator, rebuilt
        self._margins = values[: evaluator.margins]
        tables, problem = evaluator.tables, evaluator.problem
        self.level = np.array(rebuilt.parts)[rebuilt.part_of()]
        self.rows = np.concatenate([own[:, : tables.robots] for own in rebuilt.states])
        columns = [r for kind in problem.space.kinds for r in kind.robots]
        self._columns = [columns.index(r) for r in tables.team]  # of the search
        clocks = (goal.twin.clocks for goal in problem.goals if goal.in_time)
        self.timed = next((make(evaluator, rebuilt, found.motions) for make in clocks), None)

    def clock(self, graph: Graph, proof: LabelProof, most: float, *, strict: bool) -> Any:
        """Return the book of time, and which moves its arcs are."""
        assert self.timed is not None
        wide = proof.prices.ndim == 2 and proof.prices.shape[1] == 1 + len(self._columns)
        if not wide:
            raise SolverError("there is no multiplier for every robot")
        prices = proof.prices[:, [0, *(1 + c for c in self._columns)]]
        return self.timed.clock(graph, prices, most, strict=strict)

    def twins(self, graph: Graph, move: Ints) -> list[Book]:
        """Return the books of the problem's own resources on some moves of a graph."""
        problem, tables = self.evaluator.problem, self.evaluator.tables
        nodes = np.full((len(self.rows), len(problem.network.scene.robots)), NONE)
        nodes[:, list(tables.team)] = tables.nodes[self.rows.clip(min=0)]
        bricks = np.array([tables.bricks_at(k) if k else 0 for k in range(tables.last + 1)])
        source, target = graph.source[move], graph.target[move]
        steps = StepArrays(bricks[self.level[target]], nodes[source], nodes[target])
        return [TwinBook(each.twin, steps) for each in problem.paths if each.twin is not None]

    def labels(self, proof: LabelProof, width: int) -> tuple[Ints, Floats]:
        """Return labels (N, width) by the numbers of their states, as far as there are such.

        Entries of robots that could change places are sorted, and with them their readiness.
        """
        count, tables = len(self._columns), self.evaluator.tables
        states, values = proof.states, proof.labels
        if len(states) and (states.ndim != 2 or states.shape[1] < 1 + count):
            raise SolverError("labels are none of this build: they have other columns")
        if len(states) != len(values) or values.shape[1:] != (width,):
            return np.zeros(0, dtype=np.int64), np.zeros((0, width))
        order = [0, *(1 + c for c in self._columns)]
        states = states[:, [*order, *range(1 + count, states.shape[1])]]
        if self.timed is not None:
            values = values[:, [*order, *range(1 + count, width)]]
            values = self.timed.in_order(states[:, 1 : 1 + count], values)
        entries = tables.in_order(states[:, 1:].astype(tables.start().dtype))
        none = np.zeros(0, dtype=np.int64)
        numbers, labels = [none], [none]  # where builds begin a state may come twice
        firsts = np.cumsum([0, *map(len, self._rebuilt.states)])
        pairs = zip(self._rebuilt.parts, self._rebuilt.states, firsts[:-1], strict=True)
        for level, rows, first in pairs:
            own = np.flatnonzero(states[:, 0] == level)
            if len(own) and len(rows):
                codes, wanted = tables.codes(rows), tables.codes(entries[own])
                sort = np.argsort(codes)
                at = sort[np.searchsorted(codes, wanted, sorter=sort).clip(max=len(rows) - 1)]
                same = codes[at] == wanted
                numbers.append(first + at[same])
                labels.append(own[same])
        number, label = np.concatenate(numbers), np.concatenate(labels)
        known = np.isfinite(values[label]).all(axis=1)
        return number[known], values[label[known]]

    def fallen(self, states: Ints) -> Bools:
        """Return which states of some numbers are proven to fall; where it begins none is."""
        out = np.zeros(len(states), dtype=bool)
        if not self.evaluator.demands(self._margins):
            return out
        for level in np.unique(self.level[states]).tolist():
            own = np.flatnonzero((self.level[states] == level) & (states > 0))
            out[own] = ~self.evaluator.may_stand(level, self.rows[states[own]], self._margins)
        return out


class _GoalProofs:
    """Bounds on the goals of a build in time, each where those before it are at their values."""

    def __init__(
        self, rows: _LabeledRows, graph: Graph, values: Sequence[float], found: Solution
    ) -> None:
        self._rows, self._graph, self._values, self._found = rows, graph, values, found
        problem = rows.evaluator.problem
        self._aims = len(problem.aims)
        self._is_time = [goal.in_time for goal in problem.goals]
        self._time, self._sums = np.inf, list[tuple[int, float]]()
        for k, cap in zip(range(self._aims, len(values)), problem.budgets, strict=True):
            self._cap(k, tied(cap))
        cures = rows.timed is not None and rows.timed.cures
        self._filtered = not (problem.budgets or cures or problem.paths)

    def _cap(self, k: int, most: float) -> None:
        """Let builds take no more of a goal from now on."""
        if self._is_time[k]:
            self._time = min(self._time, most)
        elif self._graph.peaks[k]:
            self._graph = self._graph.only(self._graph.amounts[:, k] <= most)
        else:
            self._sums.append((k, most))

    def bounds(self) -> tuple[float, ...]:
        """Return lower bounds of the aims after those about margins."""
        proofs, out = iter(self._found.proofs), list[float]()
        for k in range(self._rows.evaluator.margins, self._aims):
            value = self._values[k]
            if self._filtered and not self._is_time[k]:
                proven = cut if self._graph.peaks[k] else potentials
                bound, kept = proven(self._graph, k, value)
                self._graph = self._graph.only(kept)
                out.append(bound)
                continue
            self._filtered = False
            proof = next(proofs, None)
            out.append(-np.inf if proof is None else self._by_labels(k, proof))
            self._cap(k, tied(value))
        return tuple(out)

    def _by_labels(self, k: int, proof: LabelProof) -> float:
        """Return the bound of a goal that labels prove, or multipliers alone."""
        claimed, graph = min(self._found.bound[k], self._values[k]), self._graph
        if not np.isfinite(claimed):
            return -np.inf
        columns = [column for column, _ in self._sums]
        caps = [self._time, *(most for _, most in self._sums)]
        strict = [False] * len(caps)
        if self._is_time[k]:
            caps[0], strict[0] = limit_below(claimed), True
        elif graph.peaks[k]:
            graph = graph.only(kept_below(graph.amounts[:, k], claimed))
        else:
            columns, strict = [*columns, k], [*strict, True]
            caps.append(limit_below(claimed))
        books, move = list[Book](), np.arange(len(graph.source))
        if self._rows.timed is not None:
            clock, move = self._rows.clock(graph, proof, caps[0], strict=strict[0])
            books.append(clock)
        if columns:
            limits = np.array(caps[1:]), np.array(strict[1:])
            books.append(SumBook(graph, move, graph.amounts[:, columns], limits))
        closed = Closed(graph, move, [*books, *self._rows.twins(graph, move)])
        if closed.is_proof(self._rows.labels(proof, closed.width), self._rows.fallen):
            return claimed
        if len(proof.labels):
            goal = self._rows.evaluator.problem.names[k]
            raise SolverError(f"{goal}: labels do not prove that no build is below {claimed:.9g}")
        return min(clock.bound, claimed) if self._is_time[k] else -np.inf
