"""Herringbone: tiles of two cells each, of which every two that touch interlock with a third.

Cells stand in rows, along the structure, and columns, across it. With k = (row + column) mod 4 a
tile that lies along covers the cells k = 0 and 1 of a column, one that lies across covers k = 2 and
the cell k = 3 in the next column. So a column is what the arch of Bruun et al. is: a brick along,
one that sticks out to the left, one that sticks out to the right.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

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
