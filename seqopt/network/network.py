"""The double-cross network of section 3.2.1 of Bruun et al.: a graph, compiled to arrays once.

Every brick has an inner edge. Every joint splits the connection of two bricks into half-edges that
meet in a joint node, free stubs until the other brick is placed; a ground end adds a stub to a
fixed base node. Parts are sorted by brick count: those of a partial structure come first in every
array.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Container, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict

import networkx as nx
import numpy as np

from seqopt._registry import Shown, display
from seqopt.arrays import Bools, Floats, FrozenValue, Ints, Vector, frozen
from seqopt.errors import SceneError
from seqopt.scene._checks import frames, units
from seqopt.scene.parts import Ground, Joint
from seqopt.scene.scene import Scene, in_order

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DoubleCross: TypeAlias = "nx.DiGraph[Any]"

_OFF_PLANE = 1e-9  # lever of a weight about the line of its nodes treated as zero, over the brick


_EQUALLY_FAR = 1e-6  # inner nodes whose distances from a joint differ by no larger share
GROUND = -1  # stands for the ground where a brick's index in build order is expected


class PartKind(IntEnum):
    """Kind of a node or an edge of the network.

    Arrays are compared with its values: of a member NumPy asks the class for more, and an interrupt
    that comes just then is lost.
    """

    INNER = 0  # inner node; edge between the inner nodes of a brick
    JOINT = 1  # joint node; half-edge between an inner node and a joint node
    BASE = 2  # fixed node of a ground end; stub that leads to it


class _PartData(TypedDict):
    """What the graph says of every node and edge."""

    kind: PartKind
    since: int  # the brick count that brings it
    spring: int  # of a joint or base node, a half-edge or stub; -1 of others
    brick: int  # index in build order, of an inner node or edge and of a half-edge; -1 of others


class _NodeData(_PartData):
    """What the graph says of a node."""

    position: Vector  # m


@dataclass(frozen=True, eq=False, repr=False)
class Springs(FrozenValue):
    """The joints and ground ends of a network, as arrays over springs; in order of `since`."""

    bodies: Ints  # (S, 2); indices in build order of the bricks they join, or `GROUND` first
    since: Ints  # (S,); brick count from which each acts
    node: Ints  # (S,); joint nodes
    position: Floats  # (S, 3); m
    anchor: Floats  # (S, 3); m; of a joint between bricks its position
    axes: Floats  # (S, 3, 3); rows are the unit vectors of the spring's own axes
    translational_stiffness: Floats  # (S, 3); N/m
    rotational_stiffness: Floats  # (S, 3); N m/rad
    support: Ints  # (G,); the springs that are ground ends, in the scene's order
    movement: Floats  # (S, 6); how the ground moves at a ground end, m and rad; zero for joints
    thickness: Floats  # (S,); of joints that say so, m; NaN for others
    face: tuple[Floats, ...]
    """Corners (m, 3) of the faces over which bodies touch, m; none of springs that do not say them.
    With corners, the first axis points from the first body into the second."""

    def acting(self, bricks: int) -> Ints:
        """Return the springs (s,) that act on a partial structure, ascending."""
        return np.flatnonzero(self.since <= bricks)

    @cached_property
    def stiffness(self) -> Floats:
        """Translational and rotational stiffness side by side, (S, 6), N/m and N m/rad."""
        return frozen(np.hstack([self.translational_stiffness, self.rotational_stiffness]))


@dataclass(frozen=True, eq=False, repr=False)
class Compliances(FrozenValue):
    """The compliance of every grip by M kinds: of grippers, and of arms behind them."""

    compliance: Floats
    """(M, 6, 6): how a node shifts and turns against the hand that holds it for a force and a
    moment on it, m and rad for N and N m; zero of a rigid grip."""
    transmits_moment: Bools  # (M,); which kinds bear moments; others let their nodes turn
    index: Ints
    """(K, N): the kind of a grip of each kind of robots at each node, -1 where it is not known; one
    column where nodes do not matter."""
    nodes: Ints  # (N,); numbers of nodes, ascending

    def at(self, node: Ints, kind: Ints) -> Ints:
        """Return the kinds (S, r) of grips of robots by kind on nodes; (1, 1) if all are equal.

        -1 of grips whose compliance is not known.
        """
        if len(self.compliance) == 1:
            return np.zeros((1, 1), dtype=np.int64)
        if self.index.shape[1] == 1:
            return kind
        return np.asarray(self.index[kind, np.searchsorted(self.nodes, node)])


@dataclass(frozen=True, eq=False, repr=False)
class Network(Shown, FrozenValue):
    """The double-cross network of a scene as a graph and as arrays, in the order of the module.

    Attributes
    ----------
    scene : Scene
    graph : networkx.DiGraph
        The double cross, which cannot be changed: nodes by ``node_name``, edges from the brick
        outward; both say their kind, since, spring and brick, nodes their position too.
    springs : Springs
    node_position : (N, 3) float
        m.
    node_kind, node_since : (N,) int
        What a node is, `PartKind`, and the brick count that brings it.
    node_spring : (N,) int
        Spring of a joint or base node, -1 for an inner node.
    node_brick : (N,) int
        Index in build order of an inner node's brick, -1 for others.
    node_name : (N,) object
        The scene's number for an inner node; for others ``("joint", a, b)``,
        ``("joint", "ground", a)`` or ``("base", "ground", a)`` with the names of the bricks, and a
        counter where two springs join the same ones.
    inner : (B, 2) int
        Nodes of every brick.
    edge_nodes : (E, 2) int
        From the brick outward for half-edges and stubs.
    edge_kind, edge_since, edge_brick, edge_spring : (E,) int
        As for nodes.
    weight : (B, 3) float
        Weight of every brick as a force, N.

    Examples
    --------
    >>> from seqopt.network.network import build_network
    >>> from seqopt.scene.scene_file import load_scene
    >>> network = build_network(load_scene("arch25"))
    >>> network
    <Network arch25: 25 bricks, 26 springs, 78 nodes, 77 edges>
    >>> network.count_edges(3), network.springs.acting(3)
    (10, array([0, 1, 2]))
    """

    scene: Scene
    graph: DoubleCross = field(compare=False)
    springs: Springs
    node_position: Floats
    node_kind: Ints
    node_since: Ints
    node_spring: Ints
    node_brick: Ints
    node_name: tuple[object, ...]
    inner: Ints
    edge_nodes: Ints
    edge_kind: Ints
    edge_since: Ints
    edge_brick: Ints
    edge_spring: Ints
    weight: Floats
    derived: dict[str, Any] = field(default_factory=dict, init=False, compare=False)
    """Values that outer rooms derive from the network alone and cache with it, by name."""

    def __repr__(self) -> str:
        bricks = f"{len(self.inner)} bricks, {len(self.springs.since)} springs"
        nodes = f"{len(self.node_kind)} nodes, {len(self.edge_kind)} edges"
        return f"<Network {self.scene.name}: {bricks}, {nodes}>"

    @cached_property
    def centroid(self) -> Floats:
        """Centroids of the bricks in build order, (B, 3), m."""
        middle = np.asarray(self.node_position[self.inner].mean(axis=1))
        for i, brick in enumerate(self.scene.placed):
            if brick.node_offsets is not None:
                middle[i] = brick.position
        return frozen(middle)

    @cached_property
    def inner_weight(self) -> Floats:
        """Share of its brick's weight at every inner node, (2B, 3), N; order of ``inner``."""
        half = np.repeat(0.5 * self.weight, 2, axis=0)
        for i, brick in enumerate(self.scene.placed):
            if brick.node_offsets is None:
                continue
            weight, ends = self.weight[i], self.node_position[self.inner[i]] - brick.position
            span, middle = 0.5 * (ends[1] - ends[0]), 0.5 * (ends[0] + ends[1])
            moment = -np.cross(middle, weight)  # of the weight about the middle between the nodes
            along = abs(float(moment @ span)) / float(np.linalg.norm(span))
            if along > _OFF_PLANE * max(brick.dimensions) * float(np.linalg.norm(weight)):
                line = f"the line through its nodes {list(brick.nodes)}"
                raise SceneError(
                    f"brick {brick.name}: its weight turns it about {line}; give nodes above, "
                    "below or on either side of the centroid"
                )
            shift = np.cross(moment, span) / (2 * span @ span)
            half[2 * i : 2 * i + 2] += [-shift, shift]
        return frozen(half)

    @cached_property
    def loads(self) -> tuple[Ints, Ints, Floats]:
        """Loads and wind: bricks (L,), brick counts from which they act (L,), wrenches (L, 6)."""
        scene, index = self.scene, {name: since - 1 for name, since in self.scene.since.items()}
        brick = np.array([index[load.brick] for load in scene.loads], dtype=np.int64)
        last = np.array([index[load.starts_with] for load in scene.loads], dtype=np.int64)
        force = np.array([load.force for load in scene.loads]).reshape(-1, 3)
        arm = np.zeros_like(force)
        for i, load in enumerate(scene.loads):
            if load.position is not None:
                arm[i] = load.position - self.centroid[brick[i]]
        wrench = np.hstack([force, np.cross(arm, force)])
        if any(scene.wind):
            every = np.arange(len(scene.placed))
            mass = np.array([each.mass for each in scene.placed])[:, None]
            blown = mass * np.linalg.norm(scene.gravity) * np.array(scene.wind)
            brick, last = np.concatenate([brick, every]), np.concatenate([last, every])
            wrench = np.vstack([wrench, np.hstack([blown, np.zeros_like(blown)])])
        return frozen((brick, 1 + np.maximum(brick, last), wrench))

    def applied(self, bricks: int, before: int = 0) -> Floats:
        """Return the wrenches of loads and wind on the bricks of a partial structure.

        ``before``: only those that do not act yet at this brick count. Result (b, 6): force and
        moment about the centroid, N and N m.
        """
        brick, since, wrench = self.loads
        now, out = (since > before) & (since <= bricks), np.zeros((bricks, 6))
        np.add.at(out, brick[now], wrench[now])
        return out

    def inner_load(self, bricks: int) -> Floats:
        """Return the share of weight and loads at every inner node, (2b, 3), N.

        Half of a load each, as of a weight; its moments cause no force along the inner edges.
        """
        half = 0.5 * self.applied(bricks)[:, :3]
        return np.asarray(self.inner_weight[: 2 * bricks] + np.repeat(half, 2, axis=0))

    def ground_motion(self, bricks: int) -> Floats:
        """Return the displacements (n, 3) of nodes by the ground with fixed bricks, m.

        A base node moves with the ground, its joint node half as far.
        """
        out, springs = np.zeros((self.count_nodes(bricks), 3)), self.springs
        for s in np.flatnonzero((springs.since <= bricks) & springs.movement.any(axis=1)):
            at, turn = springs.movement[s, :3], springs.movement[s, 3:]
            out[springs.node[s]] = 0.5 * at
            base = (self.node_kind == PartKind.BASE.value) & (self.node_spring == s)
            out[np.flatnonzero(base)] = at + np.cross(turn, springs.anchor[s] - springs.position[s])
        return out

    @cached_property
    def edge_axis(self) -> Floats:
        """Unit vectors along the edges, (E, 3)."""
        step = np.diff(self.node_position[self.edge_nodes], axis=1)[:, 0]
        return frozen(units(step))

    @cached_property
    def lever(self) -> float:
        """The length of the longest inner edge, which scales moments, m."""
        ends = self.node_position[self.inner]
        return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max())

    @cached_property
    def compliances(self) -> Compliances:
        """Compliances of the scene's grips: of robots, and of the joints of arms behind them."""
        kinds, held, scene = self.scene.grip_kinds, self.scene.held_postures, self.scene
        parts, turns = [kinds.compliance], [kinds.turns]
        nodes = np.zeros(1, dtype=np.int64) if held is None else held.nodes
        index = np.repeat(np.arange(len(kinds.turns))[:, None], len(nodes), axis=1)
        if held is not None:
            behind = zip(held.robots, held.rows, held.compliance(scene.arms), strict=True)
            for robot, postures, joints in behind:
                own, there = kinds.of_robot[robot], postures >= 0
                index[own] = -1
                index[own, there] = sum(map(len, parts)) + np.arange(there.sum())
                parts.append(kinds.compliance[own] + joints[there])
                turns.append(np.repeat(kinds.turns[own], there.sum()))
        return Compliances(np.concatenate(parts), np.concatenate(turns), index, nodes)

    @cached_property
    def index_of_grip(self) -> tuple[Ints, Ints]:
        """Numbers of inner nodes, (2B,) ascending, and their indices in ``inner.ravel()``.

        A node that cannot be held has an index after all others.
        """
        numbers = np.array([self.node_name[i] for i in self.inner.ravel()], dtype=np.int64)
        order = np.argsort(numbers)
        blocked = np.isin(numbers[order], self.scene.blocked_nodes)
        return frozen((numbers[order], np.where(blocked, len(numbers), order)))

    def count_nodes(self, bricks: int) -> int:
        """Return the number of nodes of a partial structure."""
        return int(np.searchsorted(self.node_since, bricks, side="right"))

    def count_edges(self, bricks: int) -> int:
        """Return the number of edges of a partial structure."""
        return int(np.searchsorted(self.edge_since, bricks, side="right"))

    def partial(self, bricks: int, loose: Container[int] = ()) -> DoubleCross:
        """Return the graph of a partial structure, without the joints of loose springs."""
        names = self.node_name[: self.count_nodes(bricks)]
        return self.graph.subgraph(n for n in names if self.graph.nodes[n]["spring"] not in loose)

    def plot(self, bricks: int | None = None) -> Figure:
        """Draw the network, or its part of the first ``bricks``, in build order."""
        figure: Figure = display(Network, "plot")(self, bricks)
        return figure


_Springs = list[tuple[Joint | Ground, int]]  # with the brick counts from which they act


def build_network(scene: Scene, order: Sequence[int] | str | None = None) -> Network:
    """Return the network of a whole scene.

    Parameters
    ----------
    scene : Scene
    order : sequence of int or str, optional
        The order in which bricks are placed, in a form that `seqopt.scene.scene.in_order`
        accepts; by default the scene's own.

    Returns
    -------
    Network
        The network; its scene has this order.

    Raises
    ------
    SceneError
        If the argument is not a scene, or the order does not name every brick once.

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> build_network(load_scene("arch25"))
    <Network arch25: 25 bricks, 26 springs, 78 nodes, 77 edges>
    """
    if not isinstance(scene, Scene):
        kind = type(scene).__name__
        raise SceneError(f"a {kind} is not a scene; give one, as load_scene('arch25') returns it")
    scene = in_order(scene, order)
    every: list[Joint | Ground] = [*scene.grounds, *scene.joints]
    closing = [getattr(spring, "closes_with", None) for spring in every]
    counts = [
        max(scene.since[b] for b in (*spring.ends, last) if b is not None)
        for spring, last in zip(every, closing, strict=True)
    ]
    ascending = np.argsort(counts, kind="stable")
    springs = [(every[i], counts[i]) for i in ascending]
    support = np.argsort(ascending)[: len(scene.grounds)]
    return _compile(scene, _double_cross(scene, springs), springs, support)


def network_of(given: Network | Scene) -> Network:
    """Return a network unchanged, or the network of a scene."""
    if isinstance(given, Network | Scene):
        return given if isinstance(given, Network) else build_network(given)
    kind = type(given).__name__
    raise SceneError(f"a {kind} is not a network; give build_network(scene), or the scene itself")


def _double_cross(scene: Scene, springs: _Springs) -> DoubleCross:
    """Return the graph of a scene: every brick, then every spring with what it brings."""
    graph: DoubleCross = nx.DiGraph(name=scene.name)
    for i, brick in enumerate(scene.placed):
        own = _PartData(kind=PartKind.INNER, since=i + 1, spring=-1, brick=i)
        for number in brick.nodes:
            graph.add_node(number, **_NodeData(**own, position=brick.node_position(number)))
        graph.add_edge(*brick.nodes, **own)
    alike = Counter[tuple[object, ...]]()  # springs that join the same bodies are counted
    for s, (spring, since) in enumerate(springs):
        joined = spring.bricks if isinstance(spring, Joint) else ("ground", spring.brick)
        alike[joined] += 1
        name = ("joint", *joined, *([alike[joined]] if alike[joined] > 1 else []))
        ends, at = [scene.since[b] for b in spring.ends], spring.position
        own = _PartData(kind=PartKind.JOINT, since=min(ends), spring=s, brick=-1)
        graph.add_node(name, **_NodeData(**own, position=at))
        for count in ends:  # each brick meets it through its nearer node, or the first
            brick = scene.placed[count - 1]
            first, second = (math.dist(brick.node_position(node), at) for node in brick.nodes)
            met = brick.nodes[int(first > second * (1 + _EQUALLY_FAR))]
            graph.add_edge(met, name, **{**own, "since": count, "brick": count - 1})
        if isinstance(spring, Ground):
            base = ("base", *name[1:])
            own = _PartData(kind=PartKind.BASE, since=since, spring=s, brick=-1)
            graph.add_node(base, **_NodeData(**own, position=spring.anchor))
            graph.add_edge(name, base, **own)
    nx.freeze(graph)
    return graph


def _compile(scene: Scene, graph: DoubleCross, springs: _Springs, support: Ints) -> Network:
    """Compile a double cross to arrays; the order in which its parts were added does not matter."""
    last = {end for _, end, data in graph.edges.data() if data["kind"] is PartKind.INNER}

    def appears(part: tuple[Any, ...]) -> tuple[int, int, int, bool]:
        data: _PartData = part[-1]
        return data["since"], data["spring"], data["kind"], part[0] in last

    nodes: list[Any] = sorted(graph.nodes.data(), key=appears)
    edges: list[Any] = sorted(graph.edges.data(), key=appears)
    index = {name: i for i, (name, _) in enumerate(nodes)}
    arrays = {
        f"{what}_{key}": np.array([int(part[-1][key]) for part in parts])
        for what, parts in (("node", nodes), ("edge", edges))
        for key in _PartData.__annotations__
    }
    joint = np.flatnonzero(arrays["node_kind"] == PartKind.JOINT.value)
    ends = np.array([[index[name] for name in edge[:2]] for edge in edges])
    mass = np.array([brick.mass for brick in scene.placed])[:, None]
    return Network(
        scene=scene,
        graph=graph,
        springs=_springs(scene, springs, support, joint[np.argsort(arrays["node_spring"][joint])]),
        node_position=np.array([data["position"] for _, data in nodes]),
        node_name=tuple(index),
        inner=ends[arrays["edge_kind"] == PartKind.INNER.value],
        edge_nodes=ends,
        weight=mass * (scene.weight_factor * np.array(scene.gravity)),
        **arrays,
    )


def _springs(scene: Scene, springs: _Springs, support: Ints, node: Ints) -> Springs:
    """Return springs as arrays; with a face, the first axis points into the second body."""
    each = [spring for spring, _ in springs]
    place = [[scene.since[name] - 1 for name in spring.ends] for spring in each]
    turned = [
        s.face is not None and ends[0] > ends[-1] for s, ends in zip(each, place, strict=True)
    ]
    along = np.array([spring.along for spring in each]) * np.where(turned, -1.0, 1.0)[:, None]
    movement = np.array([getattr(spring, "movement", None) or np.zeros(6) for spring in each])
    position = np.array([spring.position for spring in each])
    anchor = np.array([getattr(spring, "anchor", spring.position) for spring in each])
    movement[:, :3] += np.cross(movement[:, 3:], position - anchor)  # where the spring is
    return Springs(
        bodies=np.array([sorted([GROUND, *ends][-2:]) for ends in place]),  # the lower one first
        since=np.array([since for _, since in springs]),
        node=node,
        position=position,
        anchor=anchor,
        axes=frames(along, np.array([spring.across for spring in each])),
        translational_stiffness=np.array([spring.translational_stiffness for spring in each]),
        rotational_stiffness=np.array([spring.rotational_stiffness for spring in each]),
        support=support,
        movement=movement,
        thickness=np.array([spring.thickness for spring in each], dtype=float),  # None is NaN
        face=tuple(np.array(s.corners or (), dtype=float).reshape(-1, 3) for s in each),
    )
