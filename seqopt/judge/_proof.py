"""Lower bounds of all plans: a graph rebuilt by the second book of rules, then arithmetic on it.

Only the states that a better plan could pass are rebuilt. The states that a search visited may be
given, so that many are valued in one batch; those that it left out are found all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from seqopt._registry import Later
from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.formulation import LabelProof, Solution
from seqopt.graph.graph import (
    FAILS,
    PASSES,
    PEAK,
    SUM,
    TIME,
    Graph,
    _lazy_path,
    _Target,
    cut,
    lexicographic,
    lexicographic_bounds,
    potentials,
    reached,
)
from seqopt.graph.states import States
from seqopt.judge._rule_moves import RuleTables, Transitions, may_follow
from seqopt.judge._states import Filter, Reachable, StateEvaluator, places
from seqopt.judge.certificate import _twin_of, limit_below
from seqopt.network.network import build_network
from seqopt.problem.amounts import NONE
from seqopt.problem.problem import Orders
from seqopt.problem.requirements import StepArrays
from seqopt.scene.scene import Order, in_order
from seqopt.sequence.rules import _RuleBook

if TYPE_CHECKING:
    from seqopt.judge.arithmetic import Book, Stage

ARITHMETIC = Later("seqopt.judge.arithmetic")  # of budgets and labels
Key = tuple[frozenset[int], int]  # bricks that stand, and the newest
MOST = 5000  # sets of bricks that are looked at


class TooManyPartsError(ProblemError):
    """There are more sets of bricks than a proof may visit."""


class OneSchedule:
    """The states of one schedule, a part for every level.

    ``evaluator``: of its states; ``evaluators``: all that evaluated states so far; ``first``: the
    part in which builds begin; ``levels``: after the start.
    """

    def __init__(self, problem: States) -> None:
        self.evaluator = StateEvaluator(problem)
        self.evaluators, tables = [self.evaluator], self.evaluator.tables
        self.first: Any = tables.first
        self.levels = range(max(1, tables.first), tables.last + 1)

    def at(self, part: Any) -> tuple[int, StateEvaluator]:
        """Return the level of a part, and the evaluator of its states."""
        return part, self.evaluator

    def renumbered(self, part: Any, states: Ints, *, back: bool = False) -> Ints:
        """Return rows of a part as they are passed on from part to part, or back, not in order."""
        return states

    def onward(self, part: Any, found: Reachable) -> Iterator[tuple[Any, Transitions]]:
        """Yield the parts of later levels that follow, with the transitions that lead there."""
        yield from ((move.level, move) for move in found.onward if move.level > part)


class AllOrders(OneSchedule):
    """The states of all feasible orders.

    ``evaluator``: of the scene's own order: what all orders have in common.
    """

    def __init__(self, problem: States) -> None:
        self._problem = replace(problem, resources=problem.resources.alone())
        self._scene = scene = problem.network.scene
        super().__init__(replace(self._problem, orders=None))
        self._known = dict[Key, StateEvaluator]()
        stands = scene.build_order[: problem.free_rules.span(scene)[0]]
        self.first = frozenset(stands), stands[-1] if stands else 0
        self.levels = range(max(1, len(stands)), len(scene.bricks) + 1)
        self._nodes = {brick.name: brick.nodes for brick in scene.bricks}
        own = (node for name in scene.build_order for node in self._nodes[name])
        self._place = {node: place for place, node in enumerate(own, start=1)}

    def at(self, part: Key) -> tuple[int, StateEvaluator]:
        if part not in self._known:
            if len(self._known) > MOST:  # the start is looked at too
                raise TooManyPartsError(f"more than {MOST} sets of bricks; nothing is proven")
            self._known[part] = StateEvaluator(self._problem.at(self._order(part)))
            self.evaluators.append(self._known[part])
        return len(part[0]), self._known[part]

    def renumbered(self, part: Key, states: Ints, *, back: bool = False) -> Ints:
        return self._renumbered(self._order(part), states, back=back)

    def onward(self, part: Key, found: Reachable) -> Iterator[tuple[Key, Transitions]]:
        problem, (stand, _) = self._problem, part
        own, among = self.renumbered(part, found.states), problem.orders or Orders.TIED
        follow = (n for n in self._scene.build_order if may_follow(self._scene, among, stand, n))
        for brick in follow if len(own) else ():
            order = self._order(part, brick)
            worlds = tuple(in_order(scene, order) for scene in problem.worlds)
            book = _RuleBook(build_network(self._scene, order), problem.free_rules, worlds)
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
        robots = len(self._problem.free_rules.team(self._scene))
        out = states.copy()
        held = states[:, :robots]  # negative where a free robot was last
        out[:, :robots] = np.sign(held) * place[np.abs(held)]
        return out

    def _order(self, key: Key, following: int | None = None) -> Order:
        """Return an order that begins with a set, its newest brick last, and maybe another one."""
        own, (stand, newest) = self._scene.build_order, key
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
        onward = [*evaluator.tables.successors(level, start)]
        first = Reachable(none, start, np.zeros(0), onward, self._spent)
        self._go_on(part, level, first, 0)
        for level in space.levels:
            for part, coming in self._coming.pop(level, {}).items():
                self._add(part, coming)

    def _go_on(self, part: Any, level: int, found: Reachable, count: int) -> None:
        """Add the successors of states, whose numbers begin at a count, and within a start."""
        within = [(part, move) for move in found.onward if move.level == level and not count]
        within = [(p, m._replace(states=self._space.renumbered(p, m.states))) for p, m in within]
        for to, move in [*within, *self._space.onward(part, found)]:
            arrivals = self._coming.setdefault(move.level, {}).setdefault(to, [])
            arrivals.append((move.source + count, move))

    def _add(self, part: Any, coming: Sequence[tuple[Ints, Transitions]]) -> None:
        """Add the states of a part that are reached, and the moves to them."""
        level, evaluator = self._space.at(part)
        none = evaluator.tables.start()[:0]
        own = (self._space.renumbered(part, move.states, back=True) for _, move in coming)
        rows = map(evaluator.tables.in_order, own)
        coming = [(s, m._replace(states=own)) for (s, m), own in zip(coming, rows, strict=True)]
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
            at, kept = places(found.codes, evaluator.tables.codes(move.states), order)
            target, taken = at[kept], move._replace(distance=move.distance[kept])
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

    def may_stand(self, states: Ints, margins: Sequence[float]) -> Bools:
        """Return which states, by number, are not proven to fall; where builds begin all stand."""
        firsts, out = np.cumsum([0, *map(len, self.states)]), np.ones(len(states), dtype=bool)
        part = np.searchsorted(firsts, states, side="right") - 1
        for k in np.unique(part[part > 0]).tolist():
            rows = self.states[k][states[part == k] - firsts[k]]
            out[part == k] = self.evaluators[k].may_stand(self.levels[k], rows, margins)
        return out


class Proof:
    """Lower bounds of all plans of a problem, and whether there is any plan.

    ``hint`` (mapping of int to (n, c) int): states of its one order that are likely to be passed,
    by level, as of `seqopt.sequence._space.FreeSpace`; only time depends on them;
    ``evaluator``: of its states, of all orders in the scene's own; ``states``: how many states a
    better plan could pass. Raises `TooManyPartsError` where there are too many to be looked at.
    """

    def __init__(self, problem: States, hint: Hint | None = None) -> None:
        self._space = OneSchedule(problem) if problem.orders is None else AllOrders(problem)
        self.evaluator, self.states = self._space.evaluator, 0
        given = (hint or {}) if problem.orders is None else {}
        self._hint = as_rows(problem, self.evaluator, given)

    @property
    def models(self) -> int:
        """How many models the proof solved."""
        return sum(each.models for each in self._space.evaluators)

    def rebuilt(self, asked: Filter) -> Rebuilt:
        """Return the states that pass a filter."""
        return Rebuilt(self._space, asked, self._hint)

    def bounds(self, values: Sequence[float]) -> tuple[float, ...]:
        """Return lexicographic lower bounds of the goals.

        ``values``: of every goal; bounds of margins mean nothing. Infinite where there is no plan.
        """
        least = self.evaluator.least()
        if not self._leaves_room(values, least):
            self.states = 1  # a cut before the end alone
            return least
        found = self._by_cut(values, least)
        if found is not None:
            return found
        bounds = partial(lexicographic_bounds, values=values)
        return self._where_states_stand(self.rebuilt(Filter(values)), values, bounds)

    def bounds_first(self, value: float) -> bool:
        """Return whether a value is a lower bound of the first goal, if that is a worst value."""
        first = self.evaluator.problem.goals[0]
        if not first.is_peak or first.margins:
            return False
        if not self._leaves_room((value,), self.evaluator.least()):
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
        twin = _twin_of(goals[1]) if len(goals) > 1 else None
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
        bounds = lexicographic_bounds(graph, values)[1:]  # infinite: no path has fewer steps
        out = (values[0], *map(min, bounds, values[1:]))
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
        graph, margins = rebuilt.graph(), values[: self.evaluator.margins]
        demanded = bool(self.evaluator.demands(margins))
        while True:
            out, fallen = bounds(graph), np.zeros(0, dtype=np.int64)
            if demanded and self._leaves_room(values, out):
                with suppress(InfeasibleError):
                    path = np.array(lexicographic(graph).path, dtype=np.int64)
                    fallen = path[~rebuilt.may_stand(path, margins)]
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
        rebuilt = self.rebuilt(Filter(values, stand))
        self.states = sum(map(len, rebuilt.states))
        asked = rebuilt.graph(), values, claimed, (caps, multipliers)
        out: tuple[float, ...] = ARITHMETIC.budget_bounds(*asked)
        return out

    def label_bounds(self, values: Sequence[float], found: Solution) -> tuple[float, ...]:
        """Return bounds of plans with resources, by labels that are claimed.

        Raises `SolverError` if labels are given that do not prove what is claimed.
        """
        rebuilt = self.rebuilt(Filter(values))
        by_labels = _LabelBounds(self.evaluator, rebuilt, values, found)
        return self._where_states_stand(rebuilt, values, by_labels.bounds)

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
        return bool(ARITHMETIC.is_beyond(graph, [*enumerate(caps, start=first)]))

    def _falls_everywhere(self, margins: Sequence[float]) -> bool:
        """Return whether states that are proven to fall, or to lack margins, leave no path.

        Which are asked is of no account: without those that fall, no end may be reached.
        """
        rebuilt = Rebuilt(self._space, Filter())
        graph = rebuilt.graph()
        known = np.zeros(graph.states, dtype=np.int64)
        known[0] = PASSES

        def ask(_: int, states: Ints) -> Ints:
            return np.where(rebuilt.may_stand(states, margins), PASSES, FAILS)

        _lazy_path(graph, rebuilt.part_of(), known, ask, lambda _, states: known[states])
        left = reached(graph, (known != FAILS)[graph.target])
        self.states = max(self.states, int(left.sum()))
        return not graph.ends[left].any()

    def _leaves_room(self, values: Sequence[float], bounds: Sequence[float]) -> bool:
        """Return whether bounds leave room for a better plan, in goals that are no margins."""
        room = [not b >= limit_below(v) for v, b in zip(values, bounds, strict=False)]
        return any(room[self.evaluator.margins :])


def _own_columns(problem: States, evaluator: StateEvaluator) -> list[int]:
    """Return the columns that a search has for the robots of the judge's tables."""
    columns = [robot for kind in problem.space.kinds for robot in kind.robots]
    return [columns.index(robot) for robot in evaluator.tables.team]


def as_rows(problem: States, evaluator: StateEvaluator, hint: Hint) -> dict[int, Ints]:
    """Return states of a search as rows of the tables, by level.

    Raises `SolverError` if a row is no state: it has too few numbers, or names no node.
    """
    tables, order = evaluator.tables, _own_columns(problem, evaluator)
    width, nodes = tables.start().shape[1], len(problem.network.scene.placed_nodes)
    out = {}
    for level, rows in hint.items():
        if rows.shape[1] != width or (np.abs(rows[:, : len(order)]) > nodes).any():
            raise SolverError(f"states that were visited with {level} bricks are none")
        own = rows[:, [*order, *range(len(order), width)]].astype(tables.start().dtype)
        out[level] = tables.in_order(own)
    return out


class _LabelBounds:
    """Bounds on the goals of a build by labels, each where those before it are at their values.

    The states that a better build could pass are those rebuilt, in the columns of the judge.
    """

    def __init__(
        self, evaluator: StateEvaluator, rebuilt: Rebuilt, values: Sequence[float], found: Solution
    ) -> None:
        self._evaluator, self._rebuilt = evaluator, rebuilt
        self._values, self._found = values, found
        self._columns = _own_columns(evaluator.problem, evaluator)
        clocks = (goal.twin.clocks for goal in evaluator.problem.goals if goal.in_time)
        self._timed = next((make(evaluator, rebuilt, found.motions) for make in clocks), None)

    def bounds(self, graph: Graph) -> tuple[float, ...]:
        """Return lower bounds of the aims in a subgraph; those about margins are their values."""
        problem, values = self._evaluator.problem, self._values
        kinds = [TIME if g.in_time else PEAK if g.is_peak else SUM for g in problem.goals]
        goals = [_Target(problem.names[k], kind, (k,)) for k, kind in enumerate(kinds)]
        aims, stage = len(problem.aims), ARITHMETIC.Stage(graph)
        for goal, cap in zip(goals[aims:], problem.budgets, strict=True):
            stage = stage.after(goal, cap)
        cures = self._timed is not None and self._timed.cures
        plain, proofs = not (problem.budgets or cures or problem.paths), iter(self._found.proofs)
        out = [*values[: self._evaluator.margins]]
        for goal, value in zip(goals[len(out) : aims], values[len(out) :], strict=False):
            plain &= goal.kind != TIME
            if plain:  # potentials and cuts do without labels
                proven = cut if goal.kind == PEAK else potentials
                bound, kept = proven(stage.graph, goal.columns[0], value)
                stage = stage._replace(graph=stage.graph.only(kept))
            else:
                proof = next(proofs, None)
                bound = -np.inf if proof is None else self._by_labels(stage, goal, proof)
                stage = stage.after(goal, value)
            out.append(bound)
        return tuple(out)

    def _by_labels(self, stage: Stage, goal: _Target, proof: LabelProof) -> float:
        """Return the bound of a goal that labels prove, or multipliers alone."""
        k, of_time = goal.columns[0], goal.kind == TIME
        claimed = min(self._found.bound[k], self._values[k])
        if not np.isfinite(claimed):
            return -np.inf
        below = stage.below(goal, claimed)
        graph, least, books = below.graph, -np.inf, []
        move = np.arange(len(graph.source))
        if self._timed is not None:
            if proof.prices.ndim != 2 or proof.prices.shape[1] != 1 + len(self._columns):
                raise SolverError("there is no multiplier for every robot")
            prices = proof.prices[:, [0, *(1 + c for c in self._columns)]]
            most = limit_below(claimed) if of_time else stage.time
            clock, move = self._timed.clock(graph, prices, most, strict=of_time)
            books, least = [clock], min(clock.bound, claimed) if of_time else least
        books += below.books(goal, claimed, move)
        closed = ARITHMETIC.Closed(graph, move, [*books, *self._twins(graph, move)])
        margins = self._values[: self._evaluator.margins]

        def fallen(states: Ints) -> Bools:
            return ~self._rebuilt.may_stand(states, margins)

        if closed.is_proof(self._labels(proof, closed.width), fallen):
            return claimed
        if len(proof.labels):
            raise SolverError(
                f"{goal.name}: labels do not prove that no build is below {claimed:.9g}"
            )
        return least

    def _twins(self, graph: Graph, move: Ints) -> list[Book]:
        """Return the books of the problem's own resources on some moves of a graph."""
        problem, tables = self._evaluator.problem, self._evaluator.tables
        rows = np.concatenate([own[:, : tables.robots] for own in self._rebuilt.states])
        nodes = np.full((len(rows), len(problem.network.scene.robots)), NONE)
        nodes[:, list(tables.team)] = tables.nodes[rows.clip(min=0)]
        bricks = np.array([tables.bricks_at(k) if k else 0 for k in self._rebuilt.levels])
        source, target = graph.source[move], graph.target[move]
        stands = bricks[self._rebuilt.part_of()[target]]
        steps = StepArrays(stands, nodes[source], nodes[target])
        twins = (each.twin for each in problem.paths if each.twin is not None)
        return [ARITHMETIC.TwinBook(twin, steps) for twin in twins]

    def _labels(self, proof: LabelProof, width: int) -> tuple[Ints, Floats]:
        """Return labels (N, width) by the numbers of their states, as far as there are such.

        Entries of robots that could change places are sorted, and with them their readiness.
        """
        count, tables = len(self._columns), self._evaluator.tables
        states, values = proof.states, proof.labels
        if len(states) and (states.ndim != 2 or states.shape[1] < 1 + count):
            raise SolverError("labels are none of this build: they have other columns")
        none = np.zeros(0, dtype=np.int64)
        if len(states) != len(values) or values.shape[1:] != (width,):
            return none, np.zeros((0, width))
        order = [0, *(1 + c for c in self._columns)]
        states = states[:, [*order, *range(1 + count, states.shape[1])]]
        if self._timed is not None:
            values = values[:, [*order, *range(1 + count, width)]]
            values = self._timed.in_order(states[:, 1 : 1 + count], values)
        entries = tables.in_order(states[:, 1:].astype(tables.start().dtype))
        numbers, labels, first = [none], [none], 0  # where builds begin a state may come twice
        for level, rows in zip(self._rebuilt.levels, self._rebuilt.states, strict=True):
            own = np.flatnonzero(states[:, 0] == level)
            at, same = places(tables.codes(rows), tables.codes(entries[own]))
            numbers.append(first + at[same])
            labels.append(own[same])
            first += len(rows)
        number, label = np.concatenate(numbers), np.concatenate(labels)
        known = np.isfinite(values[label]).all(axis=1)
        return number[known], values[label[known]]
