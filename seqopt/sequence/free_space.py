"""States of a free schedule, and the moves between them, many at a time.

A state is how many bricks stand and which node every robot holds. States of one brick count are
rows of integers, a column per robot, those of one kind side by side: 0 for a robot that is free, n
for one that holds the n-th node (from 1, brick by brick in build order). Robots of one kind could
change places, so their entries are sorted, largest first. A further column counts the grips
taken since the last brick where a rule limits these. Where travel counts, a free robot stays at
the node that it held last, -n.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, Terse, frozen
from seqopt.network.network import Network
from seqopt.sequence.free_moves import (
    Moves,
    grip_pairs,
    join_moves,
    number_rows,
    sort_entries,
)
from seqopt.sequence.free_rules import Ending, FreeRules, Newest
from seqopt.sequence.free_team import RobotKind
from seqopt.sequence.support import islands

PAIRS = 4_000_000  # of states and nodes that are looked at together


@dataclass(frozen=True, repr=False)
class FreeSpace(Terse):
    """The states of a free schedule and the moves between them.

    Parameters
    ----------
    network : Network
    rules : FreeRules
    kinds : tuple of RobotKind
        The robots that take part.
    parks : bool
        Whether free robots stay where they were, for their travel.
    """

    network: Network
    rules: FreeRules
    kinds: tuple[RobotKind, ...]
    parks: bool = False

    @property
    def robots(self) -> int:
        """How many robots take part."""
        return sum(len(kind.robots) for kind in self.kinds)

    @property
    def bricks(self) -> int:
        """How many bricks there are."""
        return len(self.network.inner)

    @property
    def levels(self) -> int:
        """How many bricks there are: states of one brick count are a level."""
        return self.bricks

    def bricks_at(self, level: int) -> int:
        """Return how many bricks stand on a level."""
        return level

    def within(self, level: int, states: Ints) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves that place no brick, and whether they are regrips."""
        return (self.releases(level, states), False), (self.holds(level, states), True)

    def onward(self, level: int, states: Ints) -> tuple[tuple[Moves, bool], ...]:
        """Return the moves that place the next brick: none of them is a regrip."""
        return ((self.places(level, states), False),)

    @cached_property
    def slots(self) -> tuple[tuple[int, int], ...]:
        """First column of every kind, and the one after its last."""
        ends = np.cumsum([len(kind.robots) for kind in self.kinds]).tolist()
        return tuple(zip([0, *ends[:-1]], ends, strict=True))

    @cached_property
    def _counts(self) -> bool:
        return self.rules.regrips is not None

    @cached_property
    def _distance(self) -> Floats:
        """Distances of nodes, (2B + 1, 2B + 1), m; none from or to node 0."""
        at = self.network.node_position[self.network.inner.ravel()]
        out = np.zeros((len(at) + 1,) * 2)
        out[1:, 1:] = np.linalg.norm(at[:, None] - at[None], axis=2)
        return frozen(out)

    def start(self) -> Ints:
        """Return the one state before the first brick.

        Returns
        -------
        (1, c) int
            Of the smallest type that holds every node: there may be tens of millions of states.
        """
        kind = np.min_scalar_type(-max(2 * self.bricks, self.rules.regrips or 0) - 1)
        return np.zeros((1, self.robots + self._counts), dtype=kind)

    def codes(self, states: Ints) -> Ints:
        """Return a number for every state that no other one of its brick count has.

        Parameters
        ----------
        states : (n, c) int

        Returns
        -------
        (n,) int
        """
        last = 2 * self.bricks
        return number_rows(states, self.robots, -last if self.parks else 0, last)

    def held(self, states: Ints) -> Ints:
        """Return which nodes are held, sorted, zeros for robots that are free first.

        Parameters
        ----------
        states : (n, c) int

        Returns
        -------
        (n, robots) int
        """
        return np.sort(states[:, : self.robots].clip(min=0), axis=1)

    def grips(self, states: Ints) -> Ints:
        """Return how many grips are held.

        Parameters
        ----------
        states : (n, c) int

        Returns
        -------
        (n,) int
        """
        return np.asarray((states[:, : self.robots] > 0).sum(axis=1))

    def places(self, bricks: int, states: Ints) -> Moves:
        """Return the moves that place the next brick; a free robot then holds it.

        Parameters
        ----------
        bricks : int
            How many bricks stand before.
        states : (n, c) int

        Returns
        -------
        Moves
            To lawful states.
        """
        nodes = np.array([2 * bricks, 2 * bricks + 1])
        parts = []
        for k, kind in enumerate(self.kinds):
            if kind.places:
                parts += self._take(k, states, nodes[kind.newest[nodes]])
        moves = join_moves(parts, states)
        if self._counts:
            moves.states[:, -1] = 0
        return self._lawful_only(bricks + 1, moves)

    def holds(self, bricks: int, states: Ints) -> Moves:
        """Return the moves in which a free robot takes a grip on a brick that stands.

        Parameters
        ----------
        bricks : int
        states : (n, c) int

        Returns
        -------
        Moves
            To lawful states, as many of them as rules allow.
        """
        able = self.lawful(bricks, states)
        if self.rules.regrips is not None:
            able &= states[:, -1] < self.rules.regrips
        rows = np.flatnonzero(able)
        parts = []
        for k, kind in enumerate(self.kinds):
            parts += self._take(k, states[rows], np.flatnonzero(kind.reach[: 2 * bricks]))
        moves = join_moves(parts, states)
        if self._counts:
            moves.states[:, -1] += 1
        return Moves(rows[moves.source], moves.states, moves.way)

    def releases(self, bricks: int, states: Ints) -> Moves:
        """Return the moves in which one robot lets go, or at the end all do.

        Parameters
        ----------
        bricks : int
        states : (n, c) int

        Returns
        -------
        Moves
            To lawful states, and at the last brick to those that the rules' ending allows.
        """
        parts = []
        for first, end in self.slots:
            for slot in range(first, end):
                rows = np.flatnonzero(states[:, slot] > 0)
                new = states[rows]
                new[:, slot] = -new[:, slot] if self.parks else 0
                sort_entries(new, first, end)
                parts.append(Moves(rows, new, np.zeros(len(rows))))
        moves = join_moves(parts, states)
        if bricks < self.bricks or self.rules.ending is not Ending.ONE_BY_ONE:
            moves = self._lawful_only(bricks, moves)
        if bricks < self.bricks or self.rules.ending is Ending.HELD:
            return moves
        return self._let_go(bricks, states, moves)

    def lawful(self, bricks: int, states: Ints) -> Bools:
        """Return which states keep the rules as long as the build goes on.

        Parameters
        ----------
        bricks : int
        states : (n, c) int

        Returns
        -------
        (n,) bool
        """
        held = states[:, : self.robots]
        ok = np.asarray(self.grips(states) >= (self.rules.least_grips if bricks > 1 else 0))
        if self.rules.newest is not Newest.FREE:
            nodes = 2 * bricks + np.array([-1, 0])
            newest = np.zeros(len(states), dtype=bool)
            for kind, (first, end) in zip(self.kinds, self.slots, strict=True):
                for node in nodes[kind.newest[nodes - 1]]:
                    newest |= (held[:, first:end] == node).any(axis=1)
            ok &= newest
        for bricks_of in self._loose[bricks]:
            ok &= np.isin((held - 1) // 2, bricks_of).any(axis=1)
        return ok

    def ended(self, states: Ints) -> Bools:
        """Return which states with all bricks end the build.

        Parameters
        ----------
        states : (n, c) int

        Returns
        -------
        (n,) bool
        """
        if self.rules.ending is Ending.HELD:
            return self.lawful(self.bricks, states)
        return np.asarray((states[:, : self.robots] <= 0).all(axis=1))

    def _let_go(self, bricks: int, states: Ints, moves: Moves) -> Moves:
        """Return the moves and those in which all let go; who lets go forgets where it was."""
        if self.rules.ending is Ending.RELEASED:
            rows = np.flatnonzero((states[:, : self.robots] > 0).any(axis=1))
            none = states[rows]
            none[:, : self.robots] = 0
            parts = [moves, Moves(rows, none, np.zeros(len(rows)))]
            moves = join_moves(parts, states)
        bare = (moves.states[:, : self.robots] <= 0).all(axis=1)
        moves.states[bare, : self.robots] = 0
        return moves

    @property
    def _free_grips(self) -> tuple[int, Floats | None]:
        """How many columns are robots, and distances where ways count."""
        return self.robots, self._distance if self.parks else None

    @cached_property
    def _loose(self) -> tuple[list[list[int]], ...]:
        """By brick count the parts that no joint ties to the ground: places in build order."""
        at = {brick.name: i for i, brick in enumerate(self.network.scene.placed)}
        counts = range(1, self.bricks + 1)
        parts = ((), *(islands(self.network, count) for count in counts))
        return tuple([[at[name] for name in part] for part in level] for level in parts)

    def _take(self, k: int, states: Ints, nodes: Ints) -> list[Moves]:
        """Return the moves in which a free robot of a kind takes one of some nodes."""
        first, end = self.slots[k]
        slots = range(first, end) if self.parks else [end - 1]  # entries are sorted
        step = max(1, PAIRS // max(1, len(nodes)))
        parts = []
        for slot in slots if len(nodes) else ():
            free = states[:, slot] <= 0
            if slot > first and self.parks:  # one of two that stay at one node
                free &= states[:, slot] != states[:, slot - 1]
            rows = np.flatnonzero(free)
            for start in range(0, len(rows), step):
                block = rows[start : start + step]
                moves = grip_pairs(states[block], slot, nodes, self._free_grips)
                sort_entries(moves.states, first, end)
                parts.append(Moves(block[moves.source], moves.states, moves.way))
        return parts

    def _lawful_only(self, bricks: int, moves: Moves) -> Moves:
        ok = self.lawful(bricks, moves.states)
        return Moves(moves.source[ok], moves.states[ok], moves.way[ok])
