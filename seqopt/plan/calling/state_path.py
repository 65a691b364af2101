"""What a formulation of free schedules answers."""

from __future__ import annotations

import operator
from dataclasses import dataclass, field

import numpy as np

from seqopt.arrays import FrozenValue, Ints
from seqopt.plan.calling.guard import readable, text

CLOSE = 1e-6  # over a value: how far a bound may be above it by rounding


@dataclass(frozen=True, eq=False, repr=False)
class StatePath(FrozenValue):
    """A free schedule, and what its formulation claims of it.

    ``states``: after every step: how many bricks stand, then the node that each robot holds, as a
    place in build order from 1; robots of one kind stand together, 0 for one that is free;
    ``objective``: claimed value of every goal; ``bound``: claimed lower bound of every goal, those
    before it being at their values; ``visited`` (tuple of (n, c) int): states that a better plan
    could pass, by brick count, if the formulation knows them: the proof looks at these together,
    and depends on them in nothing but its time; ``prices``: by goal, what a unit of every budget
    and of every sum before it is worth: they prove the bounds where there are budgets; ``stopped``:
    why the search ended before all was proven: ``time``, ``memory`` or ``interrupt``; empty if it
    did not.
    """

    states: tuple[tuple[int, ...], ...]
    objective: tuple[float, ...]
    bound: tuple[float, ...]
    visited: tuple[Ints, ...] = field(default=(), repr=False)
    prices: tuple[tuple[float, ...], ...] = ()
    stopped: str = ""


def with_numbers(name: str, found: StatePath, goals: int) -> StatePath:
    """Return a selection with numbers where numbers belong.

    ``name``: of the formulation that made it; ``goals``: how many goals there are. Raises
    `SolverError` if a number is none, or there are too few.
    """
    with readable(name):
        states = tuple(tuple(operator.index(n) for n in state) for state in found.states)
        objective, bound = (tuple(map(float, part)) for part in (found.objective, found.bound))
        if not len(objective) == len(bound) == goals or not states:
            raise ValueError(
                f"{len(states)} states, {len(objective)} values and {len(bound)} bounds for "
                f"{goals} goals"
            )
        if not all(b <= v + CLOSE * abs(v) for v, b in zip(objective, bound, strict=True)):
            raise ValueError("a value or bound is NaN, or a bound is above its value")
        visited = tuple(np.asarray(rows) for rows in found.visited)
        prices = tuple(tuple(map(float, each)) for each in found.prices)
        return StatePath(states, objective, bound, visited, prices, text(found.stopped))
