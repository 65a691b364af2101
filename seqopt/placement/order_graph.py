"""All orders of a free schedule at once: by which bricks stand, not by how many.

The states with a set of bricks, the newest of them known, are those of the free schedule in any
order that begins with the set and has this brick at its end. Sets of one size follow from those
with a brick less. An order is a way from the empty set to all bricks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.placement.free_graph import Arcs, Level, arcs_to, close_level
from seqopt.placement.free_paths import TIED, settle
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.order_problem import OrderProblem
from seqopt.scene.orders import Order
from seqopt.sequence.free_moves import Moves, sort_entries
from seqopt.sequence.free_team import node_numbers

Key = tuple[frozenset[int], int]  # bricks that stand, and the newest
Reached = dict[Key, tuple[Ints, Floats]]  # states, and the least worst value on a way to each


@dataclass(eq=False)
class Part:
    """The states with a set of bricks.

    Attributes
    ----------
    level : Level
        Kept states, values and moves among them.
    entries : list of (Key, Arcs)
        Moves that place the newest brick, and where they come from.
    least : (n,) float
        The least worst value on a way from the empty site to every state.
    """

    level: Level
    entries: list[tuple[Key, Arcs]]
    least: Floats


@dataclass(eq=False)
class OrderGraph:
    """The kept states of all sets of bricks that were reached.

    Attributes
    ----------
    problem : OrderProblem
    problems : dict of Key to FreeProblem
        In orders that begin with these sets; responses that are known stay known.
    parts : list of dict of Key to Part
        By how many bricks stand, from one.
    excluded : float
        The least value of a state that was left out for the ceiling.
    cut : bool
        Whether it ended early because there were too many sets.
    """

    problem: OrderProblem
    problems: dict[Key, FreeProblem]
    parts: list[dict[Key, Part]] = field(default_factory=list)
    excluded: float = np.inf
    cut: bool = False

    @property
    def bound(self) -> float:
        """What no order stays below, as far as sets were reached."""
        last = self.parts[-1].values() if self.parts else ()
        return min([self.excluded, *(float(part.least.min()) for part in last)])

    def ends(self, key: Key) -> Bools:
        """Return which states of all bricks end the build.

        Parameters
        ----------
        key : Key

        Returns
        -------
        (n,) bool
        """
        return self.problems[key].space.ended(self.parts[-1][key].level.states)

    def best(self) -> tuple[float, Key, int] | None:
        """Return the least worst value of any order, and the state in which it ends.

        Returns
        -------
        tuple of (float, Key, int) or None
            None where no order was found below the ceiling.
        """
        if len(self.parts) < len(self.problem.scene.bricks):
            return None
        worths = {
            key: np.where(self.ends(key), part.least, np.inf)
            for key, part in self.parts[-1].items()
        }
        value = min(float(worth.min()) for worth in worths.values())
        if not np.isfinite(value):
            return None
        tied = {key: worth <= _tied(value) for key, worth in worths.items()}
        key = min((key for key, rows in tied.items() if rows.any()), key=lambda key: key[1])
        return value, key, int(tied[key].argmax())

    def order(self, value: float, key: Key, row: int) -> Order:
        """Return the order of a way that stays within a value.

        Parameters
        ----------
        value : float
        key : Key
            Where the way ends.
        row : int
            In which state.

        Returns
        -------
        tuple of int
        """
        order, value = [key[1]], _tied(value)
        for parts in reversed(self.parts):
            part = parts[key]
            leading = _leading(part, row, value)
            key, row = next(
                (before, int(arcs.source[i]))
                for before, arcs in part.entries
                for i in np.flatnonzero(leading[arcs.target])
                if not before[0] or self._least(before)[arcs.source[i]] <= value
            )
            order.append(key[1])
        return tuple(order[-2::-1])

    def _least(self, key: Key) -> Floats:
        return self.parts[len(key[0]) - 1][key].least


def _tied(value: float) -> float:
    """Return up to what values count as one: none is better by an error of rounding."""
    return value + TIED * abs(value)


def _leading(part: Part, row: int, value: float) -> Bools:
    """Return which states lead to one within their set, through states within a value."""
    within = part.level.values[:, 0] <= value
    leading = np.zeros(len(within), dtype=bool)
    leading[row] = True
    inner, count = part.level.inner, 0
    while count < (count := int(leading.sum())):
        leading[inner.source[leading[inner.target]]] = True
        leading &= within
    return leading


def explore_orders(
    problem: OrderProblem,
    problems: dict[Key, FreeProblem],
    ceiling: float,
    most: int,
    tell: Callable[[int], None] = lambda _: None,
) -> OrderGraph:
    """Return all states of all orders that can be reached below a ceiling.

    Parameters
    ----------
    problem : OrderProblem
    problems : dict of Key to FreeProblem
        What earlier searches made; what is made now is added.
    ceiling : float
        The first goal must not take more of a state.
    most : int
        Of how many sets states are looked at; with more the graph ends early.
    tell : callable, optional
        Told how many bricks stand, set by set; may raise to end the search.

    Returns
    -------
    OrderGraph
    """
    graph = OrderGraph(problem, problems)
    empty: Key = (frozenset(), 0)
    if empty not in problems:
        problems[empty] = problem.judging(problem.scene.build_order)
    before: Reached = {empty: (problems[empty].space.start(), np.zeros(1))}
    looked = 0
    for bricks in range(1, len(problem.scene.bricks) + 1):
        coming = _following(problem, before)
        looked += len(coming)
        graph.cut = looked > most
        if graph.cut:
            return graph
        parts: dict[Key, Part] = {}
        for key, sources in coming.items():
            tell(bricks)
            parts[key] = _part(graph, key, {source: before[source] for source in sources}, ceiling)
        parts = {key: part for key, part in parts.items() if len(part.least)}
        if not parts:
            return graph
        graph.parts.append(parts)
        before = {key: (part.level.states, part.least) for key, part in parts.items()}
    return graph


def _following(problem: OrderProblem, before: Reached) -> dict[Key, list[Key]]:
    """Return the sets with one brick more, and which sets each follows from."""
    coming: dict[Key, list[Key]] = {}
    for key in before:
        for brick in problem.next_bricks(key[0]):
            coming.setdefault((key[0] | {brick}, brick), []).append(key)
    return coming


def _part(graph: OrderGraph, key: Key, sources: Reached, ceiling: float) -> Part:
    """Return the states with a set of bricks, reached from those with one less."""
    bricks, problem = len(key[0]), _problem(graph, key)
    moves: dict[Key, Moves] = {}
    for source, (states, _) in sources.items():
        known = _renumbered(graph.problems[source], problem, states)
        moves[source] = problem.space.places(bricks - 1, known)
    entry = np.concatenate([found.states for found in moves.values()])
    level, excluded = close_level(problem, bricks, entry, (ceiling, None))
    graph.excluded = min(graph.excluded, excluded)
    values = level.values[:, 0]
    least = np.full(len(values), np.inf)
    entries = []
    for source, found in moves.items():
        arcs = arcs_to(problem, found, level.states, regrip=False)
        entries.append((source, arcs))
        through = np.maximum(sources[source][1][arcs.source], values[arcs.target])
        np.minimum.at(least, arcs.target, through)
    least = settle(least, level.inner, values[level.inner.target], np.maximum)
    return Part(level, entries, least)


def _problem(graph: OrderGraph, key: Key) -> FreeProblem:
    """Return the free schedule in an order that begins with a set, its newest brick last."""
    if key not in graph.problems:
        own = graph.problem.scene.build_order
        first = [name for name in own if name in key[0] and name != key[1]]
        rest = [name for name in own if name not in key[0]]
        graph.problems[key] = graph.problem.judging((*first, key[1], *rest))
    return graph.problems[key]


def _renumbered(old: FreeProblem, new: FreeProblem, states: Ints) -> Ints:
    """Return states with the places that nodes have in another order."""
    place = {node: i for i, node in enumerate(node_numbers(new.network), start=1)}
    map_to = np.array([0, *(place[node] for node in node_numbers(old.network))])
    out, robots = states.copy(), old.space.robots
    out[:, :robots] = map_to[states[:, :robots]]
    for first, end in new.space.slots:
        sort_entries(out, first, end)
    return out
