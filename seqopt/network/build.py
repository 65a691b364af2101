"""Build the network of a scene."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from seqopt.arrays import Ints
from seqopt.errors import SceneError
from seqopt.network.network import GROUND, Network, PartKind, Springs
from seqopt.scene._checks import frames
from seqopt.scene.parts import Ground, Joint
from seqopt.scene.scene import Scene, in_order

_EQUALLY_FAR = 1e-6  # inner nodes whose distances from a joint differ by no larger share
_Springs = list[tuple[Joint | Ground, int]]  # with the brick counts from which they act


class _Part(NamedTuple):
    """A node or an edge: its number, name or ends, kind, and the brick count that brings it."""

    name: Any
    kind: PartKind
    since: int
    spring: int = -1
    brick: int = -1
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)


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
    nodes, edges = _nodes_and_edges(scene, springs)
    index = {node.name: i for i, node in enumerate(nodes)}
    support = np.argsort(ascending)[: len(scene.grounds)]
    mass = np.array([brick.mass for brick in scene.placed])[:, None]
    arrays = {
        f"{what}_{name}": np.array([int(getattr(part, name)) for part in parts])
        for what, parts in (("node", nodes), ("edge", edges))
        for name in ("kind", "since", "spring", "brick")
    }
    return Network(
        scene=scene,
        springs=_springs(scene, springs, support, index),
        node_position=np.array([node.position for node in nodes]),
        node_name=tuple(index),
        inner=np.array([[index[n] for n in brick.nodes] for brick in scene.placed]),
        edge_nodes=np.array([[index[name] for name in edge.name] for edge in edges]),
        weight=mass * (scene.weight_factor * np.array(scene.gravity)),
        **arrays,
    )


def network_of(given: Network | Scene) -> Network:
    """Return a network unchanged, or the network of a scene."""
    if isinstance(given, Network | Scene):
        return given if isinstance(given, Network) else build_network(given)
    kind = type(given).__name__
    raise SceneError(f"a {kind} is not a network; give build_network(scene), or the scene itself")


def _nodes_and_edges(scene: Scene, springs: _Springs) -> tuple[list[_Part], list[_Part]]:
    """Return the parts of the double cross, those of a partial structure first."""
    nodes, edges = list[_Part](), list[_Part]()
    for i, brick in enumerate(scene.placed):
        for number in brick.nodes:
            at = brick.node_position(number)
            nodes.append(_Part(number, PartKind.INNER, i + 1, brick=i, position=at))
        edges.append(_Part(brick.nodes, PartKind.INNER, i + 1, brick=i))
    for s, (name, (spring, since)) in enumerate(zip(_joint_names(springs), springs, strict=True)):
        ends, at = [scene.since[b] for b in spring.ends], spring.position
        nodes.append(_Part(name, PartKind.JOINT, min(ends), s, position=at))
        for count in ends:  # each brick meets it through its nearer node, or the first
            brick = scene.placed[count - 1]
            first, second = (math.dist(brick.node_position(node), at) for node in brick.nodes)
            met = brick.nodes[int(first > second * (1 + _EQUALLY_FAR))]
            edges.append(_Part((met, name), PartKind.JOINT, count, s, count - 1))
        if isinstance(spring, Ground):
            base = ("base", *name[1:])
            nodes.append(_Part(base, PartKind.BASE, since, s, position=spring.anchor))
            edges.append(_Part((name, base), PartKind.BASE, since, s))
    return sorted(nodes, key=lambda n: n.since), sorted(edges, key=lambda e: e.since)


def _joint_names(springs: _Springs) -> list[tuple[object, ...]]:
    """Return a name for every spring; those that join the same bodies are counted."""
    names: list[tuple[object, ...]] = []
    alike = Counter[tuple[object, ...]]()
    for spring, _ in springs:
        name = spring.bricks if isinstance(spring, Joint) else ("ground", spring.brick)
        alike[name] += 1
        names.append(("joint", *name, *([alike[name]] if alike[name] > 1 else [])))
    return names


def _springs(
    scene: Scene, springs: _Springs, support: Ints, index: Mapping[object, int]
) -> Springs:
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
        node=np.array([index[name] for name in _joint_names(springs)]),
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
