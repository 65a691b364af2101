"""The proof that no build order is better: the states of all orders, rebuilt as those of one.

A part is a set of bricks that stand and the newest of them. Its rows are those of an order that
begins with this set; between parts states have places in the scene's own order.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import combinations
from math import comb

import numpy as np

from seqopt.arrays import Ints
from seqopt.graph.orders import AllOrders
from seqopt.graph.paths import distances, reached
from seqopt.graph.states.states import States
from seqopt.judge._proof import BELOW, Rebuilt, Space
from seqopt.judge._rule_moves import RuleTables, Transitions
from seqopt.judge._states import Filter, Reachable, StateEvaluator, ask
from seqopt.network.build import build_network
from seqopt.problem.standing import slack
from seqopt.scene._armed import can_hold
from seqopt.scene.scene import Order, in_order
from seqopt.sequence._robot_kinds import node_numbers
from seqopt.sequence._rule_check import RuleBook
from seqopt.sequence.rules import Ending

Key = tuple[frozenset[int], int]  # bricks that stand, and the newest
MOST = 5000  # sets of bricks that are looked at
MOST_SETS = 200_000  # grip sets of the whole structure that are looked at


def finds_better_order(
    problem: AllOrders, value: float, *, most: int = MOST, end: float = np.inf
) -> bool | None:
    """Return whether some order has a plan whose first goal is below a value.

    ``value``: of the first goal; ``most``: up to how many sets of bricks with a newest one are
    looked at; ``end``: until when, as of `time.perf_counter`. Result: None where it is not known,
    because there are more sets or time is over.
    """
    goal, demands = problem.states.goals[0], problem.states.demands
    peak = goal.is_peak
    if goal.margins:
        value = max(0.0, value - slack(goal.name, value)) if np.isfinite(value) else value
        if value == 0:
            return False
        asked = Filter((), (value,) if np.isfinite(value) else ())
    else:
        if peak and _bound_of_the_whole(problem) >= value:
            return False
        value -= 4 * BELOW * abs(value) if np.isfinite(value) else 0.0  # than what is tied with it
        asked = Filter((value if peak else np.inf,), () if demands else None)
    try:
        graph = Rebuilt(_Orders(problem, most, end), asked).graph()
    except _NotAllError:
        return None
    if peak:
        return bool(graph.ends[reached(graph)].any())
    return bool(distances(graph, graph.amounts[:, 0])[graph.ends].min(initial=np.inf) < value)


class _NotAllError(Exception):
    """There are more sets of bricks than may be looked at, or time is over."""


class _Orders(Space):
    """The states of all orders, those of up to so many sets until some time."""

    def __init__(self, problem: AllOrders, most: int, end: float) -> None:
        self._problem, self._left, self._end = problem, most + 1, end  # the start is looked at too
        self.levels = range(len(problem.stands), len(problem.scene.bricks) + 1)
        self._nodes = {brick.name: brick.nodes for brick in problem.scene.bricks}
        own = (node for name in problem.scene.build_order for node in self._nodes[name])
        self._place = {node: place for place, node in enumerate(own, start=1)}

    @property
    def first(self) -> Key:
        """The bricks with which builds begin."""
        stands = self._problem.stands
        return frozenset(stands), stands[-1] if stands else 0

    def at(self, part: Key) -> tuple[int, StateEvaluator]:
        """Return how many bricks stand, and what evaluates the states of an order."""
        self._left -= 1
        if self._left < 0 or time.perf_counter() > self._end:
            raise _NotAllError
        return len(part[0]), StateEvaluator(self._problem.judging(self._order(part)))

    def to_part(self, part: Key, evaluator: StateEvaluator, states: Ints) -> Ints:
        """Return states with places in the scene's own order as rows of a part."""
        rows = self._renumbered(self._order(part), states, back=True)
        return evaluator.tables.in_order(rows)

    def from_part(self, part: Key, states: Ints) -> Ints:
        """Return rows of a part with places in the scene's own order."""
        return self._renumbered(self._order(part), states)

    def onward(self, part: Key, found: Reachable) -> Iterator[tuple[Key, Transitions]]:
        """Yield what follows by placing each of the bricks that may come next."""
        problem, (stand, _) = self._problem, part
        parks = problem.states.goals[0].needs_stays
        own = self.from_part(part, found.states)
        for brick in problem.next_bricks(stand) if len(own) else ():
            order = self._order(part, brick)
            worlds = tuple(in_order(scene, order) for scene in problem.states.worlds)
            book = RuleBook(build_network(problem.scene, order), problem.states.free_rules, worlds)
            tables = RuleTables(book, [], parks=parks)
            rows = self._renumbered(order, own, back=True)
            for move in tables.successors(len(stand), rows):
                if move.level > len(stand) and len(move.states):
                    states = self._renumbered(order, move.states)
                    yield (stand | {brick}, brick), move._replace(states=states)

    def _renumbered(self, order: Order, states: Ints, *, back: bool = False) -> Ints:
        """Return states with places in the scene's own order for those in another, or back."""
        place = np.array([0, *(self._place[n] for name in order for n in self._nodes[name])])
        place = np.argsort(place) if back else place
        robots = len(self._problem.states.free_rules.team(self._problem.scene))
        out = states.copy()
        held = states[:, :robots]  # negative where a free robot was last
        out[:, :robots] = np.sign(held) * place[np.abs(held)]
        return out

    def _order(self, key: Key, following: int | None = None) -> Order:
        """Return an order that begins with a set, its newest brick last, and maybe another one."""
        own, (stand, newest) = self._problem.scene.build_order, key
        first = [name for name in own if name in stand and name != newest]
        last = [newest] if stand else []
        last += [] if following is None else [following]
        return (*first, *last, *(n for n in own if n not in stand and n != following))


def _bound_of_the_whole(problem: AllOrders) -> float:
    """Return the lower bound from the finished structure, in which every order ends.

    Minus infinity where there are too many grip sets to look at.
    """
    free, scene = problem.judging(problem.scene.build_order), problem.scene
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
