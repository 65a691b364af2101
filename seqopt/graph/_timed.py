"""A graph in time: who may act on every arc, for how long, and what readiness states pass on.

A path through states says which kind of robot takes a grip or lets go. Which of its robots that are
free acts is open, and so is when. A *label* of a state says when the last step ended, and of every
column whose robot is free since when it is. An *act* is a move with the column that acts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.graph.graph import Graph

HELD, NOW = -1, -2  # where the readiness of a column comes from: it has none, the end of the act


@dataclass(frozen=True, eq=False, repr=False)
class TimedGraph(FrozenValue):
    """States, moves and acts of a build in time.

    Of states: ``levels`` (n,), of which no move leads to a lower one; ``free`` (n, c), of which
    columns the robots are; ``alike`` (n, c - 1), which columns could change places with the next
    one. ``kinds`` (c,): of the robot of every column; ``longest`` (c,): how long they take at most
    to be prepared, s. Of acts (a,): ``move``; ``column`` of the state before whose robot takes a
    grip, -1 where robots let go; ``origin`` (a, c): from which column of the state before the one
    after has its readiness, or `HELD`, `NOW`. Of moves: ``prepares``, ``acts`` (m,), s; ``work``
    (m, 1 + k): how long they take of the time of all, and of the robots of every kind, s:
    preparing, acting, and holding while others act. ``curing``: what mortar that cures asks for.
    """

    graph: Graph
    levels: Ints
    free: Bools
    alike: Bools
    kinds: Ints
    move: Ints
    column: Ints
    origin: Ints
    prepares: Floats
    acts: Floats
    work: Floats
    longest: Floats
    curing: Any = None  # of the room of times, which alone reads it

    @property
    def sizes(self) -> Ints:
        """How many there are to share the work: all as one, then robots of every kind, (1 + k,)."""
        return np.array([1, *np.bincount(self.kinds)])
