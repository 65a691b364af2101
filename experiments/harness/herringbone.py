"""Herringbone vaults around a central arch, over a skewed plan, of which one is `vault338`.

The arch's line, moved along rulings, is the surface, on which the pattern continues from the arch.
Places are filled that lie nearest to a middle line, at an angle from foot to foot.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene._checks import check, finite, length, units, whole_between
from seqopt.scene.boxes import as_vector, require_apart
from seqopt.scene.library.common import (
    JointLaw,
    _ground_under,
    _joints_between,
    mobile_robots,
    touching_order,
)
from seqopt.scene.parts import Brick, Ground, Joint
from seqopt.scene.scene import Scene

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


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


_Pose = tuple[Floats, Floats, Floats]
_TILES = ((2, 0, True), (1, 0, False), (1, -1, False))  # rows, column, along: the pattern VLR


@dataclass(frozen=True)
class _ArchLine:
    """The bricks of an arch in build order, the tiles that they cover, and its line."""

    bricks: tuple[Brick, ...]
    joints: tuple[Joint, ...]
    grounds: tuple[Ground, ...]
    tiles: tuple[Tile, ...]

    @property
    def rows(self) -> int:
        """Rows from foot to foot."""
        return self.tiles[-1].row + _TILES[0][0]

    @cached_property
    def _curve(self) -> CubicSpline:
        from scipy.interpolate import CubicSpline  # noqa: PLC0415  # slow to import, for vaults only

        points = [self.grounds[0], *self.joints, self.grounds[1]]
        row = [tile.row for tile in self.tiles]
        return CubicSpline([*row, self.rows], [point.position for point in points])

    def point(self, row: Floats) -> Floats:
        """Return points (n, 3) of the line at rows (n,), from 0 at the first ground end, m."""
        return np.asarray(self._curve(row))

    def share(self, row: float) -> float:
        """Return by which share of the span a row lies before or behind the middle, -½ to ½."""
        start, end, here = self.point(np.array([0.0, self.rows, row]))[:, 0].tolist()
        return float((here - start) / (end - start) - 0.5)

    def speed(self, row: Floats) -> Floats:
        """Return the derivatives (n, 3) of the line at rows (n,), m per row."""
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


def _arch_line(arch: Scene) -> _ArchLine:
    """Return the line of a closed chain of equal bricks in the pattern VLR."""
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
        rows, column, along = _TILES[i % 3]
        covered.append(Tile(row, column, along))
        left = brick.length_axis[1]
        if (abs(left) < math.sqrt(0.5)) != along or (not along and (left > 0) != (column == 0)):
            letter = "VLR"[i % 3]
            raise SceneError(
                f"vault: brick {brick.name} of {arch.name} does not lie as {letter} in the pattern "
                "VLR; give an arch along x, of this pattern"
            )
        row += rows
    return _ArchLine(bricks, arch.joints, arch.grounds, tuple(covered))


@dataclass(frozen=True, kw_only=True)
class VaultShape:
    """The numbers that shape a herringbone vault; lengths in m, angles in rad.

    ``bricks``: how many, those of the arch included. ``spacing``: distance of the columns from each
    other. ``plan_angle``: from the left of the arch to the rulings, seen from above; positive turns
    their left ends forward. ``skew``: how far the middle of the second foot lies to the left of
    that of the first. ``widening``: by which share the span grows, over the square of the distance
    from the arch, 1/m². ``drift``: over how many columns beside the arch its rows keep at right
    angles to it; farther out they follow the rulings.

    """

    bricks: int
    spacing: float = 0.1327
    plan_angle: float = 0.0
    skew: float = 0.0
    widening: float = 0.0
    drift: float = 1.3

    def __post_init__(self) -> None:
        check(self, "vault", bricks=partial(whole_between, least=1), spacing=length)
        check(self, "vault", plan_angle=finite, skew=finite, widening=finite, drift=finite)
        if abs(self.plan_angle) > 0.25 * math.pi:
            raise SceneError(
                f"vault: plan_angle is {self.plan_angle:g} rad; give at most 0.785, half a right "
                "angle"
            )


def _poses(line: _ArchLine, shape: VaultShape, places: Sequence[Tile]) -> Iterator[_Pose]:
    """Yield where the bricks on tiles lie: their middles, m, and unit vectors forward and left."""
    row, column = np.array([tile.middle for tile in places]).reshape(-1, 2).T
    along = np.array([tile.along for tile in places], dtype=bool)
    beside = column * shape.spacing
    half = np.where(along, 1.0, 0.5)
    start, end, middle = (
        _moved(line, shape, at + _drift(line, shape, at, beside), beside)
        for at in (row - half, row + half, row + 0.0 * half)
    )
    step = 1e-3 * shape.spacing
    turned = row + _drift(line, shape, row, beside)
    ruling = _moved(line, shape, turned, beside + step) - _moved(line, shape, turned, beside - step)
    forward = units(end - start)
    left = units(ruling)
    flush = along[:, None]  # a brick along keeps to its column, one across to the ruling
    forward, left = (
        np.where(flush, forward, units(forward - left * _dot(forward, left))),
        np.where(flush, units(left - forward * _dot(forward, left)), left),
    )
    center = np.where(flush, middle, 0.5 * (start + end))
    return zip(center, forward, left, strict=True)


def _moved(line: _ArchLine, shape: VaultShape, row: Floats, beside: Floats) -> Floats:
    """Return points (n, 3) of the arch's line, moved along the rulings."""
    point = line.point(row)
    middle = line.point(np.array([0.0, float(line.rows)]))[:, 0].mean()
    wider = (point[:, 0] - middle) * shape.widening * beside**2
    ahead = math.tan(shape.plan_angle) * beside
    return np.asarray(point + np.stack([wider + ahead, beside, np.zeros_like(beside)], axis=1))


def _drift(line: _ArchLine, shape: VaultShape, row: Floats, beside: Floats) -> Floats:
    """Return by how many rows columns lag, so that rows leave the arch at right angles."""
    speed = line.speed(row)
    size = np.linalg.norm(speed, axis=1)
    columns = np.clip(beside / shape.spacing, -shape.drift, shape.drift)
    shift = columns * shape.spacing * math.tan(shape.plan_angle) * speed[:, 0] / size
    return np.asarray(-shift / size)


def _dot(first: Floats, second: Floats) -> Floats:
    return np.asarray((first * second).sum(axis=1, keepdims=True))


def herringbone_vault(arch: Scene, shape: VaultShape) -> Scene:
    """Return the scene of a vault whose first phase is an arch that stands in its middle.

    The arch is kept as it is, and built in its order. Layers follow, to the left and to the right
    in turn: a column of bricks along, and those that reach from it into the next one, from the foot
    that the skew leaves on that side. Every brick touches what stands before it, or the ground.

    ``arch``: a closed chain as `seqopt.scene.arch.arch_scene` makes it of the pattern ``VLR``,
    whose first and last bricks lie along. Three robots reach everything, with the largest payload
    at the arch. Raises `SceneError` if the arch is of another kind, bricks interpenetrate, or do
    not touch.
    """
    line = _arch_line(arch)
    chosen = _chosen(line, shape)
    bricks = _bricks(line, shape, chosen)
    require_apart("vault", bricks, "give a wider spacing or a smaller plan_angle")
    grounds, own = [*line.grounds], len(line.bricks)
    for tile, brick in zip(chosen[own:], bricks[own:], strict=True):
        if foot := _feet(line, tile):
            forward = np.array(brick.length_axis if tile.along else brick.width_axis)
            forward = forward * np.sign(forward @ line.speed(np.array([tile.middle[0]]))[0])
            grounds.append(_ground_under(brick, foot * forward, line.law, line.stub))
    pairs = [pair for pair in neighbors(chosen) if pair[1] >= own]
    pairs.sort(key=lambda pair: pair[::-1])
    movers = mobile_robots(bricks)
    payload = max((robot.payload for robot in arch.robots), default=movers[0].payload)
    return replace(
        arch,
        name=f"vault {shape.bricks}",
        provenance="Generated by experiments.harness.herringbone.",
        bricks=tuple(bricks),
        joints=(*line.joints, *_joints_between(bricks, pairs, line.law)),
        grounds=tuple(grounds),
        build_order=tuple(brick.name for brick in bricks),
        robots=tuple(replace(robot, payload=payload) for robot in movers),
    )


def neighbors(chosen: Sequence[Tile]) -> list[tuple[int, int]]:
    """Return which tiles share an edge of a cell: their places, each pair once, ascending."""
    owner = {cell: i for i, tile in enumerate(chosen) for cell in tile.cells}
    beside = [
        (i, owner.get(cell, i))
        for (row, column), i in owner.items()
        for cell in ((row + 1, column), (row, column + 1))
    ]
    return sorted({(min(pair), max(pair)) for pair in beside if pair[0] != pair[1]})


def _chosen(line: _ArchLine, shape: VaultShape) -> list[Tile]:
    """Return the tiles of the vault in the order of building."""
    rest = shape.bricks - len(line.tiles)
    if rest < 0:
        raise SceneError(
            f"vault: bricks is {shape.bricks}, and its arch has {len(line.tiles)}; "
            "give at least as many"
        )
    half = math.ceil(shape.bricks / line.rows + 0.5 * abs(shape.skew) / shape.spacing) + 2
    own = {*line.tiles}
    places = [t for t in tiles(line.rows, range(-half, half + 1)) if t not in own]

    def aside(tile: Tile) -> float:  # rounded, so that equal ones are equal on every machine
        row, column = tile.middle
        return round(abs(column * shape.spacing - shape.skew * line.share(row)), 9)

    def turn(tile: Tile) -> tuple[int, bool, float]:
        layer, left = _layer(tile)
        forward = left == (shape.skew < 0)
        return layer, not left, tile.middle[0] if forward else -tile.middle[0]

    layered = [*line.tiles, *sorted(sorted(places, key=aside)[:rest], key=turn)]
    grounded = [i for i, t in enumerate(layered) if _feet(line, t) and i >= len(own)]
    order = touching_order(range(len(layered)), neighbors(layered), [0, *grounded])
    if len(order) < len(layered):
        lost = len(layered) - len(order)
        raise SceneError(
            f"vault: {lost} of {len(layered)} bricks would touch nothing that stands; give a "
            f"smaller skew than {shape.skew:g} m or more bricks"
        )
    return [layered[i] for i in order]


def _layer(tile: Tile) -> tuple[int, bool]:
    """Return which layer a tile belongs to, counted from the arch, and whether on the left."""
    column = tile.column + (not tile.along and tile.column < 0)  # one that reaches back
    return abs(column), tile.column >= 0


def _feet(line: _ArchLine, tile: Tile) -> int:
    """Return on which ground a tile stands: -1 at the first foot, 1 at the second, 0 on none."""
    last = tile.cells[1][0] if tile.along else tile.row
    return -1 if tile.row == 0 else int(last == line.rows - 1)


def _bricks(line: _ArchLine, shape: VaultShape, chosen: Sequence[Tile]) -> list[Brick]:
    """Return the bricks of the arch and those on the other tiles."""
    own = dict(zip(line.tiles, line.bricks, strict=True))
    places = [tile for tile in chosen if tile not in own]
    name = max(brick.name for brick in line.bricks)
    node = max(node for brick in line.bricks for node in brick.nodes)
    new = {}
    poses = _poses(line, shape, places)
    for tile, (center, forward, left) in zip(places, poses, strict=True):
        outward = _layer(tile)[1]
        upward = outward == (shape.skew < 0)
        axes = (forward if upward else -forward, left)
        if not tile.along:
            axes = (left if outward else -left, forward)
        name, node = name + 1, node + 2
        new[tile] = replace(
            line.bricks[0],
            name=name,
            position=as_vector(center),
            length_axis=as_vector(axes[0]),
            width_axis=as_vector(axes[1]),
            nodes=(node - 1, node),
            placing_node=node,
        )
    return [own.get(tile) or new[tile] for tile in chosen]


# 338 bricks over 2670 x 4350 mm, around an arch whose plan angle is 5.1 degrees
VAULT = VaultShape(bricks=338, plan_angle=math.radians(5.1), skew=1.74, widening=0.0234)
