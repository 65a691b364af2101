"""Build the network of a scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import SceneError
from seqopt.network.network import GROUND, Network, PartKind, Springs
from seqopt.scene._checks import frames
from seqopt.scene.parts import Brick, Ground, Joint
from seqopt.scene.scene import Scene, in_order

_EQUALLY_FAR = 1e-6  # inner nodes whose distances from a joint differ by no larger share


_Springs = list[tuple[Joint | Ground, int]]  # with the brick counts from which they act


class _Node(NamedTuple):
    name: object
    kind: PartKind
    since: int
    position: tuple[float, float, float]
    spring: int = -1
    brick: int = -1


class _Edge(NamedTuple):
    nodes: tuple[object, object]
    kind: PartKind
    since: int
    brick: int = -1
    spring: int = -1


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
    index_of = {brick.name: i for i, brick in enumerate(scene.placed)}
    every: list[Joint | Ground] = [*scene.grounds, *scene.joints]
    counts = [_since(spring, index_of) for spring in every]
    ascending = np.argsort(counts, kind="stable")
    springs = [(every[i], counts[i]) for i in ascending]
    support = np.argsort(ascending)[: len(scene.grounds)]
    nodes, edges = _of_bricks(scene)
    for s, (name, (spring, since)) in enumerate(zip(_joint_names(springs), springs, strict=True)):
        ends = [index_of[b] for b in spring.ends]
        nodes.append(_Node(name, PartKind.JOINT, min(ends) + 1, spring.position, s))
        for b in ends:
            met = (_nearest(scene.placed[b], spring), name)
            edges.append(_Edge(met, PartKind.JOINT, b + 1, b, s))
        if isinstance(spring, Ground):
            base = ("base", *name[1:])
            nodes.append(_Node(base, PartKind.BASE, since, spring.anchor, s))
            edges.append(_Edge((name, base), PartKind.BASE, since, spring=s))
    nodes.sort(key=lambda node: node.since)
    edges.sort(key=lambda edge: edge.since)
    return _arrays(scene, index_of, springs, support, nodes, edges)


def _of_bricks(scene: Scene) -> tuple[list[_Node], list[_Edge]]:
    nodes, edges = [], []
    for i, brick in enumerate(scene.placed):
        for number in brick.nodes:
            nodes.append(_Node(number, PartKind.INNER, i + 1, brick.node_position(number), brick=i))
        edges.append(_Edge(brick.nodes, PartKind.INNER, i + 1, brick=i))
    return nodes, edges


def network_of(given: Network | Scene) -> Network:
    """Return a network unchanged, or the network of a scene."""
    if isinstance(given, Network | Scene):
        return given if isinstance(given, Network) else build_network(given)
    kind = type(given).__name__
    raise SceneError(f"a {kind} is not a network; give build_network(scene), or the scene itself")


def _since(spring: Joint | Ground, index_of: dict[int, int]) -> int:
    """Return the brick count from which a spring acts."""
    closes = spring.closes_with if isinstance(spring, Ground) else None
    return max(index_of[b] for b in (*spring.ends, closes) if b is not None) + 1


def _joint_names(springs: _Springs) -> list[tuple[object, ...]]:
    names: list[tuple[object, ...]] = []
    alike = Counter[tuple[object, ...]]()
    for spring, _ in springs:
        name = spring.bricks if isinstance(spring, Joint) else ("ground", spring.brick)
        same = alike[name]
        alike[name] += 1
        names.append(("joint", *name, same + 1) if same else ("joint", *name))
    return names


def _nearest(brick: Brick, spring: Joint | Ground) -> int:
    """Return the inner node through which the brick meets the spring: the nearer, or the first."""
    ways = [np.subtract(brick.node_position(node), spring.position) for node in brick.nodes]
    first, second = map(np.linalg.norm, ways)
    return brick.nodes[0] if first <= second * (1 + _EQUALLY_FAR) else brick.nodes[1]


def _arrays(
    scene: Scene,
    index_of: dict[int, int],
    springs: _Springs,
    support: Ints,
    nodes: list[_Node],
    edges: list[_Edge],
) -> Network:
    index = {node.name: i for i, node in enumerate(nodes)}
    return Network(
        scene=scene,
        springs=Springs(
            bodies=np.array(  # the ground or the lower one first
                [sorted([GROUND, *(index_of[b] for b in s.ends)][-2:]) for s, _ in springs]
            ),
            since=np.array([since for _, since in springs]),
            node=np.array([index[name] for name in _joint_names(springs)]),
            position=np.array([spring.position for spring, _ in springs]),
            anchor=np.array([getattr(s, "anchor", s.position) for s, _ in springs]),
            axes=_axes(springs, index_of),
            translational_stiffness=np.array([s.translational_stiffness for s, _ in springs]),
            rotational_stiffness=np.array([s.rotational_stiffness for s, _ in springs]),
            support=support,
            movement=np.array([_movement(spring) for spring, _ in springs]),
            thickness=np.array([s.thickness for s, _ in springs], dtype=float),  # None is NaN
            face=tuple(np.array(s.corners or (), dtype=float).reshape(-1, 3) for s, _ in springs),
        ),
        node_position=np.array([node.position for node in nodes]),
        node_kind=np.array([node.kind.value for node in nodes]),
        node_since=np.array([node.since for node in nodes]),
        node_spring=np.array([node.spring for node in nodes]),
        node_brick=np.array([node.brick for node in nodes]),
        node_name=tuple(node.name for node in nodes),
        inner=np.array([[index[n] for n in brick.nodes] for brick in scene.placed]),
        edge_nodes=np.array([[index[name] for name in edge.nodes] for edge in edges]),
        edge_kind=np.array([edge.kind.value for edge in edges]),
        edge_since=np.array([edge.since for edge in edges]),
        edge_brick=np.array([edge.brick for edge in edges]),
        edge_spring=np.array([edge.spring for edge in edges]),
        weight=np.array([brick.mass for brick in scene.placed])[:, None]
        * (scene.weight_factor * np.array(scene.gravity)),
    )


def _movement(spring: Joint | Ground) -> Floats:
    """Return the movement of the ground at a spring, (6,), m and rad."""
    if isinstance(spring, Joint) or spring.movement is None:
        return np.zeros(6)
    out = np.array(spring.movement)
    out[:3] += np.cross(out[3:], np.subtract(spring.position, spring.anchor))
    return out


def _axes(springs: _Springs, index_of: dict[int, int]) -> Floats:
    """Return the axes (S, 3, 3) of springs; with a face, the first points into the second body."""
    along = np.array([spring.along for spring, _ in springs])
    across = np.array([spring.across for spring, _ in springs])
    for i, (spring, _) in enumerate(springs):
        if isinstance(spring, Joint) and spring.face is not None:
            first, second = (index_of[name] for name in spring.bricks)
            along[i] *= 1.0 if first < second else -1.0
    return frames(along, across)
