"""What generators of scenes share: joint laws, checked numbers, robots, an order that touches."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Vector
from seqopt.errors import SceneError
from seqopt.scene.checks import positive, short, vector
from seqopt.scene.parts import Brick, Robot

REPEAT = 4  # rows and columns after which the pattern repeats


@dataclass(frozen=True)
class Tile:
    """Two cells of the pattern, covered by one brick.

    ``row``, ``column``: of the cell with the smaller numbers. ``along``: whether the other cell is
    in the next row; else it is in the next column.
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
    """Return the tiles between two edges at right angles to the columns.

    ``columns``: of the tiles' first cells. Result: column by column. A tile that would cross an
    edge is left out: one cell in four stays open there.

    Examples
    --------
    >>> [tile.row for tile in tiles(8, [0])], [tile.row for tile in tiles(8, [1])]
    ([0, 2, 4, 6], [1, 3, 5])
    """
    out = []
    for column in columns:
        for row in range(rows):
            place = (row + column) % REPEAT
            if place == 2 or (place == 0 and row + 1 < rows):
                out.append(Tile(row, column, along=place == 0))
    return out


def neighbors(chosen: Sequence[Tile], around: int = 0) -> list[tuple[int, int]]:
    """Return which tiles share an edge of a cell.

    ``around``: how many columns close a ring; none by default. Result (int, int): indices, each
    pair once, ascending.
    """

    def wrapped(row: int, column: int) -> tuple[int, int]:
        return row, column % around if around else column

    owner = {wrapped(*cell): i for i, tile in enumerate(chosen) for cell in tile.cells}
    found = set()
    for (row, column), i in owner.items():
        for beside in (wrapped(row + 1, column), wrapped(row, column + 1)):
            j = owner.get(beside, i)
            if i != j:
                found.add((min(i, j), max(i, j)))
    return sorted(found)


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
        for name in ("translational", "rotational"):
            if (values := getattr(self, name)) is not None:
                checked = vector(f"joint law: {name}", values, at_least=0.0)
                object.__setattr__(self, name, checked)

    def stiffness(self, area: float, moments: tuple[float, float]) -> tuple[Vector, Vector]:
        """Return the stiffness of a joint over a face.

        ``area``: m²; ``moments``: second moments of area about the two axes across the normal, m⁴.
        Results: ``translational``, ``rotational``: N/m and N m/rad.
        """
        normal, one, other = self.translational
        first, second = moments
        turning = (one * first + other * second, normal * first, normal * second)
        if self.rotational is not None:
            turn, bend, tilt = self.rotational
            turning = (area * turn, area * bend, area * tilt)
        return (area * normal, area * one, area * other), turning


MASONRY = JointLaw(
    translational=(1.5e9, 1.5e8, 1.5e8)
)  # of the domes that Bruun et al. built later


_STANDARD_GRAVITY = 9.81  # m/s²
_MOST_BRICKS = 20_000  # of a generated scene


def mobile_robots(bricks: Sequence[Brick], count: int = 3) -> tuple[Robot, ...]:
    """Return robots that reach everything, each of which can bear all bricks.

    Result: ``rob1``, ``rob2`` ….
    """
    weight = _STANDARD_GRAVITY * math.fsum(brick.mass for brick in bricks)
    return tuple(Robot(name=f"rob{i}", payload=weight) for i in range(1, count + 1))


def touching_order(
    count: int, pairs: Iterable[tuple[int, int]], starts: Iterable[int]
) -> list[int]:
    """Return an order in which everything touches what stands before it, or the ground.

    ``count``: how many there are; their own order is kept where it can be. ``pairs`` (int, int):
    which touch each other. ``starts``: which stand on the ground. Result: all that can be reached.
    """
    beside: list[set[int]] = [set() for _ in range(count)]
    for a, b in pairs:
        beside[a].add(b)
        beside[b].add(a)
    ready, waiting, order = {*starts}, [*range(count)], list[int]()
    while found := next((i + 1 for i in waiting if i in ready), 0):
        order.append(found - 1)
        waiting.remove(found - 1)
        ready |= beside[found - 1]
    return order


def whole_number(where: str, value: int, least: int) -> int:
    """Return a whole number that is large enough, and at most `_MOST_BRICKS`."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not least <= value <= _MOST_BRICKS:
        raise SceneError(
            f"{where} is {short(value)}; give a whole number from {least} to {_MOST_BRICKS}"
        )
    return int(value)


def few_enough(where: str, bricks: int) -> None:
    """Raise an error if a structure would have more than `_MOST_BRICKS`."""
    if bricks > _MOST_BRICKS:
        raise SceneError(f"{where}: {bricks} bricks; give numbers that make at most {_MOST_BRICKS}")


def joint_width(where: str, value: float) -> float:
    """Return the width of a joint, which may be none.

    Raises `SceneError` if it is negative or not finite.
    """
    return 0.0 if value == 0 else positive(where, value, "m, or 0")
