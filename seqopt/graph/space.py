"""What a graph is explored from: states in parts, parts on levels, and the moves between them.

A build is a path through states. Those of one *part* are rows of integers of equal width; a part
lies on a *level*, and every move stays within its part or leads to one of the next level. So a
space can be explored level by level, whole batches of states at a time, and only as far as a proof
needs it (`seqopt.graph._explore.Explorer`). Three spaces are built in
`seqopt.graph.states.explored`: the open grips of a schedule, free rules, and all orders of the
bricks, where a part is a set of bricks. Whatever has the members below is explored, solved and
judged in the same way: a puzzle without bricks is, in `tests/formulations/test_toy_space.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from seqopt.arrays import Bools, Floats, Ints

Key: TypeAlias = Any
"""Which part, whatever a space calls it; it can be hashed, and differs from level to level."""

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
        """Return a number (n,) for every state (n, c) that no other one of its part has."""

    def within(self, part: Key, states: Ints) -> Moves:
        """Return the moves from states (n, c) that stay within their part."""

    def onward(self, part: Key, states: Ints) -> Iterator[tuple[Key, Moves]]:
        """Yield the moves from states (n, c) that lead to the next level, by part."""

    def values(self, part: Key, states: Ints, *, rough: bool, most: float) -> tuple[Floats, Bools]:
        """Return what goals take of states (n, c), (n, g) in SI units, and which are allowed (n,).

        ``rough``: whether six digits are enough. ``most``: where there are floors, a state of which
        the first goal takes more need not have values that are larger than this.
        """

    def ended(self, part: Key, states: Ints) -> Bools:
        """Return in which states (n, c) of the last level a build may end, (n,)."""

    def amounts(self, values: Floats, taken: Floats) -> Floats:
        """Return what goals take of moves (m, g): of the states they lead to, and as of `Moves`."""
        return values

    @property
    def complete(self) -> bool:
        """Whether these are all moves that are allowed."""
        return True

    @property
    def floors(self) -> bool:
        """Whether values above those that count may be less than they are."""
        return False

    def stand(self, part: Key, states: Ints) -> Bools:
        """Return which states (n, c) pass what is too expensive to be asked of all, (n,)."""
        return np.ones(len(states), dtype=bool)

    def known(self, part: Key, states: Ints) -> Ints:
        """Return the same where it is known before it is asked: 1 passes, -1 does not, else 0."""
        return np.zeros(len(states), dtype=np.int64)

    @property
    def effort(self) -> tuple[int, int]:
        """Of orders that are sought, how many sets of bricks were looked at; grip sets solved."""
        return 0, 0

    def path(self, found: Found) -> tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]:
        """Return the bricks in the order of a path, empty where it is given, and its states.

        Each state is its level, then its numbers.
        """
        return (), tuple((level, *state.tolist()) for level, _, state in found)
