"""Build the scene of an arch one brick wide: a chain of bricks end to end."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from seqopt.arrays import Floats, Terse, Vector
from seqopt.errors import SceneError, SceneWarning
from seqopt.scene._checks import (
    LETTERS,
    as_vector,
    check,
    density,
    finite,
    letters,
    short,
    sizes,
    stiffness,
)
from seqopt.scene.boxes import _spring_fields
from seqopt.scene.parts import THICKEST, Brick, Ground, Joint, Robot, Side
from seqopt.scene.scene import Scene

_LEFT = np.array([0.0, 1.0, 0.0])
STANDARD_GRAVITY = 9.81  # m/s²


@dataclass(frozen=True, kw_only=True, repr=False)
class ArchShape(Terse):
    """The numbers that shape a chain of bricks; lengths in m, angles in rad.

    Parameters
    ----------
    pitch : sequence of float
        Per brick: angle of its direction along the arch from the horizontal.
    roll : sequence of float, optional
        Per brick: rotation about that direction; positive lifts its left side.
    yaw : sequence of float, optional
        Per brick: rotation in the surface; positive turns a brick that lies along the arch to the
        left, and the left side of one that lies across it forward.
    offset : sequence of float, optional
        Per brick: its distance outward from the line between its joints.
    pattern : str
        A letter per brick, repeated: ``V`` lies along the arch, ``L`` and ``R`` lie across it and
        stick out to the left or right of the building direction.
    gap : float
        Width of a joint.
    overhang : float
        Distance from the arch line to the centroid of a brick that lies across.
    stub : float
        Length of the rigid stub behind the joint at each ground end.
    translational_stiffness, rotational_stiffness : Vector
        Stiffness of every joint: along it, and across it in two directions, N/m and N m/rad.
    dimensions : Vector
        Length, width and thickness of a brick.
    density : float
        kg/m³.
    closed : bool
        Whether the last brick stands on a second ground end.

    Examples
    --------
    >>> ArchShape(pitch=(1.2, 0.6, 0.0, -0.6, -1.2), pattern="V").dimensions
    (0.246, 0.116, 0.053)
    """

    pitch: Sequence[float]
    roll: Sequence[float] | None = None
    yaw: Sequence[float] | None = None
    offset: Sequence[float] | None = None
    pattern: str = LETTERS
    gap: float = 0.0145
    overhang: float = 0.0615
    stub: float = 0.093
    translational_stiffness: Vector = (3.07e8, 3.07e8, 3.07e8)
    rotational_stiffness: Vector = (2.5e6, 2.5e6, 2.5e6)
    dimensions: Vector = (0.246, 0.116, 0.053)
    density: float = 2420.0
    closed: bool = True

    @property
    def letters(self) -> str:
        """How each brick lies."""
        return (self.pattern * len(self.pitch))[: len(self.pitch)]

    def __post_init__(self) -> None:
        check(self, "arch", pitch=_numbers, roll=_numbers, yaw=_numbers, offset=_numbers)
        check(self, "arch", pattern=letters, gap=finite, overhang=finite, stub=finite)
        check(self, "arch", dimensions=sizes, density=density)
        check(self, "arch", translational_stiffness=stiffness, rotational_stiffness=stiffness)
        bricks = len(self.pitch)
        if not bricks:
            raise SceneError("arch: pitch is empty; give one angle per brick")
        for name in ("pitch", "roll", "yaw", "offset"):
            if (values := getattr(self, name)) is None:
                continue
            if len(values) != bricks:
                text = f"{len(values)} {name} and {bricks} pitch values"
                raise SceneError(f"arch: {text}; give as many")
            largest = max(map(abs, values))
            if name != "offset" and largest > 2 * math.pi:
                warnings.warn(
                    f"arch: {name} has {largest:g} rad, more than a turn; give radians, if degrees "
                    "are meant",
                    SceneWarning,
                    stacklevel=3,
                )


def arch_scene(
    shape: ArchShape,
    name: str = "arch",
    *,
    robots: Sequence[Robot] | None = None,
    provenance: str = "",
) -> Scene:
    """Return the scene of an arch that is built from its first brick to its last.

    The chain starts at the origin and runs towards +x; z is up, left is +y. Brick ``b`` has the
    nodes 2b-2 and 2b-1, the upper or outer one last; node 0 is blocked, as in Bruun et al.

    Parameters
    ----------
    shape : ArchShape
    name : str
    robots : sequence of Robot, optional
        By default `_robots_beside` the arch.
    provenance : str
        Where the numbers come from.

    Returns
    -------
    Scene

    Examples
    --------
    >>> arch_scene(ArchShape(pitch=(1.2, 0.6, 0.0, -0.6, -1.2), pattern="V"), "small")
    <Scene small: 5 bricks, 4 joints, 2 ground ends, 3 robots>
    """
    tangent, left, ends = _axes(shape)
    stiffness = shape.translational_stiffness, shape.rotational_stiffness

    thickness = shape.gap if shape.gap > THICKEST * min(shape.dimensions) else None

    def spring(place: Floats, direction: Floats, along: Floats) -> dict[str, Any]:
        rest = _LEFT - direction * (direction @ _LEFT) / (direction @ direction)
        fields = _spring_fields(place, along, rest / np.linalg.norm(rest), stiffness)
        return {**fields, "thickness": thickness}

    ways = [(way, way / np.linalg.norm(way)) for way in tangent[:-1] + tangent[1:]]
    bricks = _bricks(shape, tangent, left, ends)
    grounds = tuple(
        Ground(
            brick=brick,
            anchor=as_vector(ends[at] + sign * shape.stub * tangent[at]),
            **spring(ends[at], tangent[at], tangent[at]),
        )
        for brick, at, sign in ((1, 0, -1.0), (len(bricks), -1, 1.0))
    )
    return Scene(
        name=name,
        provenance=provenance,
        bricks=bricks,
        joints=tuple(
            Joint(bricks=(b, b + 1), **spring(ends[b], *way)) for b, way in enumerate(ways, 1)
        ),
        grounds=grounds if shape.closed else grounds[:1],
        build_order=tuple(brick.name for brick in bricks),
        robots=_robots_beside(shape) if robots is None else tuple(robots),
        blocked_nodes=(0,),
    )


def _robots_beside(shape: ArchShape) -> tuple[Robot, ...]:
    """Return three robots, each for the whole arch: one on either side, and one that reaches all.

    Those beside it reach its line, but not the far ends of bricks that stick out to the other side.
    """
    beyond = shape.overhang + 0.25 * shape.dimensions[1]
    weight = math.prod(shape.dimensions) * shape.density * STANDARD_GRAVITY * len(shape.pitch)
    left = Side(toward=(0.0, 1.0, 0.0), point=(0.0, -beyond, 0.0))
    right = Side(toward=(0.0, -1.0, 0.0), point=(0.0, beyond, 0.0))
    return (
        Robot(name="rob1", payload=weight, reach=left),
        Robot(name="rob2", payload=weight, reach=right),
        Robot(name="rob3", payload=weight),
    )


def _numbers(where: str, values: Sequence[float]) -> Sequence[float]:
    try:
        flat = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        flat = np.empty(())
    if flat.ndim != 1 or not np.isfinite(flat).all():
        raise SceneError(f"{where} is {short(values)}; give a number per brick")
    return values


def _axes(shape: ArchShape) -> tuple[Floats, Floats, Floats]:
    """Return the bricks' directions along the arch, to the left, and the points between them."""
    if not isinstance(shape, ArchShape):
        raise SceneError(f"a {type(shape).__name__} is not a shape of an arch; give ArchShape(...)")
    pitch = np.asarray(shape.pitch, dtype=float)
    zero = np.zeros_like(pitch)
    roll, yaw = (zero if a is None else np.asarray(a, float) for a in (shape.roll, shape.yaw))
    forward = np.stack([np.cos(pitch), zero, np.sin(pitch)], axis=1)
    normal = np.stack([-np.sin(pitch), zero, np.cos(pitch)], axis=1)
    rolled = np.cos(roll)[:, None] * _LEFT + np.sin(roll)[:, None] * normal
    lies_along = np.array([letter == "V" for letter in shape.letters])
    cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    tangent = np.where(lies_along[:, None], cos * forward + sin * rolled, forward)
    left = np.where(lies_along[:, None], cos * rolled - sin * forward, cos * rolled + sin * forward)
    length = np.where(lies_along, shape.dimensions[0], shape.dimensions[1]) + shape.gap
    ends = np.vstack([np.zeros(3), np.cumsum(length[:, None] * tangent, axis=0)])
    return tangent, left, ends


def _bricks(shape: ArchShape, tangents: Floats, lefts: Floats, ends: Floats) -> tuple[Brick, ...]:
    """Return all bricks, each in the middle between its ends and moved outward by its offset."""
    offset = np.zeros(len(tangents)) if shape.offset is None else np.asarray(shape.offset, float)
    middle = 0.5 * (ends[:-1] + ends[1:]) + offset[:, None] * np.cross(tangents, lefts)
    poses, out = zip(tangents, lefts, middle, shape.letters, strict=True), list[Brick]()
    for b, (tangent, left, position, letter) in enumerate(poses, start=1):
        nodes, length_axis, width_axis = (2 * b - 2, 2 * b - 1), tangent, left
        placing, aside = nodes[1], 0.0
        if letter != "V":
            length_axis = left if letter == "L" else -left
            width_axis = np.cross(np.cross(length_axis, tangent), length_axis)
            width_axis /= np.linalg.norm(width_axis)
            placing = nodes[int((letter == "L") == (b % 2 == 1))]  # both sides take turns
            aside = shape.overhang
        brick = Brick(
            name=b,
            position=as_vector(position + aside * length_axis),
            length_axis=as_vector(length_axis),
            width_axis=as_vector(width_axis),
            dimensions=shape.dimensions,
            density=shape.density,
            nodes=nodes,
            placing_node=placing,
        )
        out.append(brick)
    return tuple(out)
