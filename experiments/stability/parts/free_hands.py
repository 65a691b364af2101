"""How far robots that reach everything can build, if every state of a build must stand."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from seqopt.arrays import Ints
from seqopt.stability.screens import Screen

Sets = frozenset[frozenset[int]]


def reached(screen: Screen, robots: int, *, proven: bool) -> int:
    """Return how many bricks can be placed by robots that hold and release wherever they like.

    Between two states one grip is taken or let go; a brick is placed by a robot that is free, and
    held by it at either node. Payloads are the scene's; reach counts for nothing, so that no
    schedule of as many robots of less reach comes farther.

    Parameters
    ----------
    screen : Screen
    robots : int
    proven : bool
        Whether a state must be proven to stand; else it must not be proven to fall.
    """
    before: Sets = frozenset([frozenset()])
    total = len(screen.network.inner)
    for bricks in range(1, total + 1):
        new = {2 * bricks - 1, 2 * bricks}
        placed = {held | {node} for held in before if len(held) < robots for node in new}
        fit = _standing(screen, bricks, robots, proven=proven)
        before = _connected(fit, frozenset(placed) & fit)
        if not before:
            return bricks - 1
    return total


def _standing(screen: Screen, bricks: int, robots: int, *, proven: bool) -> Sets:
    """Return the sets of nodes with which a partial structure stands."""
    every = [
        held
        for count in range(robots + 1)
        for held in combinations(range(1, 2 * bricks + 1), count)
    ]
    rows: Ints = np.array([held + (0,) * (robots - len(held)) for held in every])
    found = screen.stands(bricks, rows)
    kept = found == 1 if proven else found != -1
    return frozenset(frozenset(every[i]) for i in np.flatnonzero(kept))


def _connected(fit: Sets, start: Sets) -> Sets:
    """Return the sets that grips taken and let go one at a time lead to."""
    nodes = frozenset().union(*fit) if fit else frozenset[int]()
    seen, front = set(start), set(start)
    while front:
        steps = {held - {node} for held in front for node in held}
        steps |= {held | {node} for held in front for node in nodes - held}
        front = {held for held in steps if held in fit and held not in seen}
        seen |= front
    return frozenset(seen)
