"""The states that a proof rebuilds, in parts: of one schedule, or of all orders of its bricks.

Of all orders a part is a set of bricks that stand and the newest of them. Its rows are those of an
order that begins with this set; between parts states have places in the scene's own order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from math import comb
from typing import Any

import numpy as np

from seqopt.arrays import Ints
from seqopt.errors import ProblemError
from seqopt.graph._orders import order_rules, upward
from seqopt.graph.states.states import States
from seqopt.judge._rule_moves import RuleTables, Transitions
from seqopt.judge._states import Reachable, StateEvaluator, ask
from seqopt.network.build import build_network
from seqopt.scene._armed import can_hold
from seqopt.scene.scene import Order, in_order
from seqopt.sequence._robot_kinds import node_numbers
from seqopt.sequence._rule_check import RuleBook
from seqopt.sequence.rules import Ending

Key = tuple[frozenset[int], int]  # bricks that stand, and the newest
MOST = 5000  # sets of bricks that are looked at
MOST_SETS = 200_000  # grip sets of the whole structure that are looked at


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
        """Return the level of a part, and what evaluates its states."""
        return part, self.evaluator

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

    def least(self) -> tuple[float, ...]:
        """Return lower bounds of goals, also from the whole structure, the end of all orders."""
        first, *others = self.evaluator.least()
        goal = self._problem.goals[0]
        peak = goal.is_peak and not goal.margins
        return max(first, _bound_of_the_whole(self._problem) if peak else -np.inf), *others

    def at(self, part: Key) -> tuple[int, StateEvaluator]:
        if part not in self._known:
            if len(self._known) > MOST:  # the start is looked at too
                raise TooManyPartsError(f"more than {MOST} sets of bricks; nothing is proven")
            self._known[part] = StateEvaluator(self._problem.at(self._order(part)))
        return len(part[0]), self._known[part]

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


def _bound_of_the_whole(problem: States) -> float:
    """Return the lower bound from the finished structure, in which every order ends.

    Minus infinity where there are too many grip sets to look at.
    """
    free, scene = replace(problem, goals=problem.goals[:1]), problem.network.scene
    rules, kinds = free.free_rules, scene.grip_kinds
    taken = {*scene.blocked_nodes, *(prop.node for prop in scene.props)}
    nodes = [node for node in node_numbers(free.network) if node not in taken]
    grips = [  # numbers, of robots of every kind
        node + kind * kinds.span
        for kind in np.unique(kinds.of_robot[: len(scene.robots)]).tolist()
        for node in nodes
        if can_hold(scene, kind, node)
    ]
    fewest = max(1, rules.fewest_grips(scene) - len(scene.props))
    held, least = range(fewest, free.space.robots + 1), -np.inf
    if sum(comb(len(grips), count) for count in held) <= MOST_SETS:
        least = min((_least(free, grips, count) for count in held), default=np.inf)
    return least if rules.how_it_ends is Ending.HELD else max(least, _least(free, grips, 0))


def _least(free: States, grips: list[int], count: int) -> float:
    """Return the least value of the whole structure with so many grips; infinite if none fits."""
    sets = np.array([*combinations(grips, count)], dtype=np.int64)
    sets = sets.reshape(comb(len(grips), count), count)
    nodes = np.sort(free.network.scene.grip_kinds.split(sets)[0], axis=1)
    sets = sets[(np.diff(nodes, axis=1) > 0).all(axis=1)]  # nobody holds what another one holds
    found = ask(free, len(free.network.inner), sets)
    return float(found.values[found.fit, 0].min(initial=np.inf))


def build_parts(problem: States) -> OneSchedule:
    """Return the states of a problem in parts, as a judge rebuilds them."""
    return OneSchedule(problem) if problem.orders is None else AllOrders(problem)
