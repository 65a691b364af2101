"""Build the network of a scene: its double cross as a graph, compiled to arrays once."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import networkx as nx
import numpy as np

from seqopt.arrays import Ints
from seqopt.errors import SceneError
from seqopt.network.network import (
    GROUND,
    DoubleCross,
    Network,
    PartKind,
    Springs,
    _NodeData,
    _PartData,
)
from seqopt.scene._checks import frames
from seqopt.scene.parts import Ground, Joint
from seqopt.scene.scene import Scene, in_order

_EQUALLY_FAR = 1e-6  # inner nodes whose distances from a joint differ by no larger share
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
    for s, (name, (spring, since)) in enumerate(zip(_joint_names(springs), springs, strict=True)):
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


def _joint_names(springs: _Springs) -> list[tuple[object, ...]]:
    """Return a name for every spring; those that join the same bodies are counted."""
    names: list[tuple[object, ...]] = []
    alike = Counter[tuple[object, ...]]()
    for spring, _ in springs:
        name = spring.bricks if isinstance(spring, Joint) else ("ground", spring.brick)
        alike[name] += 1
        names.append(("joint", *name, *([alike[name]] if alike[name] > 1 else [])))
    return names


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
