"""The surface of a herringbone vault, and where bricks lie on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.checks import finite, positive
from seqopt.scene.library.arch_line import ArchLine
from seqopt.scene.library.herringbone import Tile
from seqopt.scene.library.laying import whole_number


@dataclass(frozen=True, kw_only=True)
class VaultShape:
    """The numbers that shape a herringbone vault; lengths in m, angles in rad.

    Parameters
    ----------
    bricks : int
        How many, those of the arch included.
    spacing : float
        Distance of the columns from each other.
    plan_angle : float
        From the left of the arch to the rulings, seen from above; positive turns their left ends
        forward.
    skew : float
        How far the middle of the second foot lies to the left of that of the first.
    widening : float
        By which share the span grows, over the square of the distance from the arch, 1/m².
    drift : float
        Over how many columns beside the arch its rows keep at right angles to it; farther out they
        follow the rulings.

    Raises
    ------
    SceneError
        Naming the number that cannot be.

    Examples
    --------
    >>> VaultShape(bricks=100).spacing
    0.1327
    """

    bricks: int
    spacing: float = 0.1327
    plan_angle: float = 0.0
    skew: float = 0.0
    widening: float = 0.0
    drift: float = 1.3

    def __post_init__(self) -> None:
        _set(self, "bricks", whole_number("vault: bricks", self.bricks, 1))
        positive("vault: spacing", self.spacing, "m")
        for name in ("plan_angle", "skew", "widening", "drift"):
            _set(self, name, finite(f"vault: {name}", getattr(self, name)))
        if abs(self.plan_angle) > 0.25 * math.pi:
            raise SceneError(
                f"vault: plan_angle is {self.plan_angle:g} rad; give at most 0.785, half a right "
                "angle"
            )


class Pose(NamedTuple):
    """Where a brick lies; three arrays (3,): its middle, m, and two unit vectors."""

    center: Floats
    forward: Floats
    left: Floats


def poses(line: ArchLine, shape: VaultShape, places: Sequence[Tile]) -> list[Pose]:
    """Return where bricks lie.

    Parameters
    ----------
    line : ArchLine
        Of the arch in the middle.
    shape : VaultShape
    places : sequence of Tile

    Returns
    -------
    list of Pose
        One for every tile.
    """
    if not places:
        return []
    row, column = np.array([tile.middle for tile in places]).T
    along = np.array([tile.along for tile in places])
    beside = column * shape.spacing
    half = np.where(along, 1.0, 0.5)
    start, end, middle = (
        _surface(line, shape, row + step, beside) for step in (-half, half, 0.0 * half)
    )
    step = 1e-3 * shape.spacing
    turned = row + _drift(line, shape, row, beside)
    ruling = _moved(line, shape, turned, beside + step) - _moved(line, shape, turned, beside - step)
    forward = _unit(end - start)
    left = _unit(ruling)
    flush = along[:, None]  # a brick along keeps to its column, one across to the ruling
    forward, left = (
        np.where(flush, forward, _unit(forward - left * _dot(forward, left))),
        np.where(flush, _unit(left - forward * _dot(forward, left)), left),
    )
    center = np.where(flush, middle, 0.5 * (start + end))
    return [Pose(*pose) for pose in zip(center, forward, left, strict=True)]


def _surface(line: ArchLine, shape: VaultShape, row: Floats, beside: Floats) -> Floats:
    """Return points (n, 3) of the surface at rows of columns."""
    return _moved(line, shape, row + _drift(line, shape, row, beside), beside)


def _moved(line: ArchLine, shape: VaultShape, row: Floats, beside: Floats) -> Floats:
    """Return points (n, 3) of the arch's line, moved along the rulings."""
    point = line.point(row)
    middle = line.point(np.array([0.0, float(line.rows)]))[:, 0].mean()
    wider = (point[:, 0] - middle) * shape.widening * beside**2
    ahead = math.tan(shape.plan_angle) * beside
    return np.asarray(point + np.stack([wider + ahead, beside, np.zeros_like(beside)], axis=1))


def _drift(line: ArchLine, shape: VaultShape, row: Floats, beside: Floats) -> Floats:
    """Return by how many rows columns lag, so that rows leave the arch at right angles."""
    speed = line.speed(row)
    size = np.linalg.norm(speed, axis=1)
    columns = np.clip(beside / shape.spacing, -shape.drift, shape.drift)
    shift = columns * shape.spacing * math.tan(shape.plan_angle) * speed[:, 0] / size
    return np.asarray(-shift / size)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _dot(first: Floats, second: Floats) -> Floats:
    return np.asarray((first * second).sum(axis=1, keepdims=True))


def _set(value: object, name: str, content: object) -> None:
    object.__setattr__(value, name, content)
