"""The scene: bricks, joints, ground ends, robots and the order in which the bricks are placed.

Every value is frozen and checked when it is made. Positions and lengths are in m, densities in
kg/m³, forces in N, stiffnesses in N/m and N m/rad, accelerations in m/s².
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

from seqopt.arrays import Vector
from seqopt.errors import SceneError
from seqopt.scene.checks import axes, positive, vector
from seqopt.scene.reach import Anywhere, Reach


@dataclass(frozen=True, kw_only=True)
class Brick:
    """A rigid box with two inner nodes, the centroids of its halves.

    Parameters
    ----------
    name : int
        Number of the brick, unique in its scene.
    position : Vector
        Centroid, m.
    length_axis, width_axis : Vector
        Unit vectors along the length and the width, at right angles.
    dimensions : Vector
        Length, width and thickness, m.
    density : float
        kg/m³.
    nodes : tuple of 2 int
        Numbers of the inner nodes a quarter of the length behind and before the centroid.
    placing_node : int
        The node held while the brick is placed by a robot that is on no side of the structure.

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

    def __post_init__(self) -> None:
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
        _set(self, "nodes", tuple(self.nodes))
        if len(set(self.nodes)) != 2:
            raise SceneError(f"{where}: nodes are {list(self.nodes)}; give two different numbers")
        if self.placing_node not in self.nodes:
            raise SceneError(
                f"{where}: placing_node is {self.placing_node}; "
                f"give one of its nodes {list(self.nodes)}"
            )

    @property
    def mass(self) -> float:
        """Mass, kg."""
        return math.prod(self.dimensions) * self.density

    def node_position(self, node: int) -> Vector:
        """Return where one of the brick's inner nodes lies, m."""
        sign = -0.25 if node == self.nodes[0] else 0.25
        step = sign * self.dimensions[0]
        x, y, z = (p + step * a for p, a in zip(self.position, self.length_axis, strict=True))
        return x, y, z


@dataclass(frozen=True, kw_only=True)
class Spring:
    """Where a joint acts and how stiff it is, in its own axes.

    Parameters
    ----------
    position : Vector
        The point where the springs act, m.
    along, across : Vector
        Unit vectors along the joint's normal and across it, at right angles; the third axis is
        their cross product.
    translational_stiffness : Vector
        N/m along the three axes, zero allowed.
    rotational_stiffness : Vector
        N m/rad about the three axes, zero allowed.
    """

    position: Vector
    along: Vector
    across: Vector
    translational_stiffness: Vector
    rotational_stiffness: Vector

    def _check(self, where: str) -> None:
        _set(self, "position", vector(f"{where}: position", self.position))
        first, second = axes(f"{where}: along and across", self.along, self.across)
        _set(self, "along", first)
        _set(self, "across", second)
        for name in ("translational_stiffness", "rotational_stiffness"):
            _set(self, name, vector(f"{where}: {name}", getattr(self, name), at_least=0.0))


@dataclass(frozen=True, kw_only=True)
class Joint(Spring):
    """A spring between two bricks; ``bricks`` names them."""

    bricks: tuple[int, int]

    def __post_init__(self) -> None:
        _set(self, "bricks", tuple(self.bricks))
        where = f"joint {self.bricks}"
        if len(set(self.bricks)) != 2:
            raise SceneError(f"{where}: name two different bricks")
        self._check(where)


@dataclass(frozen=True, kw_only=True)
class Ground(Spring):
    """A spring between a brick and a rigid stub that ends at a fixed point.

    Parameters
    ----------
    brick : int
        The brick that stands on this end.
    anchor : Vector
        The fixed point, m: reaction and moment are taken here.
    closes_with : int, optional
        The brick whose placing closes this end; ``brick`` by default.
    """

    brick: int
    anchor: Vector
    closes_with: int | None = None

    def __post_init__(self) -> None:
        where = f"ground end of brick {self.brick}"
        self._check(where)
        _set(self, "anchor", vector(f"{where}: anchor", self.anchor))
        if self.anchor == self.position:
            raise SceneError(f"{where}: anchor and position are one point; give the stub a length")


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot that can hold one node: its name, its payload in N, and where it reaches."""

    name: str
    payload: float
    reach: Reach = field(default_factory=Anywhere)

    def __post_init__(self) -> None:
        _set(self, "payload", positive(f"robot {self.name}: payload", self.payload, "N"))


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything a build needs: what is built, in which order, and who holds it.

    Parameters
    ----------
    name, provenance : str
        What the scene is called and where its numbers come from.
    bricks : tuple of Brick
    joints : tuple of Joint
    grounds : tuple of Ground
        The first one is the support at which F_sup and M_sup are taken.
    build_order : tuple of int
        Names of all bricks in the order of placing.
    robots : tuple of Robot
    blocked_nodes : tuple of int
        Inner nodes that no robot may hold.
    gravity : Vector
        Acceleration, m/s².

    Raises
    ------
    SceneError
        If the scene is empty or its parts do not fit together.
    """

    name: str
    bricks: tuple[Brick, ...]
    joints: tuple[Joint, ...]
    grounds: tuple[Ground, ...]
    build_order: tuple[int, ...]
    robots: tuple[Robot, ...]
    blocked_nodes: tuple[int, ...] = ()
    gravity: Vector = (0.0, 0.0, -9.81)
    provenance: str = ""

    def __post_init__(self) -> None:
        for name in ("bricks", "joints", "grounds", "build_order", "robots", "blocked_nodes"):
            _set(self, name, tuple(getattr(self, name)))
        _set(self, "gravity", vector(f"scene {self.name}: gravity", self.gravity))
        if not self.bricks:
            raise SceneError(f"scene {self.name}: it has no bricks; give at least one")
        if not self.grounds:
            raise SceneError(f"scene {self.name}: it has no ground end; give at least one")
        _unique(f"scene {self.name}: brick", (brick.name for brick in self.bricks))
        _unique(f"scene {self.name}: node", (n for brick in self.bricks for n in brick.nodes))
        _unique(f"scene {self.name}: robot", (robot.name for robot in self.robots))
        self._check_references()

    def _check_references(self) -> None:
        names = {brick.name for brick in self.bricks}
        for joint in self.joints:
            _known(f"joint {joint.bricks}", "brick", joint.bricks, names)
        for ground in self.grounds:
            wanted = (
                (ground.brick,)
                if ground.closes_with is None
                else (ground.brick, ground.closes_with)
            )
            _known(f"ground end of brick {ground.brick}", "brick", wanted, names)
        if Counter(self.build_order) != Counter(names):
            raise SceneError(
                f"scene {self.name}: build_order is {list(self.build_order)}; "
                f"name each of the {len(names)} bricks once"
            )
        _known(
            f"scene {self.name}: blocked_nodes", "node", self.blocked_nodes, set(self.brick_of_node)
        )
        for brick in self.bricks:
            if brick.placing_node in self.blocked_nodes:
                raise SceneError(
                    f"brick {brick.name}: placing_node {brick.placing_node} is blocked; "
                    "name a free node"
                )

    @cached_property
    def brick_of_node(self) -> dict[int, Brick]:
        """The brick that each inner node belongs to."""
        return {node: brick for brick in self.bricks for node in brick.nodes}

    def node_position(self, node: int) -> Vector:
        """Return where an inner node lies, m."""
        return self.brick_of_node[node].node_position(node)

    @cached_property
    def placed(self) -> tuple[Brick, ...]:
        """The bricks in build order."""
        by_name = {brick.name: brick for brick in self.bricks}
        return tuple(by_name[name] for name in self.build_order)

    @property
    def up(self) -> Vector:
        """Unit vector against gravity; z where there is none."""
        size = math.hypot(*self.gravity)
        if size == 0:
            return (0.0, 0.0, 1.0)
        x, y, z = (-g / size for g in self.gravity)
        return x, y, z


def _set(value: object, name: str, content: object) -> None:
    object.__setattr__(value, name, content)


def _unique(what: str, names: Iterable[object]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise SceneError(f"{what} {twice[0]} occurs twice; give each its own")


def _known(where: str, kind: str, wanted: Iterable[int], known: set[int]) -> None:
    for name in wanted:
        if name not in known:
            raise SceneError(f"{where}: there is no {kind} {name}; known are {sorted(known)}")
