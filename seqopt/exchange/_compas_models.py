"""Assemblies and models of COMPAS's packages, read and, with a plan, written.

Assemblies of compas_assembly and compas_cra are graphs, with meshes in or beside them.
Models of compas_model and compas_dem are elements with transformations.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from seqopt._files import read_text
from seqopt.arrays import Floats
from seqopt.errors import SceneError, StepError
from seqopt.exchange._building import block_numbers
from seqopt.exchange._compas_shapes import held_by, kind, payload, solid_of, transformation_of
from seqopt.exchange._content import (
    Content,
    Entry,
    FileBlock,
    assembly_json,
    entry,
    listing,
    mapping,
    number,
)
from seqopt.exchange._meshes import object_content
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind


def _placed(source: str, held: Entry, elements: dict[str, tuple[str, Entry]]) -> dict[str, Floats]:
    """Return the transformation of every element, groups too, to the model's world.

    Its own is relative to its parent in the tree, the first of them to the model's; parents come
    first.
    """
    own = {
        guid: transformation_of(f"{where}: transformation", item.get("transformation"))
        for guid, (where, item) in elements.items()
    }
    world = transformation_of(f"{source}: transformation", held.get("transformation"))
    placed, tree = dict[str, Floats](), held_by(f"{source}: tree", held.get("tree") or {})
    waiting: list[tuple[Any, Floats]] = [(tree.get("root") or {}, world)]
    while waiting:
        node, above = waiting.pop()
        guid = mapping(f"{source}: a node of the tree", node).get("element")
        if guid is not None:
            guid = str(guid)
            if guid not in elements or guid in placed:
                why = "occurs twice" if guid in placed else "is not there"
                raise SceneError(f"{source}: element {short(guid)} of the tree {why}")
            placed[guid] = above = above @ own[guid]
        children = listing(f"{source}: children in the tree", node.get("children") or [])
        waiting += [(child, above) for child in children]
    return {guid: world @ each for guid, each in own.items()} | placed


def read_assembly(document: Any, source: str) -> Content:
    """Return the content of an assembly."""
    graph, meshes = assembly_graph(document, source)
    nodes = mapping(f"{source}: node", entry(source, graph, "node", "vertex"))
    common = held_by(source, graph.get("node_attributes") or graph.get("dva") or {})
    keys, blocks = [key for key in nodes if meshes is None or key in meshes], list[FileBlock]()
    for key in keys:
        node, where = common | mapping(source, nodes[key]), f"{source}: block {key}"
        held = meshes[key] if meshes is not None else entry(where, node, "block")
        vertices, faces = solid_of(where, held)
        course, support = node.get("course", node.get("order")), node.get("is_support") is True
        course = None if course is None else number(f"{where}: course", course)
        blocks.append(FileBlock(key, vertices, faces, support=support, course=course))
    lines = [f"{len(nodes) - len(keys)} nodes have no block"] if len(keys) < len(nodes) else []
    return Content(tuple(blocks), said=tuple(lines))


def assembly_graph(document: Any, source: str) -> tuple[Entry, dict[str, Any] | None]:
    """Return the graph of an assembly, and its meshes by key where they stand beside it."""
    held = held_by(source, document)
    if "blocks" in held and "assembly" in held:
        graph = held_by(f"{source}: assembly", held["assembly"])
        return graph, mapping(f"{source}: blocks", held["blocks"])
    if "graph" in held:
        held = held_by(f"{source}: graph", held["graph"])
    if "node" not in held:
        raise SceneError(f"{source}: neither graph nor node is there; give an assembly")
    return held, None


def read_model(document: Any, source: str) -> Content:
    """Return the content of a block model, or of a problem about one."""
    held = held_by(source, document)
    lines = list[str]()
    if kind(document) == "problem":
        lines.append("loads and joints of the problem are left out; blocks carry their weight")
        if "model" not in held:  # some versions keep its identifier alone
            raise SceneError(
                f"{source}: the problem does not hold its model; give the model itself"
            )
        held = held_by(f"{source}: model", held["model"])
    rows = mapping(f"{source}: elements", entry(source, held, "elements"))
    where = [f"{source}: element {i}" for i in range(len(rows))]
    elements = {
        guid: (at, held_by(at, item)) for at, (guid, item) in zip(where, rows.items(), strict=True)
    }
    placed = _placed(source, held, elements)
    items = mapping(f"{source}: materials", held.get("materials") or {})
    found = {guid: held_by(source, item).get("density") for guid, item in items.items()}
    densities = {
        g: number(f"{source}: density", value) for g, value in found.items() if value is not None
    }
    blocks = list[FileBlock]()
    for i, (guid, item) in enumerate(rows.items()):
        if kind(item) != "group":
            at, own = elements[guid]
            vertices, faces = solid_of(at, entry(at, own, "geometry", "shape"))
            density = densities.get(str(own.get("material")))
            about: Any = {"support": own.get("is_support") is True, "density": density}
            points = vertices @ placed[guid][:3, :3].T + placed[guid][:3, 3]
            blocks.append(FileBlock(str(i), points, faces, **about))
    if len(blocks) < len(rows):
        lines.append(f"{len(rows) - len(blocks)} groups only place what is in them")
    return Content(tuple(blocks), said=tuple(lines))


_SOLIDS = ("mesh", "box", "polyhedron")
_THIN = (  # of COMPAS, without a volume
    *("line", "polyline", "polygon", "point", "pointcloud", "vector", "frame", "plane", "circle"),
    *("ellipse", "arc", "bezier", "curve", "nurbscurve", "hyperbola", "parabola", "graph"),
)
_DEEPEST = 50  # lists and dictionaries within each other


def is_meshes(document: Any) -> bool:
    """Return whether a document is a mesh of COMPAS, or a list or dictionary of such.

    Lines and what else has no volume count, so that the error names them.
    """
    if isinstance(document, list):
        return True
    if not isinstance(document, dict) or not document:
        return False
    return _is_geometry(document) or all(
        isinstance(value, list) or _is_geometry(value) for value in document.values()
    )


def _is_geometry(value: Any) -> bool:
    return _is_solid(value) or kind(value) in _THIN


def _is_solid(value: Any) -> bool:
    held = payload(value)
    keys = {*held} if isinstance(held, dict) else {*()}
    return kind(value) in _SOLIDS or {"vertex", "face"} <= keys or {"vertices", "faces"} <= keys


def read_meshes(document: Any, source: str) -> Content:
    """Return meshes as blocks, under their names, or their keys in a dictionary."""
    left = Counter[str]()
    solids = [*_listed(source, document, left)]
    lines = [f"{count} objects are left out: {what}" for what, count in left.items()]
    if left and not solids:
        raise SceneError(
            f"{source}: {'; '.join(lines)}. Lines, points and curves are no blocks: give meshes, "
            "boxes or polyhedra"
        )
    found = object_content(solids, source)
    return replace(found, said=("a list of meshes: no supports, faces or order", *lines))


def _listed(
    where: str, value: Any, left: Counter[str], name: str = "", depth: int = 0
) -> Iterator[FileBlock]:
    """Yield the meshes of a value and of lists and dictionaries in it; ``left``: counts others."""
    if depth > _DEEPEST:
        raise SceneError(f"{where}: lists stand in lists more than {_DEEPEST} deep")
    if isinstance(value, list):
        for i, item in enumerate(value):
            yield from _listed(f"{where}: mesh {i}", item, left, "", depth + 1)
    elif isinstance(value, dict) and not kind(value) and not _is_solid(value):
        for key, item in value.items():
            yield from _listed(f"{where}: {key}", item, left, key, depth + 1)
    elif kind(value) in _THIN:
        left[kind(value)] += 1
    else:
        own = value.get("name") if isinstance(value, dict) else None
        key = name or (own if isinstance(own, str) else "")
        yield FileBlock(key, *solid_of(where, value))


def assembly_with_plan(
    scene: Scene, steps: Sequence[Step], source: Path | str | None = None
) -> str:
    """Return the assembly from which a scene was imported with the plan as attributes, JSON.

    Every node of a block that is built has ``order``, its place in the build, ``place_step`` and
    ``held``, a list of step, robot and node; the graph has ``plan``, a list of steps.
    """
    if source is None:
        raise StepError("format compas_assembly: give the assembly that was imported (--source)")
    whole = assembly_json(read_text(Path(source)), str(source))
    own = [block.key for block in read_assembly(whole, str(source)).blocks]
    keys = dict(zip(block_numbers(own), own, strict=True))
    lost = [brick.name for brick in scene.bricks if brick.name not in keys]
    if lost:
        raise StepError(f"the source has no block {lost[0]}; give the file that was imported")
    graph = assembly_graph(whole, "source")[0]
    found = entry("source", graph, "node", "vertex")
    nodes = {brick.name: found[keys[brick.name]] for brick in scene.bricks}
    for i, brick in enumerate(scene.placed):
        nodes[brick.name].update(order=i, place_step=None, held=[])
    plan = graph.setdefault("attributes", {})["plan"] = []
    takes_down = any(step.kind is StepKind.REMOVE for step in steps)  # then nothing is placed
    before = steps[0].bricks if takes_down else 0
    for step in steps:
        new = [brick.name for brick in scene.placed[before : step.bricks]]
        grips = zip(scene.robots, step.grips, strict=True)
        held = {robot.name: node for robot, node in grips if node is not None}
        holds = {robot: [node, scene.brick_of_node[node].name] for robot, node in held.items()}
        for name in new:
            nodes[name]["place_step"] = step.number
        for robot, (node, name) in holds.items():
            nodes[name]["held"].append([step.number, robot, node])
        kind, before = step.kind.value, step.bricks
        plan.append({"step": step.number, "type": kind, "placed": new, "holds": holds})
    return json.dumps(whole) + "\n"
