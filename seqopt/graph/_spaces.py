"""The spaces of problems: of a schedule, of rules, of all orders; and what all plans share.

The best margin of stability with which a plan exists is found by bisection.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import pi
from typing import Any

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.mortar import ROUGHEST
from seqopt.engines.registry import recipe_of
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph._budgets import within_budgets
from seqopt.graph.graph import FAILS, PASSES, _lazy_path
from seqopt.graph.space import Explorer, Found, Moves, Space
from seqopt.graph.states import States
from seqopt.problem.amounts import STEPS, Amount, MoveArrays
from seqopt.problem.problem import Orders
from seqopt.scene.scene import Order, Scene
from seqopt.sequence import _space as free_space
from seqopt.sequence._space import FreeSpace, ScheduleSpace, sort_entries
from seqopt.sequence.steps import Step, _begin_step, check_sequence
from seqopt.stability.standing import Standing, slack


@dataclass(frozen=True)
class _PosedSpace(Space):
    """States of a problem; moves take whether they are regrips, and how far robots go, m.

    Where totals over scenarios count, a column for every scenario stands in the place of the goal.
    ``regrips``: whether robots may take grips on bricks that stand; ``standing``: whether it is
    asked of every state that it stands, and by which margins.
    """

    problem: States
    regrips: bool = True
    standing: bool = False

    @abstractmethod
    def at(self, part: Any) -> tuple[int, States]:
        """Return the level of a part, and the problem that its states are of."""

    @property
    def peaks(self) -> tuple[bool, ...]:
        if self.problem.totals:
            return (False,) * len(self.problem.each)
        return tuple(goal.is_peak for goal in self.problem.goals)

    @property
    def floors(self) -> bool:
        """Whether values may be lower bounds, from some of the scenarios."""
        return bool(self.problem.each) and not self.problem.totals

    def codes(self, part: Any, states: Ints) -> Ints:
        return self.at(part)[1].space.codes(states)

    def within(self, part: Any, states: Ints) -> Moves:
        level, own = self.at(part)
        return _joined(own.space.within(level, states, regrips=self.regrips), states)

    def values(
        self, part: Any, states: Ints, *, rough: bool, most: float = np.inf
    ) -> tuple[Floats, Bools]:
        level, own = self.at(part)
        if not own.totals:
            if self.standing:
                return own.standing_values(level, states, most=most)
            return own.values(level, states, rough=rough, most=most)
        out, rows = np.full((len(states), len(self.peaks)), np.inf), np.arange(len(states))
        for k, one in enumerate(own.each):  # a column each; no more is asked of what one excludes
            asked = one.standing_values if self.standing else one.values
            found, allowed = asked(level, states[rows])
            out[rows, k] = found[:, 0]
            rows = rows[allowed]
        return out, np.isin(np.arange(len(states)), rows)

    def amounts(self, values: Floats, taken: Floats) -> Floats:
        if self.problem.totals:
            return values
        out, moves = values.copy(), MoveArrays(*taken.T)
        for k, goal in enumerate(self.problem.goals):
            if goal.moves is not None:
                out[:, k] = goal.value(moves)
        return out

    def to_go(self, part: Any, states: Ints) -> Floats | None:
        level, own = self.at(part)
        if own.goals[1:2] != (STEPS,) or own.demands or own.budgets:
            return None
        return own.space.steps_to_go(level, states)

    def ended(self, part: Any, states: Ints) -> Bools:
        return self.at(part)[1].space.ended(states)

    def stand(self, part: Any, states: Ints) -> Bools:
        level, own = self.at(part)
        asked = own.demands and not self.standing
        return own.stand(level, states) if asked else super().stand(part, states)

    def known(self, part: Any, states: Ints) -> Ints:
        level, own = self.at(part)
        return own.recalled(level, states)


@dataclass(frozen=True)
class StateSpace(_PosedSpace):
    """The states of one schedule, a part for every level: by its open grips, or by rules.

    ``order``: of its bricks, if that was sought.
    """

    order: Order = ()

    def at(self, part: int) -> tuple[int, States]:
        return part, self.problem

    @property
    def levels(self) -> int:
        return self.problem.space.levels

    @property
    def first(self) -> int:
        return self.problem.space.first

    def start(self) -> tuple[int, Ints]:
        return self.first, self.problem.space.start()

    def onward(self, part: int, states: Ints) -> Iterator[tuple[int, Moves]]:
        space = self.problem.space
        rows = np.flatnonzero(space.may_place(part, states))
        moves = _joined(space.onward(part, states[rows]), states[rows])
        yield part + 1, moves._replace(source=rows[moves.source])

    @property
    def complete(self) -> bool:
        return self.regrips and not self.order

    def demanding(self, part: int, asked: States) -> States:
        """Return the given problem, of which the states of a part are."""
        return asked

    def path(self, found: Found) -> tuple[Order, tuple[tuple[int, ...], ...]]:
        return self.order, super().path(found)[1]

    @property
    def effort(self) -> tuple[int, int]:
        return (1, self.problem.models) if self.order else (0, 0)

    def rows(self, part: int, states: Ints) -> Ints:
        """Return labels of states: the level, and the node that each robot holds, 0: none."""
        numbers = np.array([0, *self.problem.network.scene.placed_nodes])
        held = states[:, : self.problem.space.robots].astype(np.int64)
        named = np.where(held > 0, numbers[held.clip(min=0)], 0)
        return np.column_stack([np.full(len(held), part), named])


def _joined(found: Sequence[tuple[free_space.Moves, bool]], states: Ints) -> Moves:
    """Return moves together, with whether they are regrips and how far robots go."""
    parts = [Moves(np.zeros(0, dtype=np.int64), states[:0], np.zeros((0, 2)))]
    for moves, regrip in found:
        taken = np.column_stack([np.full(len(moves.way), float(regrip)), moves.way])
        parts.append(Moves(moves.source, moves.states, taken))
    return Moves(*map(np.concatenate, zip(*parts, strict=True)))


MOST_PARTS = 5000  # sets of bricks with a newest one, where all are looked at


def among_orders(problem: States, among: Orders | str) -> States:
    """Return the problem over feasible build orders too; values keep the scales of the scene's.

    Raises `ProblemError` if there are no such orders, what is asked depends on the scene's own, or
    its engine was not made by name.
    """
    found = replace(problem, orders=Orders.of(among))
    scene, rules = found.network.scene, found.free_rules
    if rules.takes_down:
        raise ProblemError("orders of a take-down are not searched; give an order")
    last = rules.span(scene)[1]
    if last < len(scene.bricks):
        raise ProblemError(
            f"orders to {last} of {len(scene.bricks)} bricks: which of them is not said; "
            "give an order, or go on to the last brick"
        )
    if recipe_of(found.engine) is None:
        raise ProblemError(
            f"engine {type(found.engine).__name__}: orders need engines of their own; "
            "take one of seqopt.make_engine"
        )
    return found


@dataclass(frozen=True)
class OrderRules:
    """Which orders of a scene's bricks are feasible.

    ``stands``: names of the bricks with which all builds begin.
    """

    scene: Scene
    among: Orders
    stands: Order

    @cached_property
    def ties(self) -> dict[int, frozenset[int]]:
        """By brick, those that a joint ties to it; zero joints tie nothing."""
        out: dict[int, set[int]] = {name: set() for name in self.scene.build_order}
        for joint in self.scene.joints:
            if any((*joint.translational_stiffness, *joint.rotational_stiffness)):
                first, second = joint.bricks
                out[first].add(second)
                out[second].add(first)
        return {name: frozenset(others) for name, others in out.items()}

    def next_bricks(self, placed: frozenset[int]) -> tuple[int, ...]:
        """Return the bricks that may be placed next; ``placed``: names of those that stand."""
        left = [name for name in self.scene.build_order if name not in placed]
        if self.among is Orders.ANY:
            return tuple(left)
        grounds = self.scene.grounds
        founded = {g.brick for g in grounds if g.closes_with in {None, *placed, g.brick}}
        return tuple(b for b in left if self.ties[b] & placed or b in founded)

    def allows(self, order: Sequence[int]) -> bool:
        """Return whether an order, names of all bricks, is feasible."""
        first = len(self.stands)
        pairs = [*enumerate(order)][first:]
        follow = all(b in self.next_bricks(frozenset(order[:k])) for k, b in pairs)
        return follow and {*order[:first]} == {*self.stands}


def order_rules(problem: States) -> OrderRules:
    """Return the rules of feasible orders of a problem."""
    scene = problem.network.scene
    first = problem.free_rules.span(scene)[0]
    return OrderRules(scene, Orders.of(problem.orders or Orders.TIED), scene.build_order[:first])


class TooManySetsError(ProblemError):
    """There are more sets of bricks than the search may visit."""


Part = tuple[frozenset[int], int]  # bricks that stand, and the newest


@dataclass(frozen=True)
class OrderSpace(_PosedSpace):
    """The states of all orders, a part for every set of standing bricks and newest brick.

    Neither responses nor moves depend on how the others were placed. ``most``: how many parts there
    may be; ``parts``: those that were looked at, each in an order that begins with its set.
    """

    most: int = MOST_PARTS
    parts: dict[Part, States] = field(default_factory=dict)

    @cached_property
    def _here(self) -> States:
        return replace(self.problem, resources=self.problem.resources.alone())

    @cached_property
    def _rules(self) -> OrderRules:
        return order_rules(self.problem)

    def at(self, part: Part) -> tuple[int, States]:
        """Return the states of an order that begins with a set, its newest brick last."""
        if part not in self.parts:
            if len(self.parts) > self.most:
                raise TooManySetsError(
                    f"scene {self._rules.scene.name}: its orders have more than {self.most} sets "
                    "of bricks; give an order, or ask for the worst step alone"
                )
            own = self._rules.scene.build_order
            first = [name for name in own if name in part[0] and name != part[1]]
            stand = [name for name in self._rules.stands if name in first]
            newest = (part[1],) if part[0] else ()
            order = tuple(dict.fromkeys((*stand, *first, *newest, *own)))
            self.parts[part] = self._here.at(order)
        return len(part[0]), self.parts[part]

    @property
    def first(self) -> int:
        return len(self._rules.stands)

    @property
    def levels(self) -> int:
        return len(self._rules.scene.bricks)

    def start(self) -> tuple[Part, Ints]:
        stands = self._rules.stands
        part = (frozenset(stands), stands[-1] if stands else 0)
        return part, self.at(part)[1].space.start()

    def onward(self, part: Part, states: Ints) -> Iterator[tuple[Part, Moves]]:
        level, old = self.at(part)
        rows = np.flatnonzero(old.space.may_place(level, states))
        for brick in self._rules.next_bricks(part[0]):
            to = (part[0] | {brick}, brick)
            _, new = self.at(to)
            own = _renumbered(old, new, states[rows])
            moves = _joined(new.space.onward(level, own), own)
            yield to, moves._replace(source=rows[moves.source])

    @property
    def complete(self) -> bool:
        return self.regrips

    def demanding(self, part: Part, asked: States) -> States:
        """Return the states of a part with the demands of a problem."""
        _, own = self.at(part)
        found = replace(own, standing=asked.standing, settled=asked.settled)
        found.share_proofs(own)
        return found

    def path(self, found: Found) -> tuple[Order, tuple[tuple[int, ...], ...]]:
        newest = (part[1] for _, part, _ in found)
        order = tuple(dict.fromkeys((*self._rules.stands, *newest)))
        new, steps = self._here.at(order), list[tuple[int, ...]]()
        for level, part, state in found:
            row = _renumbered(self.at(part)[1], new, state[None])[0]
            steps.append((level, *row.tolist()))
        return order, tuple(steps)

    @property
    def effort(self) -> tuple[int, int]:
        return len(self.parts) - 1, sum(own.models for own in self.parts.values())

    def rows(self, part: Part, states: Ints) -> Ints:
        """Return labels of states: the level, the newest brick, and the place of each grip."""
        held = states[:, : self._here.space.robots].astype(np.int64)
        own = np.array([[len(part[0]), part[1]]])
        return np.column_stack([np.repeat(own, len(held), axis=0), held])


def _renumbered(old: States, new: States, states: Ints) -> Ints:
    """Return states with the places that nodes have in another order."""
    place = {node: i for i, node in enumerate(new.network.scene.placed_nodes, start=1)}
    map_to = np.array([0, *(place[node] for node in old.network.scene.placed_nodes)])
    out, robots = states.copy(), old.space.robots
    nodes = states[:, :robots]  # negative where a free robot was last
    out[:, :robots] = np.sign(nodes) * map_to[np.abs(nodes)]
    for first, end in new.space.slots:
        sort_entries(out, first, end)
    return out


def build_space(
    problem: States,
    *,
    regrips: bool = True,
    every: bool = True,
    standing: bool = False,
    most: int | None = None,
) -> StateSpace | OrderSpace:
    """Return the states and moves of a problem: of its schedule, or of all orders of its bricks.

    ``regrips``, ``standing``: as of `StateSpace`; ``every``: whether all orders that are sought are
    looked at, or the scene's own alone, if it is one of them; ``most``: as of `OrderSpace`.
    """
    if problem.orders is None:
        return StateSpace(problem, regrips, standing)
    own = problem.network.scene.build_order
    if not every and order_rules(problem).allows(own):
        return StateSpace(problem.at(own), regrips, standing, order=own)
    return OrderSpace(problem, regrips, standing, most=MOST_PARTS if most is None else most)


def floors_of_goals(problem: States) -> tuple[float, ...]:
    """Return lower bounds of goals that are known before the search.

    No worst step is better than the end that all builds have in common, no build shorter than its
    bricks and robots allow. Minus infinity where nothing is known.
    """
    space, out = problem.space, [-np.inf] * len(problem.goals)
    values, within = np.zeros((1, len(out))), np.zeros(1, dtype=bool)
    if space.ends_bare:
        values, within = problem.values(space.levels, np.zeros_like(space.start()))
    for k, goal in enumerate(problem.goals):
        if within[0] and goal.is_peak:
            out[k] = float(values[0, k])
        if goal.least is not None:
            out[k] = goal.least(space)
    return tuple(out)


def barred(problem: States) -> tuple[int, Ints] | None:
    """Return level and state (1, c) that every plan passes and that is infeasible; None if none is.

    Of a free schedule that is the finished structure that nobody holds, of others every step in
    which no grip is open. Without limits and demands nothing is asked.
    """
    space = StateSpace(problem, standing=bool(problem.demands))
    asked = problem.demands or problem.limits or problem.filters
    for level, state in problem.space.without_choice() if asked else ():
        if not space.values(level, state, rough=False)[1].all():
            return level, state
    return None


def explore(
    problem: States,
    ceiling: float = np.inf,
    width: int | None = None,
    tell: Callable[[Explorer], object] = lambda _: None,
    *,
    exact: bool = False,
) -> Explorer:
    """Return the visited states of a problem below a ceiling, its stability requirement included.

    ``ceiling``: upper bound of the first goal, if it is a peak; ``width``: how many new states of a
    brick count are kept, and without regrips; ``tell``: called after every level; may raise to end
    the search; ``exact``: as of `Explorer`. Nothing is visited where a state that every plan passes
    is infeasible.
    """
    asked = bool(problem.demands) or any(goal.margins for goal in problem.goals)
    few = width is not None
    space = build_space(problem, regrips=not few, every=not few, standing=asked)
    found = Explorer(space, width, tell)
    found.exact = exact
    if barred(problem) is None:
        found.rise(ceiling)
    return found


WORST = {"bond": 1e9, "friction": ROUGHEST, "tilt": pi / 2}  # as goals count them
FIRST = {"bond": 1e3, "friction": 0.5, "tilt": pi / 2 - 0.05}  # where the search begins
Ordered = tuple[Order, tuple[tuple[int, ...], ...]]  # an order, if it was sought, and states
FEWEST = (STEPS,)


def best_margin(
    problem: States, tell: Callable[[Explorer], object] = lambda _: None
) -> tuple[float, float, States, Ordered]:
    """Return objective and lower bound of the first goal, a margin, and the space left at it.

    ``tell``: called with the states that are reached; may raise to end the search. Third, the
    problem of the goals after it, all states standing with that margin; fourth, the order and
    states of a plan that does. Raises `InfeasibleError` if no plan stands with any margin;
    `NothingFoundError` if it is open whether there is one within several budgets.
    """
    name, look = problem.goals[0].name, StandingLook(problem, tell)
    if problem.demands and not look.exists(look.demanding(WORST[name])):
        raise InfeasibleError("no plan of the free schedule stands as is demanded")
    low, high = bisected(name, lambda value: look.exists(look.demanding(value)))
    return high, low, look.demanding(high, problem.goals[1:] or FEWEST), look.found


class StandingLook:
    """The states of a problem within limits, and their stability as far as known."""

    def __init__(self, problem: States, tell: Callable[[Explorer], object]) -> None:
        self._problem, self._budgets, self._tell = problem, problem.budgets, tell
        self._first: States | None = None  # with whom all others share their proofs
        steps = replace(problem, goals=(*FEWEST, *problem.goals[len(problem.aims) :]))
        self._space = build_space(steps)
        self._found = Explorer(self._space, tell=tell)
        self._found.rise()
        self.found: Ordered = ((), ())
        self._demanding = dict[tuple[object, ...], States]()
        self._visited = self._found.graph()
        self._graph, self._states = self._visited
        counts = [len(rows) for *_, rows in self._states]
        self._parts = np.repeat(np.arange(len(counts)), counts)
        self._starts = np.cumsum([0, *counts])

    def demanding(self, value: float, goals: tuple[Amount, ...] = FEWEST) -> States:
        """Return the problem in which every state must stand with a value as well."""
        name = self._problem.goals[0].name
        return self.proving(replace(with_margin(self._problem, name, value), goals=goals))

    def proving(self, asked: States) -> States:
        """Return a problem with other demands that shares the proofs of those before."""
        first = self._first = self._first or asked
        asked.share_proofs(first)
        return asked

    def exists(self, asked: States) -> bool:
        """Return whether some plan meets the stability requirement in all states; keep one."""
        known = np.zeros(len(self._parts), dtype=np.int64)
        known[0] = PASSES

        def ask(part: int, rows: Ints) -> Ints:
            level, problem, states = self._part(part, rows, asked)
            return np.where(problem.stand(level, states), PASSES, FAILS)

        def recall(part: int, rows: Ints) -> Ints:
            level, problem, states = self._part(part, rows, asked)
            return problem.recalled(level, states)

        tell = partial(self._tell, self._found)
        if self._budgets:
            path = self._within(known, ask, tell)
        else:
            path = _lazy_path(self._graph, self._parts, known, ask, recall, tell)
        if path is None:
            return False
        self.found = self._space.path(self._visited.of(path))
        return True

    def _within(
        self, known: Ints, ask: Callable[[int, Ints], Ints], tell: Callable[[], object]
    ) -> tuple[int, ...] | None:
        """Return a path within budgets of states that stand, or None; arguments of `_lazy_path`."""
        while True:
            tell()
            left = self._graph.only(known[self._graph.target] != FAILS)
            try:
                path = np.array(within_budgets(left, self._budgets).path)
            except InfeasibleError:
                return None
            open_ = path[known[path] == 0]
            if not len(open_):
                return tuple(path.tolist())
            for row in open_.tolist():
                known[row] = ask(int(self._parts[row]), np.array([row]))[0]

    def _part(self, part: int, rows: Ints, asked: States) -> tuple[int, States, Ints]:
        """Return the level of states, the problem that they are of with its demands, and them."""
        _, key, states = self._states[part]
        own = (part, asked.standing, asked.settled)
        if own not in self._demanding:
            self._demanding[own] = self._space.demanding(key, asked)
        return self._space.at(key)[0], self._demanding[own], states[rows - self._starts[part]]


def bisected(name: str, exists: Callable[[float], bool]) -> tuple[float, float]:
    """Return the bracket of a margin, as close as is promised: no plan exists at its lower end.

    Raises `InfeasibleError` if none does with any value.
    """
    if name != "tilt" and exists(0.0):
        return 0.0, 0.0
    low, high = 0.0, FIRST[name]
    while not exists(high):
        if high >= WORST[name]:
            raise InfeasibleError("no plan of the free schedule stands, at any margin")
        low, high = high, min(WORST[name], 4 * high)
    while high - low > 0.6 * slack(name, high):  # the rest is for sets that stay open
        middle = (low + high) / 2
        if name != "tilt":
            middle = (low * high) ** 0.5 if low else high / 16
        low, high = (low, middle) if exists(middle) else (middle, high)
    return low, high


def with_margin(problem: States, name: str, value: float) -> States:
    """Return a problem in which every state must have a margin as well.

    ``name``: one of `seqopt.stability.standing.MARGINS`; ``value``: as goals count it.
    """
    demand = (problem.standing or Standing()).demanding(name, value)
    return replace(problem, settled=(*problem.settled, demand))


def steps_in_hands(
    space: FreeSpace | ScheduleSpace,
    states: Sequence[Sequence[int]],
    grips: Sequence[Sequence[int]],
) -> tuple[Step, ...]:
    """Return the checked steps with the robot assignment given by ``grips``, if any.

    ``grips``: of every step, the place that each robot holds, 0 for none. Raises `SolverError` if
    they are not those of the states.
    """
    steps = space.steps(states)
    if not grips:
        return steps
    numbers = [None, *space.network.scene.placed_nodes]
    if [len(row) for row in grips] != [len(step.grips) for step in steps] or not all(
        0 <= n < len(numbers) for row in grips for n in row
    ):
        raise SolverError("the grips of robots are none of this scene, or not of every state")
    out = []
    for step, row in zip(steps, grips, strict=True):
        own = replace(step, grips=tuple(numbers[n] for n in row))
        if {*own.held} != {*step.held}:
            raise SolverError(f"step {step.number}: robots hold other nodes than its state says")
        out.append(own)
    scene = space.network.scene
    return check_sequence(scene, out, _begin_step(scene, space.rules.begin))
