"""What may follow from many states of a free schedule at once, looked up in a book of rules.

The book says in plain words which nodes a robot may hold and what a state must keep to; here its
words are tables. A state is a row: the place in build order of the node that each robot of the team
holds, from 1, zero for a robot that is free; then how many grips were taken since the last brick
where that counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from seqopt.arrays import Bools, Ints
from seqopt.sequence.free_check import RuleBook
from seqopt.sequence.free_rules import Ending, Newest
from seqopt.sequence.support import islands


class RuleTables:
    """A book of rules for many states at once.

    Parameters
    ----------
    book : RuleBook
    groups : sequence of tuple of int
        Robots that could change places, by their indices: of these the entries are sorted.
    """

    def __init__(self, book: RuleBook, groups: Sequence[tuple[int, ...]]) -> None:
        self._rules, placed = book.rules, book.network.scene.placed
        self.last = len(placed)
        self.nodes = np.array([-1, *(node for brick in placed for node in brick.nodes)])
        place = {node: i for i, node in enumerate(self.nodes.tolist())}
        self._groups = [[book.team.index(r) for r in group] for group in groups]
        names = [book.network.scene.robots[r].name for r in book.team]
        self._able = [not self._rules.placers or name in self._rules.placers for name in names]
        self._reach, self._newest, self._parts = [], [], []
        for b in range(self.last + 1):
            reached = [book.reached[r, b] for r in book.team]
            newest = [book.newest_nodes[r, b] if b else () for r in book.team]
            self._reach.append([[place[node] for node in nodes] for nodes in reached])
            self._newest.append([[place[node] for node in nodes] for nodes in newest])
            self._parts.append(list(self._held_parts(book, b)))

    def _held_parts(self, book: RuleBook, bricks: int) -> Iterator[Bools]:
        """Yield for every part that nothing ties to the ground which places belong to it."""
        owner = book.network.scene.brick_of_node
        for part in islands(book.network, bricks) if bricks else ():
            yield np.array([n >= 0 and owner[n].name in part for n in self.nodes.tolist()])

    @property
    def robots(self) -> int:
        """How many robots take part."""
        return len(self._able)

    def start(self) -> Ints:
        """Return the state before the first brick.

        Returns
        -------
        (1, c) int
        """
        columns = self.robots + (self._rules.regrips is not None)
        return np.zeros((1, columns), dtype=np.int32)

    def follow(self, bricks: int, states: Ints) -> Iterator[tuple[int, Ints]]:
        """Yield what follows from some of the states, by one step each.

        Parameters
        ----------
        bricks : int
        states : (n, c) int

        Yields
        ------
        bricks : int
        states : (m, c) int
            Some of them more than once.
        """
        keeps = self.keep(bricks, states) if bricks else np.ones(len(states), dtype=bool)
        able = states[keeps]
        if bricks and self._rules.regrips is not None:
            able = able[able[:, -1] < self._rules.regrips]
        for robot in self._takers() if bricks else ():
            after = self._taken(able, robot, self._reach[bricks][robot])
            after[:, self.robots :] += 1
            yield bricks, self._sorted(after)
        yield from ((bricks, self._sorted(part)) for part in self._released(bricks, states))
        if bricks == self.last:
            return
        for robot in self._takers():
            if self._able[robot]:
                after = self._taken(states[keeps], robot, self._newest[bricks + 1][robot])
                after[:, self.robots :] = 0
                yield bricks + 1, self._sorted(after[self.keep(bricks + 1, after)])

    def _taken(self, states: Ints, robot: int, places: Sequence[int]) -> Ints:
        """Return the states after a robot that is free took one of the places that nobody holds."""
        free = states[states[:, robot] == 0]
        parts = [free[:0]]
        for place in places:
            after = free[~(free[:, : self.robots] == place).any(axis=1)]
            after[:, robot] = place
            parts.append(after)
        return np.concatenate(parts)

    def _takers(self) -> Iterator[int]:
        """Yield the robots of which one could take a grip: of a group the last, if it is free."""
        first = {robot for group in self._groups for robot in group[:-1]}
        yield from (robot for robot in range(self.robots) if robot not in first)

    def _released(self, bricks: int, states: Ints) -> Iterator[Ints]:
        """Yield the states after one robot let go, or at the end all."""
        ending = self._rules.ending
        for robot in range(self.robots):
            after = states[states[:, robot] > 0]
            after[:, robot] = 0
            if not (bricks == self.last and ending is Ending.ONE_BY_ONE):
                after = after[self.keep(bricks, after)]
            yield after
        if bricks == self.last and ending is Ending.RELEASED:
            after = states[(states[:, : self.robots] > 0).any(axis=1)]
            after[:, : self.robots] = 0
            yield after

    def keep(self, bricks: int, states: Ints) -> Bools:
        """Return which states keep the rules as long as the build goes on.

        Parameters
        ----------
        bricks : int
            From 1.
        states : (n, c) int

        Returns
        -------
        (n,) bool
        """
        grips = states[:, : self.robots]
        ok = np.ones(len(states), dtype=bool)
        if bricks > 1:
            ok &= np.count_nonzero(grips, axis=1) >= self._rules.least_grips
        if self._rules.newest is not Newest.FREE:
            held = [np.isin(grips[:, r], self._newest[bricks][r]) for r in range(self.robots)]
            ok &= np.any(held, axis=0)
        for part in self._parts[bricks]:
            ok &= part[grips].any(axis=1)
        return ok

    def ends(self, bricks: int, states: Ints) -> Bools:
        """Return which states end the build.

        Parameters
        ----------
        bricks : int
        states : (n, c) int

        Returns
        -------
        (n,) bool
        """
        if bricks < self.last:
            return np.zeros(len(states), dtype=bool)
        if self._rules.ending is Ending.HELD:
            return self.keep(bricks, states)
        return np.asarray(~states[:, : self.robots].any(axis=1))

    def codes(self, states: Ints) -> Ints:
        """Return a number for every state that no other one of its brick count has.

        Parameters
        ----------
        states : (n, c) int

        Returns
        -------
        (n,) int
        """
        bases = [len(self.nodes)] * self.robots + [2 + (self._rules.regrips or 0)]
        weights = np.cumprod([1, *bases[: states.shape[1] - 1]], dtype=np.int64)
        return np.asarray(states @ weights)

    def _sorted(self, states: Ints) -> Ints:
        """Return states with the entries of robots that could change places sorted."""
        for group in self._groups:
            states[:, group] = np.sort(states[:, group], axis=1)[:, ::-1]
        return states
