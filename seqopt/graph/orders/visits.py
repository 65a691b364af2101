"""The states of all orders of a free schedule at once: by which bricks stand, not by how many.

The states with a set of bricks, the newest of them known, are those of the free schedule in any
order that begins with the set and has this brick at its end. Sets of one size follow from those
with a brick less. An order is a way from the empty set to all bricks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.explore import Moves
from seqopt.graph.orders.orders import AllOrders
from seqopt.graph.states.states import States
from seqopt.graph.states.visits import FreeStates, move_amounts
from seqopt.problem.goals import LARGEST, Measure
from seqopt.sequence.free_rules import Ending
from seqopt.sequence.free_space import node_numbers, sort_entries

MOST_SETS = 200_000  # grip sets of the whole structure that are looked at


def whole_bound(problem: AllOrders) -> float:
    """Return the least value with which all bricks stand, whoever holds them.

    Every plan of every order passes such a state, and the one in which nobody holds if it ends so.

    Result: minus infinity where there are too many grip sets to look at.
    """
    free = problem.judging(problem.scene.build_order)
    if free.goals[0].measure is not Measure.PEAK:
        return -np.inf
    numbers = node_numbers(free.network)
    places = [i for i, n in enumerate(numbers, 1) if n not in problem.scene.blocked_nodes]
    least = -np.inf
    sets = _sets(places, max(1, free.free_rules.least_grips), free.space.robots)
    if len(sets):
        least = float(_values(free, sets).min())
    if free.free_rules.ending is not Ending.HELD:
        least = max(least, float(_values(free, np.zeros((1, free.space.robots), int))[0]))
    return least


def _sets(places: list[int], fewest: int, robots: int) -> Ints:
    """Return all grip sets, zeros for robots that are free first; none if they are too many."""
    rows: list[tuple[int, ...]] = []
    for count in range(fewest, robots + 1):
        for nodes in combinations(places, count):
            rows.append((*[0] * (robots - count), *nodes))
            if len(rows) > MOST_SETS:
                return np.zeros((0, robots), dtype=np.int64)
    return np.array(rows, dtype=np.int64).reshape(-1, robots)


def _values(free: States, held: Ints) -> Floats:
    """Return what the goal takes of grip sets of the whole; infinite where something is loose."""
    bricks, goal = len(free.network.inner), free.goals[0]
    answers, forces = free.sets.answers(bricks, held)
    names = [name for name in free.named if name != LARGEST]
    found = dict(zip(names, answers.T, strict=True)) | {LARGEST: forces.max(axis=1, initial=0.0)}
    loose = ~np.isfinite(answers).all(axis=1)
    finite = {name: np.where(loose, 0.0, values) for name, values in found.items()}
    if goal.response:
        return np.where(loose, np.inf, finite[goal.response])
    return np.where(loose, np.inf, free.criterion.costs(finite, bricks, len(held)))


Key = tuple[frozenset[int], int]  # bricks that stand, and the newest


class TooManySetsError(Exception):
    """There are more sets of bricks than may be looked at."""


@dataclass(frozen=True)
class OrderStates:
    """The states of a free schedule in all orders, a part for every set of bricks and newest brick.

    ``most``: how many parts there may be; ``parts``: those that were looked at, each in an order
    that begins with its set.
    """

    problem: AllOrders
    most: int
    parts: dict[Key, FreeStates] = field(default_factory=dict)

    @property
    def levels(self) -> int:
        """How many bricks there are."""
        return len(self.problem.scene.bricks)

    @property
    def peaks(self) -> tuple[bool, ...]:
        """Whether the worst step counts, or what all steps take."""
        return (self.problem.states.goals[0].measure is Measure.PEAK,)

    def start(self) -> tuple[Key, Ints]:
        """Return the empty site."""
        empty: Key = (frozenset(), 0)
        return empty, self._of(empty).start()[1]

    def codes(self, part: Key, states: Ints) -> Ints:
        """Return a number for every state."""
        return self._of(part).codes(len(part[0]), states)

    def within(self, part: Key, states: Ints) -> Moves:
        """Return the moves that place no brick."""
        return self._of(part).within(len(part[0]), states)

    def onward(self, part: Key, states: Ints) -> Iterator[tuple[Key, Moves]]:
        """Yield the moves that place one of the bricks that may come next."""
        old = self._of(part).problem
        for brick in self.problem.next_bricks(part[0]):
            key = (part[0] | {brick}, brick)
            new = self._of(key)
            yield key, new.placed(len(part[0]), _renumbered(old, new.problem, states))

    @property
    def floors(self) -> bool:
        """Whether there are scenarios."""
        return bool(self.problem.states.each)

    def values(self, part: Key, states: Ints, *, rough: bool, most: float) -> tuple[Floats, Bools]:
        """Return what the first goal takes of states, and which are allowed."""
        return self._of(part).values(len(part[0]), states, rough=rough, most=most)

    def amounts(self, values: Floats, taken: Floats) -> Floats:
        """Return what the first goal takes of moves, (m, 1)."""
        return move_amounts(self._first, values, taken)

    @cached_property
    def _first(self) -> States:
        return replace(self.problem.states, goals=self.problem.states.goals[:1])

    def ended(self, part: Key, states: Ints) -> Bools:
        """Return which states end the build."""
        return self._of(part).ended(len(part[0]), states)

    def _of(self, part: Key) -> FreeStates:
        """Return the free schedule in an order that begins with a set, its newest brick last."""
        if part not in self.parts:
            if len(self.parts) > self.most:
                raise TooManySetsError
            own = self.problem.scene.build_order
            first = [name for name in own if name in part[0] and name != part[1]]
            rest = [name for name in own if name not in part[0]]
            newest = (part[1],) if part[0] else ()
            problem = self.problem.judging((*first, *newest, *rest))
            self.parts[part] = FreeStates(problem, standing=bool(problem.demands))
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
