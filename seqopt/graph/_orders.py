"""The orders of a scene's bricks: which are sought, and the states of all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.registry import recipe_of
from seqopt.errors import ProblemError
from seqopt.graph.space import Found, Moves, Space
from seqopt.graph.states._visits import StateSpace, move_amounts, scenario_peaks
from seqopt.graph.states.states import States
from seqopt.problem.problem import Orders
from seqopt.scene.scene import Order, Scene
from seqopt.sequence._space import sort_entries

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
class OrderSpace(Space):
    """The states of all orders, a part for every set of standing bricks and newest brick.

    Neither responses nor moves depend on how the others were placed.

    ``most``: how many parts there may be; ``regrips``, ``standing``: as of `StateSpace`; ``parts``:
    those that were looked at, each in an order that begins with its set.
    """

    problem: States
    most: int = MOST_PARTS
    regrips: bool = True
    standing: bool = False
    parts: dict[Part, StateSpace] = field(default_factory=dict)

    @cached_property
    def _here(self) -> States:
        return replace(self.problem, resources=self.problem.resources.alone())

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
        return scenario_peaks(self._here)

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
        return bool(self._here.each) and not self._here.totals

    def values(self, part: Part, states: Ints, *, rough: bool, most: float) -> tuple[Floats, Bools]:
        return self._of(part).values(len(part[0]), states, rough=rough, most=most)

    def amounts(self, values: Floats, taken: Floats) -> Floats:
        return values if self._here.totals else move_amounts(self._here, values, taken)

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
        new, steps = self._here.at(order), list[tuple[int, ...]]()
        for level, part, state in found:
            row = _renumbered(self._of(part).problem, new, state[None])[0]
            steps.append((level, *row.tolist()))
        return order, tuple(steps)

    @property
    def effort(self) -> tuple[int, int]:
        return len(self.parts) - 1, sum(space.problem.models for space in self.parts.values())

    def rows(self, part: Part, states: Ints) -> Ints:
        """Return labels of states: the level, the newest brick, and the place of each grip."""
        held = states[:, : self._here.space.robots].astype(np.int64)
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
            self.parts[part] = StateSpace(self._here.at(order), self.regrips, self.standing)
        return self.parts[part]


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
