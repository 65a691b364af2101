"""A scene inside an assembly: written into its graph, and read again while the blocks are its own.

Every part stands where COMPAS has it: a brick and its ground ends on its node, joints on the edge
between two nodes, robots and all else on the graph. Who deletes a block there deletes its joints.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene._checks import whole_between
from seqopt.scene.boxes import vertices_of
from seqopt.scene.imports._content import (
    Carried,
    Content,
    Entry,
    Given,
    entry,
    listing,
    mapping,
    number,
)
from seqopt.scene.imports._meshes import Repaired
from seqopt.scene.library.common import mobile_robots
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import _scene_from_document, scene_to_dict
from seqopt.scene.shape import Polyhedron

_HELD = ("bricks", "joints", "grounds")  # what stands on nodes and edges
_KEY = "seqopt"  # of the rest, among the attributes of the graph
_SAME = 1e-9  # by how much rounding may move a corner, over the size of the block and its distance


def carry(graph: Entry, keys: Mapping[int, str], scene: Scene, unit: str | None) -> None:
    """Write a scene into a graph whose nodes have the given keys by the names of bricks.

    ``order`` of nodes is expected there. ``unit``: of the graph's lengths, where it is known.
    """
    document = scene_to_dict(scene)
    held = {kind: [*enumerate(document.pop(kind))] for kind in _HELD}
    del document["build_order"]
    nodes, edges = entry("source", graph, "node", "vertex"), graph.setdefault("edge", {})
    for left in (*nodes.values(), *(e for ends in edges.values() for e in ends.values())):
        for name in ("brick", "grounds", "joints"):  # of a scene that it carried before
            (left or {}).pop(name, None)
    for place, brick in held["bricks"]:
        nodes[keys[brick["name"]]] |= {"brick": {"place": place, **brick}, "grounds": []}
    for place, ground in held["grounds"]:
        nodes[keys[ground["brick"]]]["grounds"].append({"place": place, **ground})
    for place, joint in held["joints"]:
        a, b = (keys[name] for name in joint["bricks"])
        ends = edges.setdefault(b if a in edges.get(b, {}) else a, {})
        edge = ends[a if a in ends else b] = ends.get(a if a in ends else b) or {}
        edge.setdefault("joints", []).append({"place": place, **joint})
    graph.setdefault("attributes", {})[_KEY] = {"unit": unit, "scene": document}


def carried(graph: Entry, source: str) -> Carried | None:
    """Return the scene that a graph carries; None if it carries none."""
    attributes, where = graph.get("attributes"), f"{source}: {_KEY}"
    if not isinstance(attributes, dict) or attributes.get(_KEY) is None:
        return None
    own = mapping(where, attributes[_KEY])
    document = {**mapping(where, entry(where, own, "scene"))}
    found = mapping(where, entry(where, graph, "node", "vertex"))
    held = {key: mapping(where, node or {}) for key, node in found.items()}
    nodes = {key: node for key, node in held.items() if node.get("brick") is not None}
    ends = [mapping(where, e or {}) for e in mapping(where, graph.get("edge") or {}).values()]
    edges = [mapping(where, edge or {}) for row in ends for edge in row.values()]
    parts = {
        "bricks": [node["brick"] for node in nodes.values()],
        "grounds": _gathered(where, [*nodes.values()], "grounds"),
        "joints": _gathered(where, edges, "joints"),
    }
    document |= {kind: _sorted(f"{where}: {kind}", rows) for kind, rows in parts.items()}
    names = {key: entry(f"{where}: brick", node["brick"], "name") for key, node in nodes.items()}
    turn = {key: number(where, entry(where, node, "order")) for key, node in nodes.items()}
    document["build_order"] = [names[key] for key in sorted(nodes, key=turn.__getitem__)]
    return Carried(document, names, own.get("unit"))


def own_density(where: str, node: Entry) -> float | None:
    """Return the density of the brick on a node, kg/m³, if it has one."""
    brick = node.get("brick")
    value = None if brick is None else entry(f"{where}: brick", brick, "density")
    return None if value is None else number(f"{where}: density", value)


def _gathered(where: str, holders: Sequence[Entry], name: str) -> list[Any]:
    """Return what stands in lists of the same name on nodes or edges."""
    return [part for held in holders for part in listing(where, held.get(name) or [])]


def _sorted(where: str, found: Sequence[Any]) -> list[Entry]:
    """Return parts in the order that they had in their scene."""
    parts = sorted(found, key=lambda part: number(where, entry(where, part, "place")))
    return [{key: value for key, value in part.items() if key != "place"} for part in parts]


def own_scene(
    content: Content, given: Given, blocks: Sequence[Repaired], said: list[str]
) -> Scene | None:
    """Return the scene that a file carries, if its blocks are still those of its bricks.

    ``content``: in m, with z up; ``said``: gets why it is not used.
    """
    own = content.own
    asked = (given.supports, given.law, given.gap)
    if own is None or given.detect or any(value is not None for value in asked):
        return None
    try:
        scene = _scene_from_document(own.document, "it carries")
        changed = _changed(scene, content, blocks, own.bricks)
    except SceneError as error:
        said.append(f"it carries a scene that is not used, {error}")
        return None
    if changed:
        said.append(
            f"it carries a scene that is not used: block {changed} is not as that has it; joints, "
            "robots and nodes are made anew"
        )
        return None
    more: dict[str, Any] = {} if given.name is None else {"name": given.name}
    if given.robots is not None:
        more["robots"] = mobile_robots(scene.bricks, whole_between("robots", given.robots, 1))
    return replace(scene, **more)


def _changed(
    scene: Scene, content: Content, blocks: Sequence[Repaired], names: Mapping[str, int]
) -> str | None:
    """Return the key of the first block that is not where the scene has its brick."""
    bricks = {brick.name: brick for brick in scene.bricks}
    for held, block in zip(content.blocks, blocks, strict=True):
        name = names.get(held.key)
        if name is None and held.support:
            continue
        solid = block.solid
        if name is None or not isinstance(solid, Polyhedron):
            return held.key
        if not _same_points(solid.points, vertices_of(bricks[name])[0]):
            return held.key
    return None


def _same_points(some: Floats, others: Floats) -> bool:
    """Return whether two sets of points (n, 3) are the same but for their order and rounding."""
    from scipy.spatial import KDTree  # noqa: PLC0415  # for files only

    near = _SAME * float(np.abs(others).max() + np.ptp(others, axis=0).max())
    pairs = ((some, others), (others, some))
    return all(bool(np.max(KDTree(a).query(b)[0]) <= near) for a, b in pairs)
