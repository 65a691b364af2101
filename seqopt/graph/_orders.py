"""The orders of a scene's bricks: which are sought, and the states of all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.registry import recipe_of
from seqopt.errors import ProblemError
from seqopt.graph.space import Found, Moves, Space
from seqopt.graph.states._visits import StateSpace, move_amounts, scenario_peaks
from seqopt.graph.states.states import States
from seqopt.problem.amounts import LARGEST, STEPS, StateArrays
from seqopt.problem.problem import Orders
from seqopt.scene._armed import can_hold
from seqopt.scene.scene import Order, Scene
from seqopt.sequence._rule_space import node_numbers, sort_entries
from seqopt.sequence.rules import Direction, Ending

MOST_PARTS = 5000  # sets of bricks with a newest one, where all are looked at
MOST_SETS = 200_000  # grip sets of the whole structure that are looked at


def among_orders(problem: States, among: Orders | str) -> States:
    """Return the problem over feasible build orders too; values keep the scales of the scene's.

    Raises `ProblemError` if there are no such orders, what is asked depends on the scene's own, or
    its engine was not made by name.
    """
    found = replace(problem, orders=Orders.of(among))
    scene = found.network.scene
    last = upward(found).free_rules.span(scene)[1]
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


def upward(problem: States) -> States:
    """Return the build that passes, in reverse, the states of a take-down; a build is itself.

    Raises `ProblemError` if the take-down is one of a part, or what is asked is not the same in
    reverse.
    """
    rules, scene = problem.free_rules, problem.network.scene
    if not rules.takes_down:
        return problem
    if rules.begin != replace(rules, begin=None).begun(scene).begin or rules.finish is not None:
        raise ProblemError(
            "orders of a take-down from or to a part: which bricks those are is not said; give an "
            "order, or take all down from where nobody holds"
        )
    first = problem.goals[0]
    other = [goal for goal in problem.goals if goal.margins or not (goal.is_peak or goal == STEPS)]
    if other or not first.is_peak or rules.regrips is not None:
        raise ProblemError(
            f"orders of a take-down are searched for its worst state, then steps, not for "
            f"{(*other, first)[0]} or within regrips; give an order, or put minmax first"
        )
    up = replace(rules, direction=Direction.BUILD, begin=None, ending=Ending.ONE_BY_ONE)
    return replace(problem, rules=up, spares=True)


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
    first = upward(problem).free_rules.span(scene)[0]
    return OrderRules(scene, Orders.of(problem.orders or Orders.TIED), scene.build_order[:first])


def _of_first_goal(problem: States) -> States:
    """Return the problem of the first goal alone; orders are shared out, not their grip sets."""
    alone = problem.resources.alone()
    return replace(upward(problem), goals=problem.goals[:1], budgets=(), resources=alone)


def whole_bound(problem: States) -> float:
    """Return the lower bound from the finished structure: the least value over all grips.

    Every plan of every order passes such a state, and the one in which nobody holds if it ends so.

    Result: minus infinity where there are too many grip sets to look at.
    """
    free, scene, least = _of_first_goal(problem), problem.network.scene, -np.inf
    if not free.goals[0].is_peak or free.goals[0].margins:
        return least
    numbers = node_numbers(free.network)
    taken = {*scene.blocked_nodes, *(prop.node for prop in scene.props)}
    every = [  # whoever holds them
        place + k * len(numbers)
        for k in sorted({*scene.grip_kinds.of_robot[: len(scene.robots)].tolist()})
        for place, node in enumerate(numbers, start=1)
        if node not in taken and can_hold(scene, k, node)
    ]
    fewest = max(1, free.free_rules.fewest_grips(scene) - len(scene.props))
    sets = _sets(every, fewest, free.space.robots, len(numbers))
    if len(sets):
        least = float(_values(free, sets).min())
    if free.free_rules.how_it_ends is not Ending.HELD and not free.spares:
        least = max(least, float(_values(free, np.zeros((1, free.space.robots), int))[0]))
    return least


def _sets(places: list[int], fewest: int, robots: int, nodes: int) -> Ints:
    """Return all grip sets, zeros for robots that are free first; none if they are too many.

    ``nodes``: how many there are; places beyond that are the same nodes, held by others.
    """
    rows: list[tuple[int, ...]] = []
    for count in range(fewest, robots + 1):
        for held in combinations(places, count):
            if len({place % nodes for place in held}) == count:
                rows.append((*[0] * (robots - count), *held))
            if len(rows) > MOST_SETS:
                return np.zeros((0, robots), dtype=np.int64)
    return np.array(rows, dtype=np.int64).reshape(-1, robots)


def _values(free: States, held: Ints) -> Floats:
    """Return the goal of grip sets of the whole, (n,); infinite where something is loose."""
    if free.each:
        return np.asarray(np.max([_values(each, held) for each in free.each], axis=0))
    bricks, goal = len(free.network.inner), free.goals[0]
    answers, forces = free.sets.answers(bricks, held)
    names = [name for name in free.named if name != LARGEST]
    found = dict(zip(names, answers.T, strict=True)) | {LARGEST: forces.max(axis=1, initial=0.0)}
    whole = np.asarray(np.isfinite(answers).all(axis=1))
    finite = {name: np.where(whole, values, 0.0) for name, values in found.items()}
    places = np.where(held > 0, (held - 1) % (2 * bricks) + 1, 0)  # whoever holds
    nodes, most = free._node_numbers[places], np.full(held.shape, np.inf)
    seen = StateArrays(bricks, nodes, finite, forces, most, whole, free.criterion, places)
    values = np.zeros(len(held)) if goal.states is None else goal.value(seen)
    return np.where(whole, values, np.inf)


class TooManySetsError(ProblemError):
    """There are more sets of bricks than the search may visit."""


Part = tuple[frozenset[int], int]  # bricks that stand, and the newest


@dataclass(frozen=True)
class OrderSpace(Space):
    """The states of all orders, a part for every set of standing bricks and newest brick.

    Neither responses nor moves depend on how the others were placed. Of a take-down they are those
    of the build that it reverses.

    ``most``: how many parts there may be; ``regrips``, ``standing``: as of `StateSpace`; ``parts``:
    those that were looked at, each in an order that begins with its set.
    """

    problem: States
    most: int = MOST_PARTS
    regrips: bool = True
    standing: bool = False
    parts: dict[Part, StateSpace] = field(default_factory=dict)

    @cached_property
    def _up(self) -> States:
        return replace(upward(self.problem), resources=self.problem.resources.alone())

    @cached_property
    def _rules(self) -> OrderRules:
        return order_rules(self.problem)

    @property
    def first(self) -> int:
        return len(self._rules.stands)

    @property
    def levels(self) -> int:
        return len(self._rules.scene.bricks)

    @property
    def peaks(self) -> tuple[bool, ...]:
        return scenario_peaks(self._up)

    def start(self) -> tuple[Part, Ints]:
        stands = self._rules.stands
        part = (frozenset(stands), stands[-1] if stands else 0)
        return part, self._of(part).start()[1]

    def codes(self, part: Part, states: Ints) -> Ints:
        return self._of(part).codes(len(part[0]), states)

    def within(self, part: Part, states: Ints) -> Moves:
        return self._of(part).within(len(part[0]), states)

    def onward(self, part: Part, states: Ints) -> Iterator[tuple[Part, Moves]]:
        old = self._of(part)
        rows = old.able(len(part[0]), states)
        for brick in self._rules.next_bricks(part[0]):
            to = (part[0] | {brick}, brick)
            new = self._of(to)
            own = _renumbered(old.problem, new.problem, states[rows])
            moves = new.placed(len(part[0]), own)
            yield to, moves._replace(source=rows[moves.source])

    @property
    def complete(self) -> bool:
        return self.regrips

    @property
    def floors(self) -> bool:
        return bool(self._up.each) and not self._up.totals

    def values(self, part: Part, states: Ints, *, rough: bool, most: float) -> tuple[Floats, Bools]:
        return self._of(part).values(len(part[0]), states, rough=rough, most=most)

    def amounts(self, values: Floats, taken: Floats) -> Floats:
        return values if self._up.totals else move_amounts(self._up, values, taken)

    def to_go(self, part: Part, states: Ints) -> Floats | None:
        return self._of(part).to_go(len(part[0]), states)

    def ended(self, part: Part, states: Ints) -> Bools:
        return self._of(part).ended(len(part[0]), states)

    def stand(self, part: Part, states: Ints) -> Bools:
        return self._of(part).stand(len(part[0]), states)

    def known(self, part: Part, states: Ints) -> Ints:
        return self._of(part).known(len(part[0]), states)

    def schedule(self, part: Part, asked: States) -> tuple[int, States]:
        """Return how many bricks a part has, and its states with the demands of a problem."""
        own = self._of(part).problem
        found = replace(own, standing=asked.standing, settled=asked.settled)
        found.share_proofs(own)
        return len(part[0]), found

    def path(self, found: Found) -> tuple[Order, tuple[tuple[int, ...], ...]]:
        newest = (part[1] for _, part, _ in found)
        order = tuple(dict.fromkeys((*self._rules.stands, *newest)))
        new, steps = self._up.at(order), list[tuple[int, ...]]()
        for level, part, state in found:
            row = _renumbered(self._of(part).problem, new, state[None])[0]
            steps.append((level, *row.tolist()))
        if not self.problem.free_rules.takes_down:
            return order, tuple(steps)
        site = (0, *[0] * (len(steps[0]) - 1))
        back = [*reversed(steps[:-1]), site]  # from the whole that nobody holds
        return order, tuple((1 + self.levels - level, *held) for level, *held in back)

    @property
    def effort(self) -> tuple[int, int]:
        return len(self.parts) - 1, sum(space.problem.models for space in self.parts.values())

    def rows(self, part: Part, states: Ints) -> Ints:
        """Return labels of states: the level, the newest brick, and the place of each grip."""
        held = states[:, : self._up.space.robots].astype(np.int64)
        own = np.array([[len(part[0]), part[1]]])
        return np.column_stack([np.repeat(own, len(held), axis=0), held])

    def _of(self, part: Part) -> StateSpace:
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
            self.parts[part] = StateSpace(self._up.at(order), self.regrips, self.standing)
        return self.parts[part]


def _renumbered(old: States, new: States, states: Ints) -> Ints:
    """Return states with the places that nodes have in another order."""
    place = {node: i for i, node in enumerate(node_numbers(new.network), start=1)}
    map_to = np.array([0, *(place[node] for node in node_numbers(old.network))])
    out, robots = states.copy(), old.space.robots
    nodes = states[:, :robots]  # negative where a free robot was last
    out[:, :robots] = np.sign(nodes) * map_to[np.abs(nodes)]
    for first, end in new.space.slots:
        sort_entries(out, first, end)
    return out
