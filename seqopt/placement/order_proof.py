"""The proof that no build order is better: a cut through the states of all orders.

Sets of bricks that stand, the newest known, are met one after the other; with each the states below
a value that are reached, by a second version of the rules and with responses computed again. Where
none of them ends the build no order stays below the value.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from math import comb

import numpy as np

from seqopt.arrays import Ints
from seqopt.network.build import build_network
from seqopt.placement.free_answers import ask
from seqopt.placement.free_goals import Goal, Measure
from seqopt.placement.free_passable import Asked, Passable, Tables
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.free_proof import BELOW
from seqopt.placement.free_tables import RuleTables
from seqopt.placement.order_problem import OrderProblem
from seqopt.scene.orders import Order
from seqopt.sequence.free_check import RuleBook
from seqopt.sequence.free_rules import Ending
from seqopt.sequence.free_space import node_numbers

Key = tuple[frozenset[int], int]  # bricks that stand, and the newest
MOST = 5000  # sets of bricks that are looked at
MOST_SETS = 200_000  # grip sets of the whole structure that are looked at


def finds_better_order(
    problem: OrderProblem, value: float, *, most: int = MOST, end: float = np.inf
) -> bool | None:
    """Return whether some order has a plan whose first goal is below a value.

    ``value``: of the first goal; ``most``: up to how many sets of bricks with a newest one are
    looked at; ``end``: until when, as of `time.perf_counter`. Result: None where it is not known:
    there are more sets, time is over, or the goal adds up along a plan.
    """
    if problem.free.goals[0].measure is not Measure.PEAK:  # what adds up is not proven
        moves = replace(problem.free, goals=(Goal(Measure.STEPS),))
        some = replace(problem, free=moves)
        return None if np.isfinite(value) else _finds(some, value, most, end)
    if _of_the_whole(problem) >= value:
        return False
    if np.isfinite(value):
        value -= 4 * BELOW * abs(value)  # further below than what is tied with it
    return _finds(problem, value, most, end)


def _finds(problem: OrderProblem, below: float, most: int, end: float) -> bool | None:
    """Return whether some order has a plan with states below a value; None if it is not known."""
    empty: Key = (frozenset(), 0)
    entries: dict[Key, list[Ints]] = {empty: []}
    looked = 0
    for bricks in range(len(problem.scene.bricks) + 1):
        following: dict[Key, list[Ints]] = {}
        for key, parts in entries.items():
            looked += 1
            if looked > most or time.perf_counter() > end:
                return None
            states, tables = _closed(problem, key, parts, below)
            if tables.ends(bricks, states).any():
                return True
            for after, rows in _placed(problem, key, _nodes(tables, states)):
                following.setdefault(after, []).append(rows)
        entries = following
    return False


def _of_the_whole(problem: OrderProblem) -> float:
    """Return the least value with which all bricks stand, whoever holds them: every order ends so.

    Minus infinity where there are too many grip sets to look at.
    """
    free = problem.judging(problem.scene.build_order)
    nodes = [n for n in node_numbers(free.network) if n not in problem.scene.blocked_nodes]
    held = range(max(1, free.free_rules.least_grips), free.space.robots + 1)
    least = -np.inf
    if sum(comb(len(nodes), count) for count in held) <= MOST_SETS:
        least = min((_least(free, nodes, count) for count in held), default=np.inf)
    return least if free.free_rules.ending is Ending.HELD else max(least, _least(free, nodes, 0))


def _least(free: FreeProblem, nodes: list[int], count: int) -> float:
    """Return the least that the goal takes of the whole with so many grips; infinite of none."""
    grips = np.array([*combinations(nodes, count)], dtype=np.int64)
    found = ask(free, len(free.network.inner), grips.reshape(comb(len(nodes), count), count))
    return float(found.worth[found.fit, 0].min(initial=np.inf))


def _closed(
    problem: OrderProblem, key: Key, parts: list[Ints], below: float
) -> tuple[Ints, Tables]:
    """Return the states with a set of bricks that are reached below a value."""
    passable = Passable(problem.judging(_order(problem, key)))
    tables = passable.tables
    rows = [_places(tables, nodes) for nodes in parts] if key[0] else [tables.start()]
    margins = () if problem.free.demands else None
    asked = Asked((below,), margins)
    return passable.closed(len(key[0]), np.concatenate(rows), asked).states, tables


def _placed(problem: OrderProblem, key: Key, nodes: Ints) -> Iterator[tuple[Key, Ints]]:
    """Yield what follows by placing a brick, as nodes that are held: some more than once."""
    for brick in problem.next_bricks(key[0]) if len(nodes) else ():
        network = build_network(problem.scene, _order(problem, key, brick))
        tables = RuleTables(RuleBook(network, problem.free.free_rules), [])
        for move in tables.follow(len(key[0]), _places(tables, nodes)):
            if move.level > len(key[0]) and len(move.states):
                yield (key[0] | {brick}, brick), _nodes(tables, move.states)


def _order(problem: OrderProblem, key: Key, following: int | None = None) -> Order:
    """Return an order that begins with a set, its newest brick last, and maybe another one."""
    own, (stand, newest) = problem.scene.build_order, key
    first = [name for name in own if name in stand and name != newest]
    last = [newest] if stand else []
    last += [] if following is None else [following]
    return (*first, *last, *(name for name in own if name not in stand and name != following))


def _nodes(tables: Tables, states: Ints) -> Ints:
    """Return states with the nodes themselves for places in build order."""
    out = states.astype(np.int64)
    out[:, : tables.robots] = tables.nodes[states[:, : tables.robots]]
    return out


def _places(tables: Tables, states: Ints) -> Ints:
    """Return states of nodes as rows of tables of any order."""
    place = np.zeros(tables.nodes.max() + 2, dtype=np.int64)  # -1, who holds none, is the last
    place[tables.nodes] = np.arange(len(tables.nodes))
    out = states.astype(tables.start().dtype)
    out[:, : tables.robots] = place[states[:, : tables.robots]]
    return tables.in_order(out)
