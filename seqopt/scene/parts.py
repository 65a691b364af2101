"""The parts of a scene: bricks, joints, ground ends, and robots with the kinds of their grips.

Every value is frozen and checked when it is made. Positions and lengths are in m, densities in
kg/m³, forces in N, stiffnesses in N/m and N m/rad.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from numbers import Real
from operator import mul
from typing import Any

import numpy as np

from seqopt._registry import required
from seqopt.arrays import Bools, Floats, FrozenValue, Ints, Terse, Vector, frozen
from seqopt.errors import SceneError
from seqopt.scene._checks import (
    UNIT,
    as_float,
    check,
    density,
    frames,
    kind_of,
    length,
    positive,
    printable,
    rows,
    settle,
    short,
    sizes,
    stiffness,
    unit_axes,
    vector,
    whole,
    wholes,
)
from seqopt.scene.shape import Polyhedron, _convex_polygon


@dataclass(frozen=True, kw_only=True, repr=False)
class Load(Terse):
    """A force on a brick.

    Parameters
    ----------
    brick : int
        Name of the brick.
    force : Vector
        N, in the scene's axes.
    position : Vector, optional
        Where it acts, m; the brick's centroid by default.
    since : int, optional
        Name of the brick with whose placing it begins to act, if that is placed later than
        ``brick``; by default it acts as soon as its own brick is placed.

    Examples
    --------
    >>> Load(brick=13, force=(0.0, 0.0, -800.0), since=25)
    Load(brick=13, force=(0, 0, -800), since=25)
    """

    brick: int
    force: Vector
    position: Vector | None = None
    since: int | None = None

    def __post_init__(self) -> None:
        check(self, "load", brick=whole)
        check(self, self.label, force=vector, position=vector, since=whole)

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"load on brick {self.brick}"

    @property
    def starts_with(self) -> int:
        """Name of the brick with whose placing it acts, unless its own is placed later."""
        return self.brick if self.since is None else self.since


_SAME_PLACE = 1e-6  # distance treated as zero, over the size of a block


@dataclass(frozen=True)
class Anywhere:
    """A mobile robot: every node is within reach."""

    def covers(self, point: Vector) -> bool:
        """Return whether a point is within reach: it is."""
        return True

    def __str__(self) -> str:
        return "anywhere"


@dataclass(frozen=True, kw_only=True)
class Side:
    """A robot beside the structure reaches every point of a half-space.

    ``toward``: unit vector to the robot's side; ``point``: of the plane that bounds the reach, m.
    """

    toward: Vector
    point: Vector

    def __post_init__(self) -> None:
        check(self, "reach", toward=vector, point=vector)
        if abs(math.fsum(x * x for x in self.toward) - 1) > UNIT:
            raise SceneError(f"reach: toward is {list(self.toward)}; give a unit vector")

    def covers(self, point: Vector) -> bool:
        """Return whether a point is within reach."""
        at, bound = (sum(map(mul, self.toward, each)) for each in (point, self.point))
        return bool(at >= bound)

    def __str__(self) -> str:
        return "the side toward ({:g}, {:g}, {:g})".format(*self.toward)


@dataclass(frozen=True, kw_only=True)
class Sphere:
    """A robot at a fixed base reaches every point within a radius.

    Parameters
    ----------
    center : Vector
        m.
    radius : float
        m.

    Examples
    --------
    >>> import seqopt
    >>> reach = seqopt.Sphere(center=(0.0, 0.0, 0.5), radius=1.0)
    >>> reach.covers((0.0, 0.9, 0.5))
    True
    >>> print(reach)
    1 m around (0, 0, 0.5)
    """

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        check(self, "reach", center=vector, radius=length)

    def covers(self, point: Vector) -> bool:
        """Return whether a point is within reach."""
        return math.dist(self.center, point) <= self.radius

    def __str__(self) -> str:
        return "{:g} m around ({:g}, {:g}, {:g})".format(self.radius, *self.center)


Reach = Anywhere | Side | Sphere
THICKEST = 0.5  # of a joint that does not say, over the smallest dimension of its bricks


@dataclass(frozen=True, kw_only=True, repr=False)
class Brick(Terse):
    """A rigid box or block with two inner nodes; in a box, these are the centroids of its halves.

    Parameters
    ----------
    name : int
        Number of the brick, unique in its scene.
    position : Vector
        Centroid, m.
    length_axis, width_axis : Vector
        Unit vectors along the length and the width, at right angles.
    dimensions : Vector
        Length, width and thickness, m; how far a shape extends along its axes.
    density : float
        kg/m³.
    nodes : tuple of 2 int
        Numbers of the inner nodes a quarter of the length behind and before the centroid.
    placing_node : int
        The node held while the brick is placed by a robot that is on no side of the structure.
    shape : Polyhedron, optional
        The shape of a block that is not a box; see `seqopt.scene.boxes.block_brick`.
    node_offsets : tuple of 2 Vector, optional
        Where the inner nodes are if they are elsewhere, from the centroid, m.
    """

    name: int
    position: Vector
    length_axis: Vector
    width_axis: Vector
    dimensions: Vector
    density: float
    nodes: tuple[int, int]
    placing_node: int
    shape: Polyhedron | None = None
    node_offsets: tuple[Vector, Vector] | None = None

    def __post_init__(self) -> None:
        settle(self, name=whole("brick: its name", self.name))
        where = f"brick {self.name}"
        check(self, where, position=vector, dimensions=sizes)
        unit_axes(self, where, "length_axis", "width_axis")
        check(self, where, density=density, nodes=wholes, placing_node=whole)
        if len(set(self.nodes)) != 2 or len(self.nodes) != 2:
            raise SceneError(f"{where}: nodes are {list(self.nodes)}; give two different numbers")
        if self.placing_node not in self.nodes:
            raise SceneError(
                f"{where}: placing_node is {self.placing_node}; "
                f"give one of its nodes {list(self.nodes)}"
            )
        if self.node_offsets is not None:
            what = f"{where}: node_offsets"
            points = tuple(vector(what, row) for row in rows(what, self.node_offsets))
            if len(points) != 2 or points[0] == points[1]:
                given = short(self.node_offsets)
                raise SceneError(f"{what} are {given}; give two different points")
            settle(self, node_offsets=points)
        if self.shape is None:
            return
        shape, slack = kind_of(f"{where}: shape", self.shape, Polyhedron), max(self.dimensions)
        slack *= _SAME_PLACE
        off = math.hypot(*shape.centroid.tolist())
        if not off <= slack:
            raise SceneError(
                f"{where}: the centroid of its shape is {off:.3g} m from its position; give "
                "vertices from the centroid"
            )
        extents = shape.extents(self.frame)
        if not np.allclose(extents, self.dimensions, rtol=0.0, atol=slack):
            raise SceneError(
                f"{where}: dimensions are {list(self.dimensions)}, and its shape extends "
                f"{[float(f'{e:.6g}') for e in extents]} along its axes; give these"
            )

    @cached_property
    def frame(self) -> Floats:
        """Unit vectors along length, width and thickness, (3, 3), as rows."""
        return frozen(frames(np.array(self.length_axis), np.array(self.width_axis)))

    @property
    def volume(self) -> float:
        """Volume, m³."""
        return math.prod(self.dimensions) if self.shape is None else self.shape.volume

    @property
    def mass(self) -> float:
        """Mass, kg."""
        return self.volume * self.density

    def node_position(self, node: int) -> Vector:
        """Return where one of the brick's inner nodes lies. ``node``: one of ``nodes``."""
        away, share = self.length_axis, 0.25 * self.dimensions[0]
        if self.node_offsets is not None:
            away, share = self.node_offsets[self.nodes.index(node)], 1.0
        elif node == self.nodes[0]:
            share = -share
        x, y, z = (p + share * d for p, d in zip(self.position, away, strict=True))
        return x, y, z


@dataclass(frozen=True, kw_only=True, repr=False)
class Spring(Terse):
    """Where a joint acts and how stiff it is, along and about its own axes; zero is allowed.

    ``along``, ``across``: unit vectors, the first its normal; ``thickness``: of what lies between
    the faces, m, to be given where it is more than `THICKEST` of the smallest dimension of the
    bricks. ``face``: corners of the convex face over which the bodies touch, from ``position``
    along ``across`` and the third axis, m; ``along`` then points into the second brick. By default
    faces follow from the boxes.
    """

    position: Vector
    along: Vector
    across: Vector
    translational_stiffness: Vector
    rotational_stiffness: Vector
    thickness: float | None = None
    face: tuple[tuple[float, float], ...] | None = None

    def _check(self, where: str) -> None:
        check(self, where, position=vector)
        unit_axes(self, where, "along", "across")
        check(self, where, translational_stiffness=stiffness, rotational_stiffness=stiffness)
        check(self, where, thickness=length, face=_convex_polygon)

    @property
    def corners(self) -> tuple[Vector, ...] | None:
        """Corners of the face, m, if it is given."""
        if self.face is None:
            return None
        sides = np.stack([self.across, np.cross(self.along, self.across)])
        points = self.position + np.array(self.face) @ sides
        return tuple((x, y, z) for x, y, z in points.tolist())


@dataclass(frozen=True, kw_only=True, repr=False)
class Joint(Spring):
    """A spring between two bricks.

    Parameters
    ----------
    bricks : tuple of 2 int
        Names of the two bricks, in any order; the others as of `Spring`.
    """

    bricks: tuple[int, int]

    def __post_init__(self) -> None:
        check(self, "joint", bricks=wholes)
        if len(set(self.bricks)) != 2 or len(self.bricks) != 2:
            raise SceneError(f"{self.label}: name two different bricks")
        self._check(self.label)

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"joint {self.bricks}"

    @property
    def ends(self) -> tuple[int, ...]:
        """Names of the bricks that it joins."""
        return self.bricks


@dataclass(frozen=True, kw_only=True, repr=False)
class Ground(Spring):
    """A spring between a brick and a rigid stub that ends at a fixed point.

    Parameters
    ----------
    brick : int
        The brick that stands on this end.
    anchor : Vector
        The fixed point, m: reaction and moment are taken here.
    closes_with : int, optional
        The brick whose placing closes this end; ``brick`` by default. The others as of `Spring`.
    movement : tuple of 6 float, optional
        How the fixed point and its stub move while this end acts: translation, m, and rotation,
        rad, in the scene's axes; three numbers are a translation.
    """

    brick: int
    anchor: Vector
    closes_with: int | None = None
    movement: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        check(self, "ground end", brick=whole)
        where = self.label
        check(self, where, closes_with=whole)
        if self.movement is not None:
            what, wanted = f"{where}: movement", "three or six numbers"
            numbers = rows(what, self.movement, wanted)
            if len(numbers) not in (3, 6):
                raise SceneError(f"{what} is {short(self.movement)}; give {wanted}")
            turn = vector(what, numbers[3:] or (0.0, 0.0, 0.0))
            settle(self, movement=(*vector(what, numbers[:3]), *turn))
        self._check(where)
        check(self, where, anchor=vector)

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"ground end of brick {self.brick}"

    @property
    def ends(self) -> tuple[int, ...]:
        """The name of the brick that it joins to the ground."""
        return (self.brick,)


_GIVES = (1e-3, 1e15)  # N/m, N m/rad; what is stiffer is rigid to all digits


def _each_way(where: str, value: float | Iterable[float], unit: str) -> Vector:
    """Return three stiffnesses of a grip, of one number or three."""
    one = isinstance(value, Real) and not isinstance(value, bool)
    try:
        x, y, z = [as_float(value)] * 3 if one else map(as_float, value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        x = y = z = math.nan
    if not all(_GIVES[0] <= each <= _GIVES[1] for each in (x, y, z)):
        low, high = _GIVES
        raise SceneError(
            f"{where} is {short(value)}; give one number or three, {low:g} to {high:g} {unit}"
        )
    return x, y, z


_each_shift = partial(_each_way, unit="N/m, or none if rigid")


@dataclass(frozen=True, kw_only=True, repr=False)
class Robot(Terse):
    """A robot that can hold one node.

    Parameters
    ----------
    name : str
        Unique in its scene.
    payload : float
        Largest force that it can exert on the structure, N.
    reach : Reach, optional
        Where it can hold; anywhere by default.
    stiffness : float or Vector, optional
        How stiff its grip is, the robot behind it included: a force by which the node it holds is
        pulled from where the hand should be, over that distance, N/m. One number, or three along
        the scene's axes; rigid by default. If its arm has joint stiffnesses, only the stiffness
        between the joints and the node: the two compliances add.
    rotational_stiffness : float or Vector, optional
        Of the grip against rotation of the node, N m/rad: one number, or three about the scene's
        axes. By default a grip lets its node turn.
    arm : seqopt.arms.Arm, optional
        Its arm, which must reach a node as well.
    durations : seqopt.times.Durations, optional
        How long it takes for what it does; by default that is not known.

    Examples
    --------
    >>> import seqopt
    >>> left = seqopt.Sphere(center=(0.3, -0.5, 0.6), radius=1.0)
    >>> seqopt.Robot(name="left", payload=500.0, reach=left)
    Robot(name='left', payload=500, reach=Sphere(center=(0.3, -0.5, 0.6), radius=1.0))
    >>> seqopt.Robot(name="soft", payload=500.0, stiffness=1e6).stiffness
    (1000000.0, 1000000.0, 1000000.0)
    """

    name: str
    payload: float
    reach: Reach = field(default_factory=Anywhere)
    stiffness: float | Vector | None = None
    rotational_stiffness: float | Vector | None = None
    arm: Any = field(default=None, repr=False)
    durations: Any = None

    def __post_init__(self) -> None:
        if not printable("robot", self.name):
            raise SceneError("robot: its name is empty; give one")
        where, reach = f"robot {self.name}", self.reach
        if isinstance(reach, str) and reach == "anywhere":
            settle(self, reach=Anywhere())
        elif not isinstance(reach, Anywhere | Side | Sphere):
            wanted = "Anywhere(), Side(...) or Sphere(...)"
            raise SceneError(f"{where}: reach is {short(reach)}; give {wanted}")
        check(
            self,
            where,
            payload=partial(positive, unit="N"),
            stiffness=_each_shift,
            rotational_stiffness=partial(_each_way, unit="N m/rad, or none if its node may turn"),
            arm=lambda where, arm: kind_of(where, arm, required("Arm")),
            durations=lambda where, given: kind_of(where, given, required("Durations")),
        )


@dataclass(frozen=True, eq=False, repr=False)
class _GripKinds(FrozenValue):
    """The K kinds of a scene's robots, in the order of their first ones.

    Robots of one compliance and payload are one kind; one with an arm whose joints are compliant
    is a kind by itself. Engines are asked about grips by number: that of the node, and for a robot
    of kind k more by k times the span of all node numbers.
    """

    compliance: Floats
    """(K, 6, 6): how a node shifts and turns, m and rad, against the hand that holds it for a force
    and a moment on it, N and N m; zero where the hand is rigid."""
    arms: Bools  # (K,); whether joints of an arm are compliant, as `seqopt.arms` knows of each node
    turns: Bools  # (K,); whether grips of a kind bear moments; others let their nodes turn
    payload: Floats  # (K,); N
    of_robot: Ints  # (R,); the kind of every robot
    first: int  # least node number
    span: int  # how far apart kinds are
    rigid: bool  # whether all grips are rigid and let their nodes turn
    gives: Bools  # (K,); which kinds are compliant to forces

    def numbers(self, nodes: Ints, robots: Sequence[int]) -> Ints:
        """Return the numbers (..., r) of grips of r robots, by index, on nodes (..., r)."""
        if len(self.turns) == 1:
            return nodes
        return np.asarray(nodes + self.span * self.of_robot[np.asarray(robots, dtype=np.int64)])

    def split(self, numbers: Ints) -> tuple[Ints, Ints]:
        """Return the nodes and the kinds of grips; kinds that there are not, of wrong numbers."""
        if len(self.turns) == 1:
            return numbers, np.zeros(numbers.shape, dtype=np.int64)
        kind = (numbers - self.first) // self.span
        known = (kind >= 0) & (kind < len(self.turns))
        kind = np.where(known, kind, 0)
        return numbers - self.span * kind, kind


@dataclass(frozen=True, kw_only=True, repr=False)
class Prop(Terse):
    """What holds a node of a brick that stands, as a robot would, and stays there.

    Parameters
    ----------
    node : int
        The inner node that it holds.
    stiffness : float or Vector, optional
        As of a `Robot`, N/m; rigid by default.
    direction : Vector, optional
        In which it pushes, of any length, if it cannot pull; by default it does both.
    capacity : float, optional
        Largest force that it bears, N; by default any.

    Examples
    --------
    >>> Prop(node=13, direction=(0, 0, 2))
    Prop(node=13, direction=(0, 0, 1))
    """

    node: int
    stiffness: float | Vector | None = None
    direction: Vector | None = None
    capacity: float | None = None

    def __post_init__(self) -> None:
        check(self, "prop", node=whole)
        newtons = partial(positive, unit="N")
        check(self, self.label, stiffness=_each_shift, direction=vector, capacity=newtons)
        if self.direction is not None:
            size = math.hypot(*self.direction)
            if not size > 0:
                given = list(self.direction)
                raise SceneError(f"{self.label}: direction is {given}; give one that is not zero")
            x, y, z = self.direction  # no zero with a minus
            settle(self, direction=(x / size + 0.0, y / size + 0.0, z / size + 0.0))

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"prop at node {self.node}"
