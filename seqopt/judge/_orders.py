"""The proof that no build order is better: a cut, or potentials, of the states of all orders.

Sets of bricks that stand, the newest known, are met one after the other; with each the states that
are reached, by a second version of the rules and with responses computed again. Of a worst step
these are states below a value: where none of them ends the build no order stays below it. Of what
adds up every state has what a way to it takes at least.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.graph.graph import Graph
from seqopt.graph.orders import AllOrders
from seqopt.graph.paths import distances
from seqopt.graph.states.states import States
from seqopt.judge._answers import ask
from seqopt.judge._proof import BELOW, Asked, Passable, Tables
from seqopt.judge._rule_moves import Follows, RuleTables
from seqopt.network.build import build_network
from seqopt.problem.problem import Measure
from seqopt.problem.standing import slack
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
    goal = problem.states.goals[0]
    peak = goal.measure is Measure.PEAK
    if goal.of_margins:
        value = max(0.0, value - slack(goal.response, value)) if np.isfinite(value) else value
        if value == 0:
            return False
    elif peak and _of_the_whole(problem) >= value:
        return False
    elif np.isfinite(value):
        value -= 4 * BELOW * abs(value)  # further below than what is tied with it
    least = _least_of_all(problem, value if peak else np.inf, most, end)
    return None if least is None else least < value


def _least_of_all(problem: AllOrders, below: float, most: int, end: float) -> float | None:
    """Return what the first goal takes at least in any order; None where not all are looked at.

    Of a worst step it is said whether some order stays below a value: zero, or infinity.
    """
    first: Key = (frozenset(problem.stands), problem.stands[-1] if problem.stands else 0)
    entries, later = _begin(problem, first)
    looked, least = 0, np.inf
    for bricks in range(len(first[0]), len(problem.scene.bricks) + 1):
        following, later = later, {}
        for key, parts in entries.items():
            looked += 1
            if looked > most or time.perf_counter() > end:
                return None
            found = _closed(problem, key, parts, below)
            ends = found.tables.ends(bricks, found.states)
            least = min(least, float(found.least[ends].min(initial=np.inf)))
            if ends.any() and np.isfinite(below):
                return 0.0
            for after, placed in _placed(problem, key, found):
                following.setdefault(after, []).append(placed)
        entries = following
    return least


def _begin(problem: AllOrders, key: Key) -> tuple[_ByKey, _ByKey]:
    """Return what follows where builds begin: with the bricks there, and with one more."""
    tables = Passable(problem.judging(_order(problem, key))).tables
    start, later = tables.start(), _ByKey()
    found = _Reached(start, np.zeros(1), tables)
    for after, placed in _placed(problem, key, found):
        later.setdefault(after, []).append(placed)
    counted = problem.states.goals[0].measure is Measure.REGRIPS

    def before(move: Follows) -> Floats:
        return np.full(len(move.states), float(counted and move.regrip))

    parts = [
        _Entries(_renumbered(problem, key, move.states), before(move), move.way)
        for move in tables.follow(len(key[0]), start)
        if move.level == len(key[0])
    ]
    return ({key: parts} if parts else {}), later


class _Entries(NamedTuple):
    """States to which a brick is placed: places in the scene's own order, as rows of tables.

    ``before`` (n,): what the first goal takes of a way to the state before; ``way`` (n,): how far
    the robot goes, m.
    """

    states: Ints
    before: Floats
    way: Floats


_ByKey = dict[Key, list[_Entries]]


class _Reached(NamedTuple):
    """The states with a set of bricks that are reached, and what the first goal takes at least."""

    states: Ints
    least: Floats
    tables: Tables


def _of_the_whole(problem: AllOrders) -> float:
    """Return the least value with which all bricks stand, whoever holds them: every order ends so.

    Minus infinity where there are too many grip sets to look at.
    """
    free = problem.judging(problem.scene.build_order)
    taken = {*problem.scene.blocked_nodes, *(prop.node for prop in problem.scene.props)}
    nodes = [n for n in node_numbers(free.network) if n not in taken]
    rules, scene = free.free_rules, problem.scene
    fewest = max(1, rules.fewest_grips(scene) - len(scene.props))
    held = range(fewest, free.space.robots + 1)
    least = -np.inf
    if sum(comb(len(nodes), count) for count in held) <= MOST_SETS:
        least = min((_least(free, nodes, count) for count in held), default=np.inf)
    return (
        least if free.free_rules.how_it_ends is Ending.HELD else max(least, _least(free, nodes, 0))
    )


def _least(free: States, nodes: list[int], count: int) -> float:
    """Return the least that the goal takes of the whole with so many grips; infinite of none."""
    grips = np.array([*combinations(nodes, count)], dtype=np.int64)
    found = ask(free, len(free.network.inner), grips.reshape(comb(len(nodes), count), count))
    return float(found.values[found.fit, 0].min(initial=np.inf))


def _closed(problem: AllOrders, key: Key, parts: list[_Entries], below: float) -> _Reached:
    """Return the states with a set of bricks that are reached, below a value of a worst step."""
    passable = Passable(problem.judging(_order(problem, key)))
    tables, asked = passable.tables, Asked((below,), () if problem.states.demands else None)
    if passable.margins:
        asked = Asked((), (below,) if np.isfinite(below) else ())
    start = tables.start()
    states, before, way = map(np.concatenate, zip(*parts, strict=True))
    rows = tables.in_order(_renumbered(problem, key, states, back=True).astype(start.dtype))
    part = passable.closed(len(key[0]), rows, asked)
    peak = problem.states.goals[0].measure is Measure.PEAK
    if peak or not len(part.states):
        return _Reached(part.states, np.zeros(len(part.states)), tables)
    order = np.argsort(part.codes, kind="stable")

    def moves(source: Ints, found: Follows, cost: Floats) -> tuple[Ints, Ints, Floats]:
        wanted = tables.codes(found.states)
        at = np.searchsorted(part.codes, wanted, sorter=order).clip(max=len(order) - 1)
        target = order[at]
        ok = part.codes[target] == wanted
        taken = found._replace(way=found.way[ok])
        amounts = passable.moved(part.values[target[ok]], taken)[:, 0]
        return source[ok], target[ok] + 1, amounts + cost[ok]

    none = np.zeros(len(rows), dtype=np.int64)
    entered = Follows(len(key[0]), none, rows, regrip=False, way=way)
    some = [moves(none, entered, before)]
    for move in part.follows:
        if move.level == len(key[0]):
            some.append(moves(move.source + 1, move, np.zeros(len(move.source))))
    source, target, amounts = map(np.concatenate, zip(*some, strict=True))
    graph = Graph(
        source.astype(np.int32),
        target.astype(np.int32),
        amounts[:, None],
        (False,),
        np.zeros(len(part.states) + 1, dtype=bool),
    )
    return _Reached(part.states, distances(graph, graph.amounts[:, 0])[1:], tables)


def _placed(problem: AllOrders, key: Key, found: _Reached) -> Iterator[tuple[Key, _Entries]]:
    """Yield what follows by placing a brick: some states more than once."""
    parks = problem.states.goals[0].measure is Measure.TRAVEL
    own = _renumbered(problem, key, found.states)
    for brick in problem.next_bricks(key[0]) if len(found.states) else ():
        order = _order(problem, key, brick)
        network = build_network(problem.scene, order)
        worlds = tuple(in_order(scene, order) for scene in problem.states.worlds)
        tables = RuleTables(RuleBook(network, problem.states.free_rules, worlds), [], parks=parks)
        rows = _places(problem, order, own, back=True).astype(tables.start().dtype)
        for move in tables.follow(len(key[0]), rows):
            if move.level > len(key[0]) and len(move.states):
                states = _places(problem, order, move.states)
                after = (key[0] | {brick}, brick)
                yield after, _Entries(states, found.least[move.source], move.way)


def _renumbered(problem: AllOrders, key: Key, states: Ints, *, back: bool = False) -> Ints:
    return _places(problem, _order(problem, key), states, back=back)


def _places(problem: AllOrders, order: Order, states: Ints, *, back: bool = False) -> Ints:
    """Return states with places in the scene's own order for those in another one, or back."""
    nodes = {brick.name: brick.nodes for brick in problem.scene.bricks}
    own = {n: i for i, n in enumerate((n for b in problem.scene.build_order for n in nodes[b]), 1)}
    place = np.array([0, *(own[n] for b in order for n in nodes[b])])
    place = np.argsort(place) if back else place
    out, robots = states.astype(np.int64), len(problem.states.free_rules.team(problem.scene))
    held = states[:, :robots].astype(np.int64)  # negative where a free robot was last
    out[:, :robots] = np.sign(held) * place[np.abs(held)]
    return out


def _order(problem: AllOrders, key: Key, following: int | None = None) -> Order:
    """Return an order that begins with a set, its newest brick last, and maybe another one."""
    own, (stand, newest) = problem.scene.build_order, key
    first = [name for name in own if name in stand and name != newest]
    last = [newest] if stand else []
    last += [] if following is None else [following]
    return (*first, *last, *(name for name in own if name not in stand and name != following))
