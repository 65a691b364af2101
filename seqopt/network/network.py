"""The double-cross network: nodes and edges, and the brick count that brings each.

Every brick has an inner edge between its two inner nodes. Every joint splits the connection of
two bricks into two half-edges that meet in a joint node; a half-edge whose other brick is not
placed yet is a free stub. A ground end adds a stub from its joint node to a fixed base node.
Source: section 3.2.1 of Bruun et al.

Bricks, nodes, edges and springs are sorted by the brick count that brings them, so those of a
partial structure are the first ones of each array.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import networkx as nx
import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.scene.scene import Scene

GROUND = -1  # stands for the ground where a brick's place in the build order is expected


class PartKind(IntEnum):
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
            if self.node_kind[i] == PartKind.INNER
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
                kind=PartKind(self.node_kind[i]).name.lower(),
                position=tuple(self.node_position[i].tolist()),
            )
        for e in range(self.count_edges(bricks)):
            a, b = self.edge_nodes[e]
            graph.add_edge(
                self.node_name[a],
                self.node_name[b],
                number=e + 1,
                kind=PartKind(self.edge_kind[e]).name.lower(),
                length=float(np.linalg.norm(self.node_position[b] - self.node_position[a])),
            )
        return graph
