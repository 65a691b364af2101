"""The scene: what is built, in which order, and by which robots."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from seqopt._registry import Later, Shown, display, required
from seqopt.arrays import Bools, Floats, Ints, Vector
from seqopt.errors import ProblemError, SceneError, StepError, did_you_mean
from seqopt.scene._checks import (
    check,
    kind_of,
    not_negative,
    printable,
    settle,
    short,
    vector,
    wholes,
)
from seqopt.scene.parts import Anywhere, Brick, Ground, Joint, Load, Prop, Reach, Robot, _GripKinds
from seqopt.work import Tell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

nx = Later("networkx")  # 90 ms, of what needs a scene without its network
WORDS = Later("seqopt.scene._words")  # where words are given

_Part = TypeVar("_Part")
_AT_NODE = 1e-6  # distance treated as zero, over the length of the brick
_FAR = 1e9  # of a position from the origin, over the smallest dimension: digits are lost beyond
_SIZES = (1e-9, 1e9)  # m; dimensions that a brick may have
_STORM = 1e6  # wind over the weight
_SHOWN = 6  # bricks that a message names
_ROUNDING = 1e-9  # over a payload, by which a load may exceed it
MOST_ROBOTS = 5
_HEAVY = 1e100  # N, N/m, N m/rad; squares of what is beyond overflow, of its inverse vanish


def _check_bricks(bricks: Sequence[Brick], gravity: Vector, factor: float) -> None:
    """Require bricks that have a size, a place and a weight. ``gravity``: m/s²."""
    pull = factor * math.hypot(*gravity)
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
                + (", its weight_factor counted" if factor != 1 else "")
            )


def _check_springs(springs: Sequence[Joint | Ground], bricks: Mapping[int, Brick]) -> None:
    """Require joints off the nodes of bricks, stubs with a length, and numbers within bounds."""
    farthest = _FAR * max(max(brick.dimensions) for brick in bricks.values())
    for spring in springs:
        for name in ("position", "anchor", "movement"):
            point = getattr(spring, name, None)
            if point and max(map(abs, point)) > farthest:
                raise SceneError(f"{spring.label}: {name} is {list(point)}; move it to its bricks")
        for value in (*spring.translational_stiffness, *spring.rotational_stiffness):
            if value and not 1 / _HEAVY <= value <= _HEAVY:
                raise SceneError(
                    f"{spring.label}: a stiffness is {value:g}; "
                    f"give 0, or from {1 / _HEAVY:g} to {_HEAVY:g}"
                )
        for brick in (bricks[end] for end in spring.ends):
            near = _AT_NODE * brick.dimensions[0]
            for node in brick.nodes:
                if math.dist(brick.node_position(node), spring.position) <= near:
                    raise SceneError(
                        f"{spring.label}: position is that of node {node} of brick {brick.name}; "
                        "give a point between the faces that it joins"
                    )
            if isinstance(spring, Ground) and math.dist(spring.anchor, spring.position) <= near:
                raise SceneError(
                    f"{spring.label}: anchor and position are one point; give the stub a length"
                )


_PARTS = (Brick, Joint, Ground, Robot, Load, Prop)
_KINDS = {f"{part.__name__.lower()}s": part for part in _PARTS}


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
    loads : tuple of Load
        Forces on bricks beside their weight.
    wind : Vector
        A force on every brick at its centroid, over its mass times the size of gravity: wind, an
        earthquake, a lean.
    weight_factor : float
        By which all weights are multiplied; not the wind.
    props : tuple of Prop
        What holds nodes beside the robots, from when their bricks stand until the finished
        structure is let go.

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
    loads: tuple[Load, ...] = ()
    wind: Vector = (0.0, 0.0, 0.0)
    weight_factor: float = 1.0
    props: tuple[Prop, ...] = ()

    def __post_init__(self) -> None:
        check(self, "scene", **{name: partial(_parts, kind=kind) for name, kind in _KINDS.items()})
        where = f"scene {printable('scene', self.name)}"
        check(self, where, build_order=wholes, blocked_nodes=wholes, gravity=vector)
        check(self, where, wind=vector, weight_factor=not_negative)
        check(self, where, provenance=partial(kind_of, kind=str))
        if not self.bricks:
            raise SceneError(f"{where}: it has no bricks; give at least one")
        if not self.grounds:
            raise SceneError(f"{where}: it has no ground end; give at least one")
        _unique(f"{where}: brick", (brick.name for brick in self.bricks))
        _unique(f"{where}: node", (n for brick in self.bricks for n in brick.nodes))
        _unique(f"{where}: robot", (robot.name for robot in self.robots))
        self._check_references(where)
        _check_bricks(self.bricks, self.gravity, self.weight_factor)
        by_name = {brick.name: brick for brick in self.bricks}
        _check_springs((*self.joints, *self.grounds), by_name)
        for load in self.loads:
            if math.hypot(*load.force) > _HEAVY:
                given = list(load.force)
                raise SceneError(f"{load.label}: force is {given}; give N, to {_HEAVY:g}")
            at, far = load.position, _FAR * max(by_name[load.brick].dimensions)
            if at and max(map(abs, at)) > far:
                raise SceneError(f"{load.label}: position is {list(at)}; move it to its brick")
        _unique(f"{where}: a prop at node", (prop.node for prop in self.props))
        held = {*self.brick_of_node} - {*self.blocked_nodes}
        for prop in self.props:
            _known(prop.label, "free node", (prop.node,), held)
        if math.hypot(*self.wind) > _STORM:
            raise SceneError(f"{where}: wind is {list(self.wind)}; give shares of the weight")

    def __repr__(self) -> str:
        counts = (
            f"{len(self.bricks)} bricks, {len(self.joints)} joints, "
            f"{len(self.grounds)} ground ends, {len(self.robots)} robots"
        )
        return f"<Scene {self.name}: {counts}>"

    def _check_references(self, where: str) -> None:
        names = {brick.name for brick in self.bricks}
        for joint in self.joints:
            _known(joint.label, "brick", joint.bricks, names)
        for ground in self.grounds:
            closes = ground.brick if ground.closes_with is None else ground.closes_with
            _known(ground.label, "brick", (ground.brick, closes), names)
        for load in self.loads:
            _known(load.label, "brick", (load.brick, load.starts_with), names)
        for name in Counter(self.build_order) - Counter(names):
            why = "occurs twice" if name in names else "is no brick"
            raise SceneError(f"{where}: build_order: {name} {why}; name every brick once")
        if left := names - {*self.build_order}:
            text = f"{len(left)} bricks are missing, {min(left)} among them"
            text = f"brick {min(left)} is missing" if len(left) == 1 else text
            raise SceneError(f"{where}: build_order: {text}; name every brick once")
        _known(f"{where}: blocked_nodes", "node", self.blocked_nodes, {*self.brick_of_node})
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
        """Return where an inner node lies."""
        return self.brick_of_node[node].node_position(node)

    def within_reach(self, robot: Robot) -> tuple[tuple[int, ...], ...]:
        """Return the nodes that a robot reaches, brick by brick in build order.

        Nodes that are blocked, or held by props, are not among them. That of an arm is in reach if
        a posture of it is possible when the brick is placed.
        """
        known: dict[Reach, tuple[tuple[int, ...], ...]]
        known = self.__dict__.setdefault("reached", {})
        if robot.reach not in known:
            covers = robot.reach.covers
            blocked = {*self.blocked_nodes, *(prop.node for prop in self.props)}
            known[robot.reach] = tuple(
                tuple(n for n in b.nodes if n not in blocked and covers(b.node_position(n)))
                for b in self.placed
            )
        if robot.arm is None:
            return known[robot.reach]
        until = required("permits")(self).until[self.robots.index(robot)]
        return tuple(
            tuple(n for i, n in enumerate(b.nodes) if n in own and until[2 * k + i + 1] > k + 1)
            for k, (b, own) in enumerate(zip(self.placed, known[robot.reach], strict=True))
        )

    @property
    def arms(self) -> tuple[Any, ...]:
        """The `seqopt.arms.Arm` of each robot, which must reach what it holds, or None."""
        return tuple(robot.arm for robot in self.robots)

    @property
    def has_arms(self) -> bool:
        """Whether a robot has an arm."""
        return any(self.arms)

    @cached_property
    def placed(self) -> tuple[Brick, ...]:
        """The bricks in build order."""
        by_name = {brick.name: brick for brick in self.bricks}
        return tuple(by_name[name] for name in self.build_order)

    @cached_property
    def placed_nodes(self) -> tuple[int, ...]:
        """The inner nodes in build order: of every brick both."""
        return tuple(node for brick in self.placed for node in brick.nodes)

    @cached_property
    def since(self) -> dict[int, int]:
        """From which brick count on each brick stands, by name."""
        return {name: count for count, name in enumerate(self.build_order, start=1)}

    @property
    def loading(self) -> str:
        """What loads and moves it beside its weight, in words; empty if nothing does."""
        largest = max((math.hypot(*load.force) for load in self.loads), default=0.0)
        wind = ", ".join(f"{share:.3g}" for share in self.wind)
        forces, moved = len(self.loads), sum(any(g.movement or ()) for g in self.grounds)
        words = {
            f"{forces} force{'s' * (forces != 1)}, up to {largest:g} N": forces,
            f"wind of ({wind}) times the weight": any(self.wind),
            f"weights times {self.weight_factor:g}": self.weight_factor != 1,
            f"movement of {moved} ground end{'s' * (moved != 1)}": moved,
        }
        return ", ".join(text for text, counts in words.items() if counts)

    def with_robots(self, *robots: Robot) -> Scene:
        """Return the same scene with other robots, ``*robots``: all of the new scene."""
        return replace(self, robots=robots)

    def with_grips(
        self,
        stiffness: float | Vector | str | None,
        rotational_stiffness: float | Vector | None = None,
    ) -> Scene:
        """Return the same scene with grips of all robots of a given stiffness.

        Joints of arms count as rigid then: what is given includes them.

        ``stiffness``, ``rotational_stiffness``: as of `Robot`; None for rigid grips, and for such
        as let their nodes turn; or both in words, as ``"1e6x1e6x5e5,turning=2e4"``.
        """
        given, turn = stiffness, rotational_stiffness
        if isinstance(given, str):
            given, turn = WORDS.parse_grips(given)
        bare = [(r, r.arm and replace(r.arm, joint_stiffness=())) for r in self.robots]
        return self.with_robots(
            *(replace(r, arm=a, stiffness=given, rotational_stiffness=turn) for r, a in bare)
        )

    def with_payloads(self, *payloads: float | str) -> Scene:
        """Return the same scene with payloads of robots, N: of all, or as ``"rob1=250"`` of one."""
        return self.with_robots(*WORDS.parse_payloads(self.robots, payloads))

    def with_props(self, *props: Prop | str) -> Scene:
        """Return the same scene with other props: all of the new scene.

        ``*props``: values, or words, as ``"13,27:1e6,push,capacity=300"`` or ``"every:1e6"``.
        """
        how = self.up, self.with_centering
        each = (WORDS.parse_props(p, *how) if isinstance(p, str) else (p,) for p in props)
        return replace(self, props=(*chain.from_iterable(each),))

    def with_centering(self, stiffness: float | Vector | None = None) -> Scene:
        """Return the same scene with a prop at every brick, as centering has, and no others.

        It holds the node at which the brick is not placed; a brick of which this is blocked has
        none. ``stiffness``: as of `Prop`.
        """
        taken = {*self.blocked_nodes, *(brick.placing_node for brick in self.bricks)}
        free = ([node for node in brick.nodes if node not in taken] for brick in self.placed)
        return self.with_props(*(Prop(node=n[0], stiffness=stiffness) for n in free if n))

    def standing_props(self, bricks: int, *, held: bool) -> tuple[Prop, ...]:
        """Return the props that hold while so many bricks stand, in the scene's order.

        ``held``: whether a robot holds any; the finished structure has none if nobody does.
        """
        if bricks == len(self.bricks) and not held:
            return ()
        since, of = self.since, self.brick_of_node
        return tuple(prop for prop in self.props if since[of[prop.node].name] <= bricks)

    def with_durations(self, *words: str) -> Scene:
        """Return the same scene with robots that take as long as words say.

        Examples
        --------
        >>> import seqopt
        >>> words = "fetch=30,place=10,approach=10,grip=5,release=5"
        >>> scene = seqopt.load_scene("arch25").with_durations(words, "rob3:place=25")
        >>> [robot.durations.place for robot in scene.robots]
        [10.0, 10.0, 25.0]
        """
        scene: Scene = required("with_durations")(self, *words)
        return scene

    @cached_property
    def grip_kinds(self) -> _GripKinds:
        """Compliance of its robots where they hold, and after them of its props."""
        alone = (r.name if r.arm and r.arm.joint_stiffness else "" for r in self.robots)
        own = [
            (r.stiffness, r.rotational_stiffness, r.payload, name)
            for r, name in zip(self.robots, alone, strict=True)
        ]
        any_force = math.nextafter(math.inf, 0)
        own += [(p.stiffness, None, p.capacity or any_force, "") for p in self.props]
        kinds = list(dict.fromkeys(own)) or [(None, None, math.inf, "")]
        shift, turn, payload, arms = zip(*kinds, strict=True)
        compliance = np.zeros((len(kinds), 6, 6))
        for k, given in enumerate(zip(shift, turn, strict=True)):
            for at, each in zip((0, 3), given, strict=True):
                if each is not None:
                    compliance[k, range(at, at + 3), range(at, at + 3)] = 1 / np.array(each)
        soft, turns = np.array(arms) != "", np.array([each is not None for each in turn])
        return _GripKinds(
            compliance=compliance,
            arms=soft,
            turns=turns,
            payload=np.array(payload),
            of_robot=np.array([kinds.index(each) for each in own], dtype=np.int64),
            first=min(self.brick_of_node),
            span=max(self.brick_of_node) - min(self.brick_of_node) + 1,
            rigid=not (compliance.any() or turns.any() or soft.any()),
            gives=compliance[:, :3, :3].any(axis=(1, 2)) | soft,
        )

    @cached_property
    def held_postures(self) -> Any:
        """The postures in which arms with compliant joints hold; None if there are no such arms.

        They are computed once, and go along to other processes.
        """
        soft = self.grip_kinds.arms.any()
        return required("compute_held_postures")(self) if soft else None

    def holding(self, postures: object) -> Scene:
        """Return the same scene with arms that hold in given postures, not those of its own."""
        out = replace(self)
        settle(out, held_postures=postures)
        return out

    @cached_property
    def prop_of_number(self) -> dict[int, Prop]:
        """Its props in order, by the numbers of their grips; see `grip_numbers`."""
        nodes = np.array([prop.node for prop in self.props], dtype=np.int64)
        holders = range(len(self.robots), len(self.robots) + len(self.props))
        return dict(zip(self.grip_kinds.numbers(nodes, holders).tolist(), self.props, strict=True))

    def prop_numbers(self, bricks: int, *, held: bool) -> tuple[int, ...]:
        """Return the numbers of the grips of `standing_props`."""
        standing = self.standing_props(bricks, held=held)
        return tuple(n for n, prop in self.prop_of_number.items() if prop in standing)

    def grip_numbers(
        self, grips: Sequence[int | None], bricks: int | None = None
    ) -> tuple[int, ...]:
        """Return the numbers by which engines are asked about grips of the robots.

        They are those of the nodes; where robots are not equally stiff, numbers also say which
        stiffness a grip has.

        ``grips``: the node of every robot of the scene in order, None of one that holds none;
        ``bricks``: how many stand, where grips of the props that hold then are to follow.
        """
        robots = [i for i, node in enumerate(grips) if node is not None]
        nodes = np.array([node for node in grips if node is not None], dtype=np.int64)
        own = tuple(self.grip_kinds.numbers(nodes, robots).tolist())
        return own if bricks is None else own + self.prop_numbers(bricks, held=bool(robots))

    def plot(self, bricks: int | None = None) -> Figure:
        """Draw the scene, or its first ``bricks`` in build order and the others pale."""
        figure: Figure = display(Scene, "plot")(self, bricks)
        return figure

    @property
    def up(self) -> Vector:
        """Unit vector against gravity; z where there is none."""
        size = math.hypot(*self.gravity)
        if size == 0:
            return (0.0, 0.0, 1.0)
        x, y, z = (-g / size for g in self.gravity)
        return x, y, z


def _parts(where: str, values: Iterable[_Part], kind: type[_Part]) -> tuple[_Part, ...]:
    found = tuple(values) if isinstance(values, Iterable) else (values,)
    for value in found:
        if not isinstance(value, kind):
            raise SceneError(f"{where}: give each as {kind.__name__}(...), not {short(value)}")
    return found


def _unique(what: str, names: Iterable[object]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise SceneError(f"{what} {twice[0]} occurs twice; give each its own")


def _known(where: str, kind: str, wanted: Iterable[int], known: set[int]) -> None:
    for name in wanted:
        if name not in known:
            raise SceneError(f"{where}: there is no {kind} {name}; known are {sorted(known)}")


def _hang_free(names: Iterable[int]) -> str:
    """Describe bricks that no joint ties to the ground; of many, the first ones."""
    listed = sorted(names)
    shown = ", ".join(map(str, listed[:_SHOWN]))
    more = f" and {len(listed) - _SHOWN} more" if len(listed) > _SHOWN else ""
    hang = f"bricks {shown}{more} hang" if len(listed) > 1 else f"brick {shown} hangs"
    return f"{hang} free: no joint leads to the ground"


Order = tuple[int, ...]
_PART = re.compile(r"(-?\d+)(?:\.\.(-?\d+))?")


def _from_all_ends(scene: Scene) -> Order:
    """Return the order that builds from all ground ends at once, one brick each in turn."""
    graph = nx.Graph([joint.bricks for joint in scene.joints])
    graph.add_nodes_from(scene.build_order)
    far: dict[int, tuple[int, int]] = {}
    for end, ground in enumerate(scene.grounds):
        for brick, joints in nx.single_source_shortest_path_length(graph, ground.brick).items():
            far[brick] = min(far.get(brick, (joints, end)), (joints, end))
    last = (len(scene.bricks), len(scene.grounds))
    return tuple(sorted(scene.build_order, key=lambda name: far.get(name, last)))


ORDERS: dict[str, Callable[[Scene], Order]] = {
    "reversed": lambda scene: scene.build_order[::-1],
    "ends": _from_all_ends,
}
"""Orders by name."""


def _parse_order(scene: Scene, text: str) -> Order:
    """Return an order from a key of `ORDERS`, or names with commas between, runs as ``25..13``."""
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
    """Return a scene built in an order: names of all bricks, or words for `_parse_order`."""
    if order is None:
        return scene
    where = f"scene {scene.name}: order"
    given = _parse_order(scene, order) if isinstance(order, str) else wholes(where, order)
    return replace(scene, build_order=given)


def find_postures(scene: Scene, cache: Path | str | None = None, tell: Tell | None = None) -> None:
    """Compute the postures of arms, or read them from a folder, before they are asked for."""
    if not (cache is None or (isinstance(cache, str | Path) and str(cache))):
        raise ProblemError(f"cache is {cache!r}; give the path of a folder")
    if scene.has_arms:
        required("find_postures")(scene, cache, tell)


def _reachable(scene: Scene, robot: Robot, bricks: int) -> tuple[int, ...]:
    """Return the nodes of the first bricks that a robot may hold while these stand, in order."""
    nodes = tuple(node for brick in scene.within_reach(robot)[:bricks] for node in brick)
    if robot.arm is None:
        return nodes
    until = required("permits")(scene).until[scene.robots.index(robot)]  # ends, by place
    place = {node: i for i, node in enumerate(scene.placed_nodes, start=1)}
    return tuple(node for node in nodes if until[place[node]] > bricks)


def loads(scene: Scene, robot: Robot) -> Floats:
    """Return the load of a robot with every brick in build order, its tool included, (B,), N."""
    tool = 0.0 if robot.arm is None else robot.arm.tool_mass
    gravity = scene.weight_factor * float(np.linalg.norm(scene.gravity))
    return gravity * (np.array([brick.mass for brick in scene.placed]) + tool)


def can_carry(scenes: Sequence[Scene], robot: int) -> Bools:
    """Return whether a robot can carry each brick in build order in all scenes, (B,)."""
    pairs = [(scene, scene.robots[robot]) for scene in scenes]
    within = [loads(scene, own) <= own.payload * (1 + _ROUNDING) for scene, own in pairs]
    return np.asarray(np.all(within, axis=0))


def _too_heavy(scenes: Sequence[Scene], place: int, robots: Sequence[int]) -> str:
    """Describe the robots that cannot carry a brick and their tool in a scene; or empty.

    ``place``: index of the brick in build order, may be negative.
    """
    for scene in scenes:
        brick, pull = scene.placed[place], math.hypot(*scene.gravity) * scene.weight_factor
        weak = []
        for robot in (scene.robots[r] for r in robots):
            tool = 0.0 if robot.arm is None else robot.arm.tool_mass * pull
            if brick.mass * pull + tool > robot.payload * (1 + _ROUNDING):
                beside = f", its tool weighs {tool:.1f} N" if tool else ""
                weak.append(f"{robot.name} ({robot.payload:g} N{beside})")
        if weak:
            weight = f"brick {brick.name} weighs {brick.mass * pull:.1f} N"
            return f"{weight}, more than the payload of {', '.join(weak)}"
    return ""


def with_robots(scene: Scene, count: int) -> Scene:
    """Return a scene with one to five robots: its own first, then mobile ones.

    Further robots reach every node, have the largest payload of the scene's own, and the compliance
    and durations of the first of them.
    """
    if not isinstance(count, Integral) or not 1 <= count <= MOST_ROBOTS:
        raise StepError(f"{short(count)} robots: give a number from 1 to {MOST_ROBOTS}")
    robots = list(scene.robots[:count])
    names = {robot.name for robot in robots}
    fresh = [f"rob{i}" for i in range(1, 2 * MOST_ROBOTS + 1) if f"rob{i}" not in names]
    payload = max((robot.payload for robot in scene.robots), default=float("nan"))
    like = robots[0] if robots else Robot(name=fresh[0], payload=payload)
    more = replace(like, payload=payload, reach=Anywhere(), arm=None)
    robots += [replace(more, name=name) for name in fresh[: count - len(robots)]]
    return scene.with_robots(*robots)


class _NoRules:
    """Which states arms can be in, by a second way for the judge: all, of robots without any."""

    def allow(self, bricks: int, states: Ints) -> Bools:
        """Return which states (n, c) of places have postures that go together, (n,)."""
        return np.ones(len(states), dtype=bool)


def _posture_rules(scene: Scene, team: Sequence[int]) -> _NoRules:
    """Return the judge's rules of arms; ``team``: robots of the columns of states, by index."""
    rules: _NoRules = required("PostureRules")(scene, team) if scene.has_arms else _NoRules()
    return rules


def _check_postures(scene: Scene, steps: Sequence[object]) -> None:
    """Raise a `StepError` if arms have no postures that go together in a step.

    Or if the compliance of their grips is not that of their joints.
    """
    if scene.has_arms:
        required("check_postures")(scene, steps)
