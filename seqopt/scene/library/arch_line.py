"""The line of an arch, as a vault needs it: a smooth curve through its joints, row by row."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.library.herringbone import Tile
from seqopt.scene.library.law import JointLaw
from seqopt.scene.parts import Brick, Ground, Joint
from seqopt.scene.scene import Scene

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

TILES = ((2, 0, True), (1, 0, False), (1, -1, False))  # rows, column, along: the pattern VLR


@dataclass(frozen=True)
class ArchLine:
    """The bricks of an arch, the tiles of a herringbone that they cover, and its line.

    Parameters
    ----------
    bricks : tuple of Brick
        In build order.
    joints : tuple of Joint
    grounds : tuple of 2 Ground
        Under the first brick and the last.
    tiles : tuple of Tile
        Of every brick.
    """

    bricks: tuple[Brick, ...]
    joints: tuple[Joint, ...]
    grounds: tuple[Ground, ...]
    tiles: tuple[Tile, ...]

    @property
    def rows(self) -> int:
        """Rows from foot to foot."""
        return self.tiles[-1].row + TILES[0][0]

    @cached_property
    def _curve(self) -> CubicSpline:
        from scipy.interpolate import CubicSpline  # noqa: PLC0415  # slow to import, for vaults only

        points = [self.grounds[0], *self.joints, self.grounds[1]]
        row = [tile.row for tile in self.tiles]
        return CubicSpline([*row, self.rows], [point.position for point in points])

    def point(self, row: Floats) -> Floats:
        """Return points of the line.

        Parameters
        ----------
        row : (n,) float
            From 0 at the first ground end; a joint lies at every row where a brick begins.

        Returns
        -------
        (n, 3) float
            m.
        """
        return np.asarray(self._curve(row))

    def share(self, row: float) -> float:
        """Return by which share of the span a row lies before or behind the middle, -½ to ½."""
        start, end, here = self.point(np.array([0.0, self.rows, row]))[:, 0].tolist()
        return float((here - start) / (end - start) - 0.5)

    def speed(self, row: Floats) -> Floats:
        """Return the derivatives of the line.

        Parameters
        ----------
        row : (n,) float

        Returns
        -------
        (n, 3) float
            m per row.
        """
        return np.asarray(self._curve(row, 1))

    @property
    def law(self) -> JointLaw:
        """The stiffness of the arch's first joint over the area of a brick's end."""
        _, width, thickness = self.bricks[0].dimensions
        joint, area = self.joints[0], width * thickness
        shift = np.array(joint.translational_stiffness) / area
        turn = np.array(joint.rotational_stiffness) / area
        return JointLaw(translational=shift.tolist(), rotational=turn.tolist())

    @property
    def stub(self) -> float:
        """Length of the stub behind the arch's first ground end, m."""
        return math.dist(self.grounds[0].anchor, self.grounds[0].position)


def arch_line(arch: Scene) -> ArchLine:
    """Return the line of an arch.

    Raises
    ------
    SceneError
        If it is no closed chain of equal bricks along, to the left, to the right and so on, whose
        first and last lie along.
    """
    if not isinstance(arch, Scene):
        raise SceneError(f"vault: a {type(arch).__name__} is not an arch; give a Scene")
    bricks = arch.placed
    names = [brick.name for brick in bricks]
    linked = [joint.bricks for joint in arch.joints] == [*pairwise(names)]
    stands = [ground.brick for ground in arch.grounds] == [names[0], names[-1]]
    alike = len({(brick.dimensions, brick.density) for brick in bricks}) == 1
    if len(bricks) < 4 or len(bricks) % 3 != 1 or not (linked and stands and alike):
        raise SceneError(
            f"vault: scene {arch.name} is not an arch to start from; give a closed chain of equal "
            "bricks in the pattern VLR, 3n + 1 of them, in the order in which they are built"
        )
    covered, row = [], 0
    for i, brick in enumerate(bricks):
        rows, column, along = TILES[i % 3]
        covered.append(Tile(row, column, along))
        left = brick.length_axis[1]
        if (abs(left) < math.sqrt(0.5)) != along or (not along and (left > 0) != (column == 0)):
            letter = "VLR"[i % 3]
            raise SceneError(
                f"vault: brick {brick.name} of {arch.name} does not lie as {letter} in the pattern "
                "VLR; give an arch along x, of this pattern"
            )
        row += rows
    return ArchLine(bricks, arch.joints, arch.grounds, tuple(covered))
