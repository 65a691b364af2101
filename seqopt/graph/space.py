"""What a graph is explored from: states in parts, parts on levels, and the moves between them.

A build is a path through states. Those of one *part* are rows of integers of equal width; a part
lies on a *level*, and every move stays within its part or leads to one of the next level. So a
space can be explored level by level, whole batches of states at a time, and only as far as a proof
needs it (`seqopt.graph._explore.Explorer`). Three spaces are built in
`seqopt.graph.states.explored`: the open grips of a schedule, free rules, and all orders of the
bricks, where a part is a set of bricks. Anything with the members below is explored, solved and
judged in the same way: a puzzle without bricks is, in
`tests/formulations/test_free_formulations.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from seqopt.arrays import Bools, Floats, Ints

Key: TypeAlias = Any
"""Key of a part, of any kind that the space uses: hashable, and different in every level."""

Found: TypeAlias = Sequence[tuple[int, Key, Ints]]
"""Level, part and state (c,) of all states of a path, the start left out."""


class Moves(NamedTuple):
    """Moves from states of one part to states of one part.

    Attributes
    ----------
    source : (m,) int
        Row of the state that each leads from, among those that were asked for.
    states : (m, c) int
        The states that they lead to.
    taken : (m, k) float
        What they take of amounts that are about moves, as `Space.amounts` reads it.
    """

    source: Ints
    states: Ints
    taken: Floats


class Space(Protocol):
    """States and moves that an explorer visits.

    What a class needs has no body here; the rest says what is so unless a class says otherwise:
    all moves are there, all values exact, and every state passes.
    """

    @property
    def first(self) -> int:
        """The level on which builds begin, from 0."""

    @property
    def levels(self) -> int:
        """The last level, on which builds may end."""

    @property
    def peaks(self) -> tuple[bool, ...]:
        """By goal, whether the largest amount on a path counts, not the sum."""

    def start(self) -> tuple[Key, Ints]:
        """Return the first part and its only state (1, c)."""

    def codes(self, part: Key, states: Ints) -> Ints:
        """Return a number for every state that no other one of its part has.

        Parameters
        ----------
        part : hashable
            Of which the states are.
        states : (n, c) int
            A state a row.

        Returns
        -------
        (n,) int
        """

    def within(self, part: Key, states: Ints) -> Moves:
        """Return the moves from states that stay within their part.

        Parameters
        ----------
        part : hashable
            Of which the states are.
        states : (n, c) int
            A state a row.

        Returns
        -------
        Moves
        """

    def onward(self, part: Key, states: Ints) -> Iterator[tuple[Key, Moves]]:
        """Yield the moves from states that lead to the next level, by part.

        Parameters
        ----------
        part : hashable
            Of which the states are.
        states : (n, c) int
            A state a row.

        Yields
        ------
        tuple of (hashable, Moves)
        """

    def values(self, part: Key, states: Ints, *, rough: bool, most: float) -> tuple[Floats, Bools]:
        """Return the values of goals in states, and which states are feasible.

        Parameters
        ----------
        part : hashable
            Of which the states are.
        states : (n, c) int
            A state a row.
        rough : bool
            Whether single precision is enough.
        most : float
            Where there are lower bounds, values of a state in which the first goal is larger may be
            lower bounds above this.

        Returns
        -------
        tuple of ((n, g) float, (n,) bool)
            Values in SI units.
        """

    def ended(self, part: Key, states: Ints) -> Bools:
        """Return in which states of the last level a build may end.

        Parameters
        ----------
        part : hashable
            Of which the states are.
        states : (n, c) int
            A state a row.

        Returns
        -------
        (n,) bool
        """

    def amounts(self, values: Floats, taken: Floats) -> Floats:
        """Return the values of goals of moves.

        Parameters
        ----------
        values : (m, g) float
            Of the states that the moves lead to.
        taken : (m, k) float
            As of `Moves`.

        Returns
        -------
        (m, g) float
        """
        return values

    def to_go(self, part: Key, states: Ints) -> Floats | None:
        """Return lower bounds of the second goal from states to an end; None if it is no count.

        It is a count if every move takes one of it; no move may lower the bound by more.

        Parameters
        ----------
        part : hashable
            Of which the states are.
        states : (n, c) int
            A state a row.

        Returns
        -------
        (n,) float or None
        """
        return None

    @property
    def complete(self) -> bool:
        """Whether these are all feasible moves."""
        return True

    @property
    def floors(self) -> bool:
        """Whether values above the limit may be lower bounds, not exact."""
        return False

    def stand(self, part: Key, states: Ints) -> Bools:
        """Return which states pass the tests that are too expensive for all states.

        Parameters
        ----------
        part : hashable
            Of which the states are.
        states : (n, c) int
            A state a row.

        Returns
        -------
        (n,) bool
        """
        return np.ones(len(states), dtype=bool)

    def known(self, part: Key, states: Ints) -> Ints:
        """Return the cached verdicts of `stand`.

        Parameters
        ----------
        part : hashable
            Of which the states are.
        states : (n, c) int
            A state a row.

        Returns
        -------
        (n,) int
            1 where a state passes, -1 where it does not, 0 where that is open.
        """
        return np.zeros(len(states), dtype=np.int64)

    @property
    def effort(self) -> tuple[int, int]:
        """In a search of orders, numbers of sets of bricks visited and of grip sets solved."""
        return 0, 0

    def path(self, found: Found) -> tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]:
        """Return the order of bricks on a path, and its states.

        Parameters
        ----------
        found : sequence of (int, hashable, (c,) int)
            Level, part and state of all states of the path, the start left out.

        Returns
        -------
        tuple of (tuple of int, tuple of tuple of int)
            The order is empty where it is given; each state is its level, then its numbers.
        """
        return (), tuple((level, *state.tolist()) for level, _, state in found)
