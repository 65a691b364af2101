"""The double-cross network of a scene: nodes and edges, and the brick count that brings each.

Every brick has an inner edge between its two inner nodes. Every joint splits the connection of
two bricks into two half-edges that meet in a joint node; a half-edge whose other brick is not
placed yet is a free stub. A ground end adds a stub from its joint node to a fixed base node.
Source: section 3.2.1 of the study.

Bricks, nodes, edges and springs are sorted by the brick count that brings them, so those of a
partial structure are the first ones of each array.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from seqopt.scene import Brick, Ground, Joint, Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
TIE = 1e-6  # two inner nodes are equally far from a joint within this share of the distance
GROUND = -1  # stands for the ground where a brick's place in the build order is expected


class Kind(IntEnum):
    """What a node or an edge of the network is."""

    INNER = 0  # inner node; edge between the inner nodes of a brick
    JOINT = 1  # joint node; half-edge between an inner node and a joint node
    BASE = 2  # fixed node of a ground end; stub that leads to it


@dataclass(frozen=True)
class Springs:
    """The joints and ground ends of a network, as arrays over springs.

    Attributes
    ----------
    bodies : (S, 2) int
        Places in the build order of the bricks they join; `GROUND` first for a ground end.
    since : (S,) int
        Brick count from which the spring acts.
    node : (S,) int
        Joint node.
    position, anchor : (S, 3) float
        m; the anchor of a joint between bricks is its position.
    axes : (S, 3, 3) float
        Rows are the unit vectors of the spring's own axes.
    translational_stiffness, rotational_stiffness : (S, 3) float
        N/m, N m/rad.
    support : int
        Index of the spring of the scene's first ground end.
    """

    bodies: Ints
    since: Ints
    node: Ints
    position: Floats
    anchor: Floats
    axes: Floats
    translational_stiffness: Floats
    rotational_stiffness: Floats
    support: int


@dataclass(frozen=True)
class Network:
    """The double-cross network of a scene as arrays; see the module's text for the order.

    Attributes
    ----------
    scene : Scene
    springs : Springs
    node_position : (N, 3) float
        m.
    node_kind, node_since : (N,) int
    node_spring : (N,) int
        Spring of a joint or base node, -1 for an inner node.
    node_brick : (N,) int
        Place in the build order of an inner node's brick, -1 for others.
    node_name : (N,) object
        The scene's number for an inner node; for others ``("joint", a, b)``,
        ``("joint", "ground", a)`` or ``("base", "ground", a)`` with the names of the bricks, and a
        counter where two springs join the same ones.
    inner : (B, 2) int
        Nodes of every brick.
    edge_nodes : (E, 2) int
        From the brick outward for half-edges and stubs.
    edge_kind, edge_since, edge_brick, edge_spring : (E,) int
    weight : (B, 3) float
        Weight of every brick as a force, N.
    """

    scene: Scene
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

    @cached_property
    def edge_axis(self) -> Floats:
        """Unit vectors along the edges, (E, 3)."""
        step = np.diff(self.node_position[self.edge_nodes], axis=1)[:, 0]
        return np.asarray(step / np.linalg.norm(step, axis=1, keepdims=True))

    @cached_property
    def place_of_node(self) -> dict[int, int]:
        """Index of every inner node by its number in the scene."""
        return {
            int(name): i  # type: ignore[call-overload]
            for i, name in enumerate(self.node_name)
            if self.node_kind[i] == Kind.INNER
        }

    @cached_property
    def place_of_grip(self) -> tuple[Ints, Ints]:
        """Numbers of all inner nodes in the scene, ascending, and their places in ``inner``.

        A node that must not be held has a place after all others.
        """
        numbers = np.array([self.node_name[i] for i in self.inner.ravel()], dtype=np.int64)
        order = np.argsort(numbers)
        blocked = np.isin(numbers[order], self.scene.blocked_nodes)
        return numbers[order], np.where(blocked, len(numbers), order)

    def count_nodes(self, bricks: int) -> int:
        """Return how many nodes the structure of the first ``bricks`` bricks has."""
        return int(np.searchsorted(self.node_since, bricks, side="right"))

    def count_edges(self, bricks: int) -> int:
        """Return how many edges the structure of the first ``bricks`` bricks has."""
        return int(np.searchsorted(self.edge_since, bricks, side="right"))

    def graph(self, bricks: int) -> nx.Graph[object]:
        """Return the partial structure as a graph.

        Nodes carry ``kind`` and ``position`` (m), edges ``number`` (from 1), ``kind`` and
        ``length`` (m).
        """
        graph: nx.Graph[object] = nx.Graph(name=self.scene.name, bricks=bricks)
        for i in range(self.count_nodes(bricks)):
            graph.add_node(
                self.node_name[i],
                kind=Kind(self.node_kind[i]).name.lower(),
                position=tuple(self.node_position[i].tolist()),
            )
        for e in range(self.count_edges(bricks)):
            a, b = self.edge_nodes[e]
            graph.add_edge(
                self.node_name[a],
                self.node_name[b],
                number=e + 1,
                kind=Kind(self.edge_kind[e]).name.lower(),
                length=float(np.linalg.norm(self.node_position[b] - self.node_position[a])),
            )
        return graph


@dataclass(frozen=True)
class _Node:
    name: object
    kind: Kind
    since: int
    position: tuple[float, float, float]
    spring: int = -1
    brick: int = -1


@dataclass(frozen=True)
class _Edge:
    nodes: tuple[object, object]
    kind: Kind
    since: int
    brick: int = -1
    spring: int = -1


def network(scene: Scene) -> Network:
    """Return the network of a whole scene."""
    place = {brick.name: i for i, brick in enumerate(scene.placed)}
    springs = _springs(scene, place)
    names = _joint_names(springs)
    nodes, edges = [], []
    for i, brick in enumerate(scene.placed):
        for number in brick.nodes:
            nodes.append(_Node(number, Kind.INNER, i + 1, brick.node_position(number), brick=i))
        edges.append(_Edge(brick.nodes, Kind.INNER, i + 1, brick=i))
    for s, (spring, since) in enumerate(springs):
        ends = spring.bricks if isinstance(spring, Joint) else (spring.brick,)
        name = names[s]
        nodes.append(_Node(name, Kind.JOINT, min(place[b] for b in ends) + 1, spring.position, s))
        for b in ends:
            brick = scene.placed[place[b]]
            edges.append(
                _Edge((_nearest(brick, spring), name), Kind.JOINT, place[b] + 1, place[b], s)
            )
        if isinstance(spring, Ground):
            base = ("base", *name[1:])
            nodes.append(_Node(base, Kind.BASE, since, spring.anchor, s))
            edges.append(_Edge((name, base), Kind.BASE, since, spring=s))
    nodes.sort(key=lambda node: node.since)
    edges.sort(key=lambda edge: edge.since)
    return _arrays(scene, place, springs, nodes, edges)


def _springs(scene: Scene, place: dict[int, int]) -> list[tuple[Joint | Ground, int]]:
    """Return joints and ground ends with the brick count from which each acts, in that order."""
    springs: list[tuple[Joint | Ground, int]] = []
    for ground in scene.grounds:
        closes = ground.brick if ground.closes_with is None else ground.closes_with
        springs.append((ground, max(place[ground.brick], place[closes]) + 1))
    for joint in scene.joints:
        springs.append((joint, max(place[b] for b in joint.bricks) + 1))
    return sorted(springs, key=lambda entry: entry[1])


def _joint_names(springs: list[tuple[Joint | Ground, int]]) -> list[tuple[object, ...]]:
    """Return a name for the joint node of every spring."""
    names: list[tuple[object, ...]] = []
    for spring, _ in springs:
        name = spring.bricks if isinstance(spring, Joint) else ("ground", spring.brick)
        same = sum(other[1:3] == name for other in names)
        names.append(("joint", *name, same + 1) if same else ("joint", *name))
    return names


def _nearest(brick: Brick, spring: Joint | Ground) -> int:
    """Return the inner node through which the brick meets the spring: the nearer, or the first."""
    first, second = (
        np.linalg.norm(np.subtract(brick.node_position(n), spring.position)) for n in brick.nodes
    )
    return brick.nodes[0] if first <= second * (1 + TIE) else brick.nodes[1]


def _arrays(
    scene: Scene,
    place: dict[int, int],
    springs: list[tuple[Joint | Ground, int]],
    nodes: list[_Node],
    edges: list[_Edge],
) -> Network:
    index = {node.name: i for i, node in enumerate(nodes)}
    along = np.array([spring.along for spring, _ in springs])
    across = np.array([spring.across for spring, _ in springs])
    support = scene.grounds[0]
    return Network(
        scene=scene,
        springs=Springs(
            bodies=np.array([_bodies(spring, place) for spring, _ in springs]),
            since=np.array([since for _, since in springs]),
            node=np.array([index[name] for name in _joint_names(springs)]),
            position=np.array([spring.position for spring, _ in springs]),
            anchor=np.array([_anchor(spring) for spring, _ in springs]),
            axes=np.stack([along, across, np.cross(along, across)], axis=1),
            translational_stiffness=np.array([s.translational_stiffness for s, _ in springs]),
            rotational_stiffness=np.array([s.rotational_stiffness for s, _ in springs]),
            support=next(i for i, (spring, _) in enumerate(springs) if spring is support),
        ),
        node_position=np.array([node.position for node in nodes]),
        node_kind=np.array([node.kind for node in nodes]),
        node_since=np.array([node.since for node in nodes]),
        node_spring=np.array([node.spring for node in nodes]),
        node_brick=np.array([node.brick for node in nodes]),
        node_name=tuple(node.name for node in nodes),
        inner=np.array([[index[n] for n in brick.nodes] for brick in scene.placed]),
        edge_nodes=np.array([[index[name] for name in edge.nodes] for edge in edges]),
        edge_kind=np.array([edge.kind for edge in edges]),
        edge_since=np.array([edge.since for edge in edges]),
        edge_brick=np.array([edge.brick for edge in edges]),
        edge_spring=np.array([edge.spring for edge in edges]),
        weight=np.array([brick.mass for brick in scene.placed])[:, None] * np.array(scene.gravity),
    )


def _bodies(spring: Joint | Ground, place: dict[int, int]) -> tuple[int, int]:
    if isinstance(spring, Joint):
        a, b = sorted(place[name] for name in spring.bricks)
        return a, b
    return GROUND, place[spring.brick]


def _anchor(spring: Joint | Ground) -> tuple[float, float, float]:
    return spring.anchor if isinstance(spring, Ground) else spring.position
