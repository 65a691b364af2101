"""The scene: what is built, in which order, and by which robots."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from seqopt.arrays import Vector
from seqopt.errors import SceneError
from seqopt.scene.checks import parts, printable, vector, wholes
from seqopt.scene.parts import Brick, Ground, Joint, Reach, Robot
from seqopt.showing import Shown, display

if TYPE_CHECKING:
    from matplotlib.figure import Figure
import re
from collections.abc import Callable

import networkx as nx

from seqopt.errors import did_you_mean
from seqopt.scene.checks import short

_AT_NODE = 1e-6  # distance treated as zero, over the length of the brick
_FAR = 1e9  # of a position from the origin, over the smallest dimension: digits are lost beyond
_SIZES = (1e-9, 1e9)  # m; dimensions that a brick may have
_HEAVY = 1e100  # N, N/m, N m/rad; squares of what is beyond overflow, of its inverse vanish


def _check_bricks(bricks: Sequence[Brick], gravity: Vector) -> None:
    """Require bricks that have a size, a place and a weight. ``gravity``: m/s²."""
    pull = math.hypot(*gravity)
    for brick in bricks:
        where, smallest = f"brick {brick.name}", min(brick.dimensions)
        if not _SIZES[0] <= smallest <= max(brick.dimensions) <= _SIZES[1]:
            raise SceneError(
                f"{where}: dimensions are {list(brick.dimensions)}; "
                f"give meters, from {_SIZES[0]:g} to {_SIZES[1]:g}"
            )
        if max(map(abs, brick.position)) > _FAR * smallest:
            raise SceneError(
                f"{where}: position is {list(brick.position)}, so far out that its size is lost "
                "to rounding; move the scene to the origin"
            )
        if pull and not 1 / _HEAVY <= brick.mass * pull <= _HEAVY:
            raise SceneError(
                f"{where}: it weighs {brick.mass * pull:g} N; correct its density "
                f"{brick.density:g} kg/m³ or the scene's gravity {pull:g} m/s²"
            )


def _check_springs(springs: Sequence[Joint | Ground], bricks: Mapping[int, Brick]) -> None:
    """Require joints and ground ends whose edges have a length. ``bricks``: by name."""
    farthest = _FAR * max(max(brick.dimensions) for brick in bricks.values())
    for spring in springs:
        ends = spring.bricks if isinstance(spring, Joint) else (spring.brick,)
        where = (
            f"joint {spring.bricks}"
            if isinstance(spring, Joint)
            else f"ground end of brick {ends[0]}"
        )
        points = {"position": spring.position}
        if isinstance(spring, Ground):
            points["anchor"] = spring.anchor
        for name, point in points.items():
            if max(map(abs, point)) > farthest:
                raise SceneError(f"{where}: {name} is {list(point)}; move it to its bricks")
        stiffness = (*spring.translational_stiffness, *spring.rotational_stiffness)
        stiffest = max(stiffness)
        softest = min(filter(None, stiffness), default=1.0)
        if stiffest > _HEAVY or softest < 1 / _HEAVY:
            wrong = stiffest if stiffest > _HEAVY else softest
            raise SceneError(
                f"{where}: a stiffness is {wrong:g}; give 0, or from {1 / _HEAVY:g} to {_HEAVY:g}"
            )
        for brick in (bricks[end] for end in ends):
            _check_edges(where, spring, brick)


def _check_edges(where: str, spring: Joint | Ground, brick: Brick) -> None:
    """Require a joint off the nodes of a brick, and a stub with a length."""
    near = _AT_NODE * brick.dimensions[0]
    for node in brick.nodes:
        if math.dist(brick.node_position(node), spring.position) <= near:
            raise SceneError(
                f"{where}: position is that of node {node} of brick {brick.name}; "
                "give a point between the faces that it joins"
            )
    if isinstance(spring, Ground) and math.dist(spring.anchor, spring.position) <= near:
        raise SceneError(f"{where}: anchor and position are one point; give the stub a length")


_KINDS = {"bricks": Brick, "joints": Joint, "grounds": Ground, "robots": Robot}


@dataclass(frozen=True, kw_only=True)
class Scene(Shown):
    """Everything a build needs: what is built, in which order, and by which robots.

    Parameters
    ----------
    name, provenance : str
        What the scene is called and where its numbers come from.
    bricks : tuple of Brick
    joints : tuple of Joint
    grounds : tuple of Ground
        The supports; F_sup and M_sup are the largest over them.
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

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> scene = load_scene("arch25")
    >>> scene
    <Scene arch25: 25 bricks, 24 joints, 2 ground ends, 3 robots>
    >>> scene.placed[0].nodes, scene.blocked_nodes
    ((0, 1), (0,))
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
        for name, kind in _KINDS.items():
            _set(self, name, parts(f"scene: {name}", getattr(self, name), kind))
        printable("scene", self.name)
        for name in ("build_order", "blocked_nodes"):
            _set(self, name, wholes(f"scene {self.name}: {name}", getattr(self, name)))
        _set(self, "gravity", vector(f"scene {self.name}: gravity", self.gravity))
        if not self.bricks:
            raise SceneError(f"scene {self.name}: it has no bricks; give at least one")
        if not self.grounds:
            raise SceneError(f"scene {self.name}: it has no ground end; give at least one")
        _unique(f"scene {self.name}: brick", (brick.name for brick in self.bricks))
        _unique(f"scene {self.name}: node", (n for brick in self.bricks for n in brick.nodes))
        _unique(f"scene {self.name}: robot", (robot.name for robot in self.robots))
        self._check_references()
        _check_bricks(self.bricks, self.gravity)
        _check_springs((*self.joints, *self.grounds), {brick.name: brick for brick in self.bricks})

    def __repr__(self) -> str:
        counts = (
            f"{len(self.bricks)} bricks, {len(self.joints)} joints, "
            f"{len(self.grounds)} ground ends, {len(self.robots)} robots"
        )
        return f"<Scene {self.name}: {counts}>"

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
        """Return where an inner node lies. ``node``: its number."""
        return self.brick_of_node[node].node_position(node)

    def within_reach(self, robot: Robot) -> tuple[tuple[int, ...], ...]:
        """Return the nodes that a robot may hold, by brick.

        Result: bricks in build order; nodes neither blocked nor out of reach.
        """
        if robot.reach not in self._within_reach:
            blocked, covers = {*self.blocked_nodes}, robot.reach.covers
            self._within_reach[robot.reach] = tuple(
                tuple(n for n in b.nodes if n not in blocked and covers(b.node_position(n)))
                for b in self.placed
            )
        return self._within_reach[robot.reach]

    @cached_property
    def _within_reach(self) -> dict[Reach, tuple[tuple[int, ...], ...]]:
        return {}

    @cached_property
    def placed(self) -> tuple[Brick, ...]:
        """The bricks in build order."""
        by_name = {brick.name: brick for brick in self.bricks}
        return tuple(by_name[name] for name in self.build_order)

    @cached_property
    def since(self) -> dict[int, int]:
        """From which brick count on each brick stands, by name."""
        return {name: count for count, name in enumerate(self.build_order, start=1)}

    def with_robots(self, *robots: Robot) -> Scene:
        """Return the same scene with other robots.

        ``*robots``: all robots of the new scene.

        Examples
        --------
        >>> import seqopt
        >>> pair = [seqopt.Robot(name=name, payload=400.0) for name in ("left", "right")]
        >>> seqopt.load_scene("arch25").with_robots(*pair)
        <Scene arch25: 25 bricks, 24 joints, 2 ground ends, 2 robots>
        """
        return replace(self, robots=robots)

    def plot(self, bricks: int | None = None) -> Figure:
        """Draw the scene, or its first bricks.

        ``bricks``: how many, in build order; the others are drawn pale. All by default. Result: a
        notebook shows it; ``savefig`` writes it to a file. Raises `ExtraError` if matplotlib is not
        installed (extra ``plot``).
        """
        figure: Figure = display("scene_picture")(self, bricks)
        return figure

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


Order = tuple[int, ...]
_PART = re.compile(r"(-?\d+)(?:\.\.(-?\d+))?")


def from_all_ends(scene: Scene) -> Order:
    """Return the order that builds from all ground ends at once.

    Result: bricks by how many joints lie between them and the nearest ground end, those of one
    number in turn from one ground end to the next; then those that no joint ties to any.

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> from_all_ends(load_scene("arch25"))[:5]
    (1, 25, 2, 24, 3)
    """
    graph: nx.Graph[int] = nx.Graph([joint.bricks for joint in scene.joints])
    graph.add_nodes_from(scene.build_order)
    far: dict[int, tuple[int, int]] = {}
    for end, ground in enumerate(scene.grounds):
        for brick, joints in nx.single_source_shortest_path_length(graph, ground.brick).items():
            far[brick] = min(far.get(brick, (joints, end)), (joints, end))
    last = (len(scene.bricks), len(scene.grounds))
    return tuple(sorted(scene.build_order, key=lambda name: far.get(name, last)))


def _reversed(scene: Scene) -> Order:
    return scene.build_order[::-1]


ORDERS: dict[str, Callable[[Scene], Order]] = {"reversed": _reversed, "ends": from_all_ends}
"""Orders by name: the scene's own from its last brick on, and from all ground ends at once."""


def parse_order(scene: Scene, text: str) -> Order:
    """Return an order from words.

    ``text``: a key of `ORDERS`, or names of bricks with commas between them, runs as ``1..12`` or
    ``25..13``.

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> parse_order(load_scene("arch25"), "1..12,25..13")[11:14]
    (12, 25, 24)
    """
    if text in ORDERS:
        return ORDERS[text](scene)
    out: list[int] = []
    for part in text.split(","):
        found = _PART.fullmatch(part.strip())
        if found is None:
            hint = did_you_mean(text, (*ORDERS, "search"))
            raise SceneError(
                f"order {short(text)}{hint}: give {', '.join(ORDERS)}, or names of bricks as "
                "1,2,5..9"
            )
        first, last = int(found[1]), int(found[2] or found[1])
        if abs(last - first) > len(scene.bricks):
            raise SceneError(f"order {short(text)}: {part} are more bricks than the scene has")
        step = 1 if last >= first else -1
        out += range(first, last + step, step)
    return tuple(out)


def in_order(scene: Scene, order: Sequence[int] | str | None) -> Scene:
    """Return a scene whose bricks are placed in an order.

    ``order``: names of all bricks, or words as `parse_order` takes them; None for the scene's own.
    Raises `SceneError` if a brick is missing, unknown or named twice.

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> in_order(load_scene("arch25"), "reversed").placed[0].name
    25
    """
    if order is None:
        return scene
    if isinstance(order, str):
        given = parse_order(scene, order)
    else:
        given = wholes(f"scene {scene.name}: order", order)
    _require_all(scene, given)
    return replace(scene, build_order=given)


def _require_all(scene: Scene, order: Iterable[int]) -> None:
    """Raise an error unless an order names every brick once."""
    left = {*scene.build_order}
    for name in order:
        if name not in left:
            why = "occurs twice" if name in scene.build_order else "is no brick"
            raise SceneError(f"scene {scene.name}: order: {name} {why}; name every brick once")
        left.remove(name)
    if left:
        raise SceneError(
            f"scene {scene.name}: order: {len(left)} bricks are missing, {min(left)} among them; "
            "name every brick once"
        )
