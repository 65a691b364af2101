"""The parts of a scene: bricks, joints, ground ends and robots.

Every value is frozen and checked when it is made. Positions and lengths are in m, densities in
kg/m³, forces in N, stiffnesses in N/m and N m/rad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from seqopt.arrays import Floats, Terse, Vector
from seqopt.errors import SceneError
from seqopt.scene.checks import (
    UNIT_TOLERANCE,
    axes,
    dot,
    positive,
    printable,
    short,
    vector,
    whole,
    wholes,
)
from seqopt.scene.shape import Polyhedron, check_shape, convex_polygon, two_points


@dataclass(frozen=True)
class Anywhere:
    """A mobile robot: every node is within reach."""

    def covers(self, point: Vector) -> bool:
        """Return whether a point is within reach."""
        return True


@dataclass(frozen=True, kw_only=True)
class Side:
    """A robot beside the structure reaches every point of a half-space.

    ``toward``: unit vector that points to the robot's side; ``point``: a point of the plane that
    bounds the reach, m. Raises `SceneError` if ``toward`` is not a unit vector or a number is not
    finite.
    """

    toward: Vector
    point: Vector

    def __post_init__(self) -> None:
        object.__setattr__(self, "toward", vector("reach: toward", self.toward))
        object.__setattr__(self, "point", vector("reach: point", self.point))
        if abs(dot(self.toward, self.toward) - 1) > UNIT_TOLERANCE:
            raise SceneError(f"reach: toward is {list(self.toward)}; give a unit vector")

    def covers(self, point: Vector) -> bool:
        """Return whether a point is within reach."""
        return dot(self.toward, point) >= dot(self.toward, self.point)


@dataclass(frozen=True, kw_only=True)
class Sphere:
    """A robot at a fixed base reaches every point within a radius.

    Parameters
    ----------
    center : Vector
        m.
    radius : float
        m.

    Raises
    ------
    SceneError
        If the radius is not a positive number or the center is not finite.

    Examples
    --------
    >>> import seqopt
    >>> seqopt.Sphere(center=(0.0, 0.0, 0.5), radius=1.0).covers((0.0, 0.9, 0.5))
    True
    """

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", vector("reach: center", self.center))
        object.__setattr__(self, "radius", positive("reach: radius", self.radius, "m"))

    def covers(self, point: Vector) -> bool:
        """Return whether a point is within reach."""
        return math.dist(self.center, point) <= self.radius


Reach = Anywhere | Side | Sphere


def _as_reach(where: str, given: Reach | str) -> Reach:
    """Return a reach; ``"anywhere"`` is one too."""
    if isinstance(given, str) and given == "anywhere":
        return Anywhere()
    if not isinstance(given, Anywhere | Side | Sphere):
        raise SceneError(f"{where} is {short(given)}; give Anywhere(), Side(...) or Sphere(...)")
    return given


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

    Raises
    ------
    SceneError
        If a value is not finite, not positive where it must be, or not consistent.
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
        _set(self, "name", whole("brick: its name", self.name))
        where = f"brick {self.name}"
        _set(self, "position", vector(f"{where}: position", self.position))
        _set(self, "dimensions", vector(f"{where}: dimensions", self.dimensions))
        for length in self.dimensions:
            positive(f"{where}: dimensions", length, "m")
        first, second = axes(
            f"{where}: length_axis and width_axis", self.length_axis, self.width_axis
        )
        _set(self, "length_axis", first)
        _set(self, "width_axis", second)
        _set(self, "density", positive(f"{where}: density", self.density, "kg/m³"))
        _set(self, "nodes", wholes(f"{where}: nodes", self.nodes))
        _set(self, "placing_node", whole(f"{where}: placing_node", self.placing_node))
        if len(set(self.nodes)) != 2 or len(self.nodes) != 2:
            raise SceneError(f"{where}: nodes are {list(self.nodes)}; give two different numbers")
        if self.placing_node not in self.nodes:
            raise SceneError(
                f"{where}: placing_node is {self.placing_node}; "
                f"give one of its nodes {list(self.nodes)}"
            )
        if self.node_offsets is not None:
            _set(self, "node_offsets", two_points(where, self.node_offsets))
        if self.shape is not None:
            across = (self.length_axis, self.width_axis)
            check_shape(where, self.shape, self.dimensions, across)

    @property
    def frame(self) -> Floats:
        """Unit vectors along length, width and thickness, (3, 3), as rows."""
        length, width = np.array(self.length_axis), np.array(self.width_axis)
        return np.stack([length, width, np.cross(length, width)])

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
        if self.node_offsets is not None:
            away = self.node_offsets[self.nodes.index(node)]
            x, y, z = (p + d for p, d in zip(self.position, away, strict=True))
            return x, y, z
        sign = -0.25 if node == self.nodes[0] else 0.25
        step = sign * self.dimensions[0]
        x, y, z = (p + step * a for p, a in zip(self.position, self.length_axis, strict=True))
        return x, y, z


@dataclass(frozen=True, kw_only=True, repr=False)
class Spring(Terse):
    """Where a joint acts and how stiff it is, in its own axes.

    ``position``: the point where the springs act, m. ``along``, ``across``: unit vectors along the
    joint's normal and across it, at right angles; the third axis is their cross product.
    ``translational_stiffness``: N/m along the three axes, zero allowed. ``rotational_stiffness``: N
    m/rad about the three axes, zero allowed. ``thickness``: of what lies between the faces, m: to
    be given where it is more than `THICKEST` of the smallest dimension of the bricks; faces farther
    apart do not touch. ``face``: corners of the convex face over which the bodies touch, once
    around: from ``position`` along ``across`` and along the third axis, m. ``along`` then points
    from the first brick into the second, or from the ground into its brick. By default faces follow
    from the boxes.
    """

    position: Vector
    along: Vector
    across: Vector
    translational_stiffness: Vector
    rotational_stiffness: Vector
    thickness: float | None = None
    face: tuple[tuple[float, float], ...] | None = None

    def _check(self, where: str) -> None:
        _set(self, "position", vector(f"{where}: position", self.position))
        first, second = axes(f"{where}: along and across", self.along, self.across)
        _set(self, "along", first)
        _set(self, "across", second)
        for name in ("translational_stiffness", "rotational_stiffness"):
            _set(self, name, vector(f"{where}: {name}", getattr(self, name), at_least=0.0))
        if self.thickness is not None:
            _set(self, "thickness", positive(f"{where}: thickness", self.thickness, "m"))
        if self.face is not None:
            _set(self, "face", convex_polygon(f"{where}: face", self.face))

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

    Raises
    ------
    SceneError
        If it joins a brick to itself, or a value is not finite or not consistent.
    """

    bricks: tuple[int, int]

    def __post_init__(self) -> None:
        _set(self, "bricks", wholes("joint: bricks", self.bricks))
        where = f"joint {self.bricks}"
        if len(set(self.bricks)) != 2 or len(self.bricks) != 2:
            raise SceneError(f"{where}: name two different bricks")
        self._check(where)


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

    Raises
    ------
    SceneError
        If the stub has no length, or a value is not finite or not consistent.
    """

    brick: int
    anchor: Vector
    closes_with: int | None = None

    def __post_init__(self) -> None:
        _set(self, "brick", whole("ground end: brick", self.brick))
        where = f"ground end of brick {self.brick}"
        if self.closes_with is not None:
            _set(self, "closes_with", whole(f"{where}: closes_with", self.closes_with))
        self._check(where)
        _set(self, "anchor", vector(f"{where}: anchor", self.anchor))
        if self.anchor == self.position:
            raise SceneError(f"{where}: anchor and position are one point; give the stub a length")


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot that can hold one node.

    Parameters
    ----------
    name : str
        Unique in its scene.
    payload : float
        Largest force that it can exert on the structure, N.
    reach : Reach, optional
        Where it can hold; anywhere by default.

    Raises
    ------
    SceneError
        If the name cannot be printed or the payload is not a positive number.

    Examples
    --------
    >>> import seqopt
    >>> left = seqopt.Sphere(center=(0.3, -0.5, 0.6), radius=1.0)
    >>> seqopt.Robot(name="left", payload=500.0, reach=left)
    Robot(name='left', payload=500.0, reach=Sphere(center=(0.3, -0.5, 0.6), radius=1.0))
    """

    name: str
    payload: float
    reach: Reach = field(default_factory=Anywhere)

    def __post_init__(self) -> None:
        printable("robot", self.name)
        _set(self, "reach", _as_reach(f"robot {self.name}: reach", self.reach))
        _set(self, "payload", positive(f"robot {self.name}: payload", self.payload, "N"))


def _set(value: object, name: str, content: object) -> None:
    object.__setattr__(value, name, content)
