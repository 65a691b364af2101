"""A build as a graph: states, moves between them, and amounts of every move, as arrays.

In time, a path through states says which kind of robot takes a grip or lets go. Which of its robots
that are free acts is open, and so is when. A *label* of a state says when the last step ended, and
of every column whose robot is free since when it is. An *act* is a move with the column that acts.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import ProblemError

Rows = NDArray[np.int32]


@dataclass(frozen=True, eq=False, repr=False)
class Graph(FrozenValue):
    """States of a build and the moves between them; the first state is where the build starts.

    Parameters
    ----------
    source, target : (m,) int
        The states that every move leads from and to; moves are sorted by these.
    amounts : (m, g) float
        What every goal takes of every move; from 0 where amounts are added up.
    peaks : tuple of bool
        By goal: whether the largest amount on a path counts, or their sum.
    ends : (n,) bool
        The states in which a build may end.
    caps : tuple of float, optional
        What the sums of as many last columns may be at most.
    alone : (m, 2) float, optional
        What a search is charged that looks at the moves from one state alone, in two parts: what
        depends on the next state only, and what is shared with the move before (ranks are those
        among the moves from this state). By default the first amount.

    Raises
    ------
    ProblemError
        If an amount is no number, or negative where amounts are added up.
    """

    source: Rows
    target: Rows
    amounts: Floats
    peaks: tuple[bool, ...]
    ends: Bools
    caps: tuple[float, ...] = ()
    alone: Floats | None = None

    def __post_init__(self) -> None:
        sums = self.amounts[:, [not peak for peak in self.peaks]]
        if np.isnan(self.amounts).any():
            raise ProblemError("an amount is no number; give one for every move")
        if (sums < 0).any():
            raise ProblemError(
                f"a step adds {sums.min():.4g} to a sum: to repeat it would pay without end; ask "
                "for the worst value, or for a quantity that is never negative"
            )
        codes = self.source.astype(np.int64) * self.states + self.target
        if (np.diff(codes) < 0).any():
            order = np.argsort(codes, kind="stable")
            for name in ("source", "target", "amounts", "alone"):
                if getattr(self, name) is not None:
                    object.__setattr__(self, name, getattr(self, name)[order])
        for name in ("source", "target"):  # as csgraph wants them
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name)))
        super().__post_init__()

    @property
    def states(self) -> int:
        """How many states there are."""
        return len(self.ends)

    def __repr__(self) -> str:
        return f"<Graph: {self.states} states, {len(self.source)} moves, {len(self.peaks)} goals>"

    def only(self, kept: Bools) -> Graph:
        """Return the graph with some of its moves, (m,) bool; all its states stay."""
        if kept.all():
            return self
        alone = None if self.alone is None else self.alone[kept]
        return self._with(
            source=self.source[kept],
            target=self.target[kept],
            amounts=self.amounts[kept],
            alone=alone,
        )

    def bare(self, goal: int, states: Bools) -> Graph:
        """Return the moves from some states, (n,) bool, with the amounts of one goal alone.

        They lead to no others. States are numbered anew, in order; the start is one of them.
        """
        number, kept = np.cumsum(states, dtype=np.int32) - 1, states[self.source]
        return self._with(
            source=number[self.source[kept]],
            target=number[self.target[kept]],
            amounts=self.amounts[kept, goal : goal + 1],
            peaks=(self.peaks[goal],),
            ends=self.ends[states],
            caps=(),
            alone=None,
        )

    @property
    def goals(self) -> int:
        """Number of columns that are minimized, those with caps left out."""
        return len(self.peaks) - len(self.caps)

    def moves_from(self, state: int) -> slice:
        """Return which moves lead from a state."""
        first, last = np.searchsorted(self.source, np.array([state, state + 1], self.source.dtype))
        return slice(int(first), int(last))

    def _with(self, **changed: object) -> Graph:
        """Return a subgraph of checked arrays: it is not checked again."""
        part = object.__new__(Graph)
        own = {field.name: getattr(self, field.name) for field in fields(Graph)}
        part.__setstate__(own | changed)
        return part

    def matrix(self, costs: Floats, kept: Bools | None = None) -> sparse.csr_array:
        """Return costs (m,) of some of the moves, (m,) bool, from states to states, (n, n).

        Costs of zero are entries too, and so are all costs of moves side by side.
        """
        source, target = self.source, self.target
        if kept is not None:
            source, target, costs = source[kept], target[kept], costs[kept]
        starts = np.zeros(self.states + 1, dtype=np.int32)
        np.cumsum(np.bincount(source, minlength=self.states), out=starts[1:])
        shape = (self.states, self.states)
        return sparse.csr_array((costs, target, starts), shape=shape)


class LabelProof(NamedTuple):
    """Labels of a build in time that show that no path is better in one goal.

    Every successor of a label by one act is a label that another one of these
    dominates, or a bound by multipliers and sums to go says that it is no better.

    ``states`` (N, 1 + c): how many bricks stand, and entries of a state; ``labels`` (N,
    1 + c + q): when the last step ended, since when robots of columns are free, zero where they
    hold, and sums of budgets and of goals before; ``prices`` (L, 1 + c): of the time of all, and of
    the robots of columns.
    """

    states: Ints
    labels: Floats
    prices: Floats


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
