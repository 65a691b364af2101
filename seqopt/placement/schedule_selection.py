"""What a formulation of free schedules answers."""

from __future__ import annotations

from dataclasses import dataclass, field

from seqopt.arrays import FrozenValue, Ints


@dataclass(frozen=True, eq=False, repr=False)
class ScheduleSelection(FrozenValue):
    """A free schedule, and what its formulation claims of it.

    Attributes
    ----------
    states : tuple of tuple of int
        After every step: how many bricks stand, then the node that each robot holds, as a place in
        build order from 1; robots of one kind stand together, 0 for one that is free.
    objective : tuple of float
        Claimed value of every goal.
    bound : tuple of float
        Claimed lower bound of every goal, those before it being at their values.
    visited : tuple of (n, c) int
        States that a better plan could pass, by brick count, if the formulation knows them: the
        proof looks at these together, and depends on them in nothing but its time.
    stopped : str
        Why the search ended before all was proven: ``time``, ``memory`` or ``interrupt``; empty if
        it did not.
    """

    states: tuple[tuple[int, ...], ...]
    objective: tuple[float, ...]
    bound: tuple[float, ...]
    visited: tuple[Ints, ...] = field(default=(), repr=False)
    stopped: str = ""
