"""What generators share: joint laws, checked numbers, robots, orders that touch, herringbone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from heapq import heapify, heappop, heappush

import numpy as np

from seqopt.arrays import Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import (
    MOST_BRICKS,
    as_float,
    check,
    kind_of,
    positive,
    stiffness,
    unless_none,
)
from seqopt.scene.arch import STANDARD_GRAVITY
from seqopt.scene.parts import Brick, Robot


@dataclass(frozen=True, kw_only=True)
class JointLaw:
    """The stiffness of a joint per area of the face over which its bricks meet.

    ``translational``: along the joint's normal and across it twice, N/m per m²; ``rotational``:
    about the same axes, N m/rad per m². By default what a bed of the translational stiffness over
    the face resists: it grows with the face's second moments of area. Raises `SceneError` if a
    number is not finite or negative.

    Examples
    --------
    >>> law = JointLaw(translational=(1.5e9, 1.5e8, 1.5e8))
    >>> [f"{k:.4g}" for k in law.stiffness(0.02, (2e-5, 7e-5))[0]]
    ['3e+07', '3e+06', '3e+06']
    """

    translational: Vector
    rotational: Vector | None = None

    def __post_init__(self) -> None:
        check(self, "joint law", translational=stiffness, rotational=unless_none(stiffness))

    def stiffness(self, area: float, moments: tuple[float, float]) -> tuple[Vector, Vector]:
        """Return the stiffness of a joint over a face, N/m and N m/rad.

        ``area``: m²; ``moments``: second moments of area about the two axes across the normal, m⁴.
        """
        normal, one, other = self.translational
        first, second = moments
        turning = (one * first + other * second, normal * first, normal * second)
        if self.rotational is not None:
            turn, bend, tilt = self.rotational
            turning = (area * turn, area * bend, area * tilt)
        return (area * normal, area * one, area * other), turning

    def over_rectangle(self, width: float, depth: float) -> tuple[Vector, Vector]:
        """Return the stiffness of a joint over a rectangle; sides in m."""
        area = width * depth
        return self.stiffness(area, (area * depth**2 / 12, area * width**2 / 12))


# of the domes that Bruun et al. built later
MASONRY = JointLaw(translational=(1.5e9, 1.5e8, 1.5e8))
DOWN = np.array([0.0, 0.0, -1.0])
a_law = partial(kind_of, kind=JointLaw)


def mobile_robots(bricks: Sequence[Brick], count: int = 3) -> tuple[Robot, ...]:
    """Return robots that reach everything, each of which can bear all bricks."""
    weight = STANDARD_GRAVITY * math.fsum(brick.mass for brick in bricks)
    return tuple(Robot(name=f"rob{i}", payload=weight) for i in range(1, count + 1))


def touching_order(
    rank: Sequence[float | tuple[float, ...]],
    pairs: Iterable[tuple[int, int]],
    starts: Iterable[int],
) -> list[int]:
    """Return an order in which everything touches what stands before it, or the ground.

    Of what can be placed, the lowest ``rank`` is next; what cannot be reached is left out.
    """
    beside: list[set[int]] = [set() for _ in rank]
    for a, b in pairs:
        beside[a].add(b)
        beside[b].add(a)
    seen, order = {*starts}, list[int]()
    ready = [(rank[i], i) for i in seen]
    heapify(ready)
    while ready:
        i = heappop(ready)[1]
        order.append(i)
        for j in beside[i] - seen:
            seen.add(j)
            heappush(ready, (rank[j], j))
    return order


def few_enough(where: str, bricks: int) -> None:
    """Require a structure of at most `MOST_BRICKS`."""
    if bricks > MOST_BRICKS:
        raise SceneError(f"{where}: {bricks} bricks; give numbers that make at most {MOST_BRICKS}")


def joint_width(where: str, value: float) -> float:
    """Return the width of a joint, which may be none."""
    return 0.0 if as_float(value) == 0 else positive(where, value, "m, or 0")


REPEAT = 4  # rows and columns after which a herringbone repeats


@dataclass(frozen=True)
class Tile:
    """Two cells of a herringbone, covered by one brick that lies along its rows or across.

    Rows are counted along the structure, columns across it; the given cell has the smaller numbers.
    """

    row: int
    column: int
    along: bool

    @property
    def cells(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Row and column of both cells."""
        other = (self.row + 1, self.column) if self.along else (self.row, self.column + 1)
        return (self.row, self.column), other

    @property
    def middle(self) -> tuple[float, float]:
        """Where its middle is, in rows and columns; a column is counted at its middle."""
        if self.along:
            return self.row + 1.0, float(self.column)
        return self.row + 0.5, self.column + 0.5


def tiles(rows: int, columns: Iterable[int]) -> list[Tile]:
    """Return the tiles of a herringbone whose first cells are in some columns, between two edges.

    With k = (row + column) mod 4 a tile along covers the cells k = 0 and 1 of a column, one across
    k = 2 and the cell k = 3 in the next. A tile that would cross an edge is left out.
    """
    out = []
    for column in columns:
        for row in range(rows):
            place = (row + column) % REPEAT
            if place == 2 or (place == 0 and row + 1 < rows):
                out.append(Tile(row, column, along=place == 0))
    return out


def neighbors(chosen: Sequence[Tile]) -> list[tuple[int, int]]:
    """Return which tiles share an edge of a cell: their places, each pair once, ascending."""
    owner = {cell: i for i, tile in enumerate(chosen) for cell in tile.cells}
    beside = [
        (i, owner.get(cell, i))
        for (row, column), i in owner.items()
        for cell in ((row + 1, column), (row, column + 1))
    ]
    return sorted({(min(pair), max(pair)) for pair in beside if pair[0] != pair[1]})
