"""What no order stays below, because all of them end with the same bricks."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.graph.orders.orders import AllOrders
from seqopt.graph.states.states import States
from seqopt.problem.goals import LARGEST, Measure
from seqopt.sequence.free_rules import Ending
from seqopt.sequence.free_space import node_numbers

MOST_SETS = 200_000  # grip sets of the whole structure that are looked at


def whole_bound(problem: AllOrders) -> float:
    """Return the least value with which all bricks stand, whoever holds them.

    Every plan of every order passes such a state, and the one in which nobody holds if it ends so.

    Result: minus infinity where there are too many grip sets to look at.
    """
    free = problem.judging(problem.scene.build_order)
    if free.goals[0].measure is not Measure.PEAK:
        return -np.inf
    numbers = node_numbers(free.network)
    places = [i for i, n in enumerate(numbers, 1) if n not in problem.scene.blocked_nodes]
    least = -np.inf
    sets = _sets(places, max(1, free.free_rules.least_grips), free.space.robots)
    if len(sets):
        least = float(_values(free, sets).min())
    if free.free_rules.ending is not Ending.HELD:
        least = max(least, float(_values(free, np.zeros((1, free.space.robots), int))[0]))
    return least


def _sets(places: list[int], fewest: int, robots: int) -> Ints:
    """Return all grip sets, zeros for robots that are free first; none if they are too many."""
    rows: list[tuple[int, ...]] = []
    for count in range(fewest, robots + 1):
        for nodes in combinations(places, count):
            rows.append((*[0] * (robots - count), *nodes))
            if len(rows) > MOST_SETS:
                return np.zeros((0, robots), dtype=np.int64)
    return np.array(rows, dtype=np.int64).reshape(-1, robots)


def _values(free: States, held: Ints) -> Floats:
    """Return what the goal takes of grip sets of the whole; infinite where something is loose."""
    bricks, goal = len(free.network.inner), free.goals[0]
    answers, forces = free.sets.answers(bricks, held)
    names = [name for name in free.named if name != LARGEST]
    found = dict(zip(names, answers.T, strict=True)) | {LARGEST: forces.max(axis=1, initial=0.0)}
    loose = ~np.isfinite(answers).all(axis=1)
    finite = {name: np.where(loose, 0.0, values) for name, values in found.items()}
    if goal.response:
        return np.where(loose, np.inf, finite[goal.response])
    return np.where(loose, np.inf, free.criterion.costs(finite, bricks, len(held)))
