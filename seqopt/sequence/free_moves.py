"""Moves of a free schedule as rows of integers: many states at a time, without the rules."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints


class Moves(NamedTuple):
    """Moves from states of one brick count.

    Attributes
    ----------
    source : (m,) int
        Row of the state that each leads from.
    states : (m, c) int
        The states that they lead to.
    way : (m,) float
        How far the robot goes that takes a grip, m; zero where ways do not count.
    """

    source: Ints
    states: Ints
    way: Floats


def grip_pairs(
    states: Ints, slot: int, nodes: Ints, robots_and_ways: tuple[int, Floats | None]
) -> Moves:
    """Return the moves in which the robot of a column takes one of some nodes that nobody holds.

    Parameters
    ----------
    states : (n, c) int
        In which that robot is free.
    slot : int
        Its column.
    nodes : (m,) int
        From 0.
    robots_and_ways : tuple
        How many columns are robots; distances between nodes, (2B + 1, 2B + 1), m, or None where
        ways do not count.

    Returns
    -------
    Moves
        The entries of a kind are not sorted.
    """
    robots, distance = robots_and_ways
    taken = np.zeros((len(states), int(max(nodes.max() + 1, states[:, :robots].max())) + 1), bool)
    for column in range(robots):
        taken[np.arange(len(states)), states[:, column].clip(min=0)] = True
    source, node = np.nonzero(~taken[:, nodes + 1])
    number = nodes[node] + 1
    new = states[source]
    way = np.zeros(len(new)) if distance is None else distance[-new[:, slot], number]
    new[:, slot] = number
    return Moves(source, new, way)


def sort_entries(states: Ints, first: int, end: int) -> None:
    """Sort the entries of the robots of a kind, largest first, in place.

    Parameters
    ----------
    states : (n, c) int
    first, end : int
        Its first column, and the one after its last.
    """
    if end - first > 1:
        states[:, first:end] = -np.sort(-states[:, first:end], axis=1)


def join_moves(parts: Sequence[Moves], states: Ints) -> Moves:
    """Return several moves as one.

    Parameters
    ----------
    parts : sequence of Moves
    states : (n, c) int
        That they lead from.
    """
    none = np.zeros(0, dtype=np.int64)
    whole = [Moves(none, states[:0], np.zeros(0)), *parts]
    return Moves(*map(np.concatenate, zip(*whole, strict=True)))


def number_rows(states: Ints, robots: int, least: int, most: int) -> Ints:
    """Return a number for every state that no other one has.

    Parameters
    ----------
    states : (n, c) int
        Columns after those of robots count first.
    robots : int
        How many columns are robots.
    least, most : int
        Between which their entries are.

    Returns
    -------
    (n,) int
    """
    further = states.shape[1] > robots
    out = np.zeros(len(states), dtype=np.int64)
    out += states[:, -1] if further else 0
    for column in range(robots):
        out *= 1 + most - least
        out += states[:, column]
        out -= least
    return np.asarray(out)
