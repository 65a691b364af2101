"""Plans for COMPAS: a building plan of compas_timber, and an assembly with the plan in it.

Both are JSON as `compas.json_load` reads it, written without COMPAS.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import read_text
from seqopt.arrays import Floats
from seqopt.errors import StepError
from seqopt.scene.boxes import vertices_of
from seqopt.scene.imports._building import block_numbers
from seqopt.scene.imports._compas_models import assembly_graph, by_guid, kind, payload
from seqopt.scene.imports._content import entry, parse_json
from seqopt.scene.imports.formats import read_content, sniffed
from seqopt.scene.parts import Brick
from seqopt.scene.scene import Scene
from seqopt.sequence.exports._tables import StepStates, step_states
from seqopt.sequence.steps import Step


@dataclass(frozen=True)
class Source:
    """A file from which a scene was imported.

    ``names``: what it calls bricks, by their names: identifiers of elements of a COMPAS model, else
    keys; ``graph``: its document if it is a graph of compas_assembly, else None.
    """

    names: Mapping[int, str]
    graph: Any = None


def read_source(scene: Scene, path: Path) -> Source:
    """Return the file from which a scene was imported, in any format that ``import`` knows.

    Raises `FileError` if it cannot be read; `StepError` if it lacks a brick of the scene.
    """
    content, graph = read_content(path), None
    keys = names = [block.key for block in content.blocks]
    if path.suffix.lower() == ".json":
        document = parse_json(read_text(path), str(path))
        form = sniffed(document, str(path))
        graph = document if form == "compas_assembly" and isinstance(document, dict) else None
        if form in ("compas_dem", "compas_timber"):
            held = payload(document)
            held = payload(held["model"]) if "model" in held else held
            rows = [*by_guid(f"{path}: element", held["elements"])]
            if form == "compas_timber":  # its blocks are counted among its beams
                rows = [(guid, item) for guid, item in rows if kind(item) == "beam"]
            names = [rows[int(key)][0] for key in keys]
    found = dict(zip(block_numbers(keys), names, strict=True))
    lost = [brick.name for brick in scene.bricks if brick.name not in found]
    if lost:
        raise StepError(f"the source has no block {lost[0]}; give the file that was imported")
    return Source(found, graph)


_Document = dict[str, Any]


def timber_plan(scene: Scene, steps: Sequence[Step], source: Source | None = None) -> str:
    """Return a plan as a ``BuildingPlan`` of compas_timber.

    ``source``: from which the scene was imported: elements are then named by its identifiers or
    keys. Result: JSON. A step for every step of the plan: the elements that it places, and those
    that robots hold meanwhile.
    """
    names = source.names if source else {b.name: str(b.name) for b in scene.bricks}
    rows = []
    for row in step_states(scene, steps):
        new = [brick for brick in scene.placed if brick.name in row.new]
        rows.append(
            {
                "dtype": "compas_timber.planning/Step",
                "data": {
                    "location": _frame(new[0] if new else None),
                    "geometry": "box",
                    "priority": row.step.number - 1,
                    "element_ids": [names[brick.name] for brick in new],
                    "instructions": [],
                    "is_built": False,
                    "is_planned": True,
                    "elements_held": sorted({names[brick] for _, brick in row.holds.values()}),
                    "actor": "ROBOT",
                },
            }
        )
    whole = {"dtype": "compas_timber.planning/BuildingPlan", "data": {"steps": rows}}
    return json.dumps(whole) + "\n"


def _frame(brick: Brick | None) -> _Document:
    """Return the pose of a brick, or the world's."""
    if brick is None:
        return {"point": [0.0] * 3, "xaxis": [1.0, 0.0, 0.0], "yaxis": [0.0, 1.0, 0.0]}
    axes = {"xaxis": list(brick.length_axis), "yaxis": list(brick.width_axis)}
    return {"point": list(brick.position), **axes}


def compas_assembly(scene: Scene, steps: Sequence[Step], source: Source | None = None) -> str:
    """Return an assembly of compas_assembly with the plan as attributes.

    ``source``: from which the scene was imported. An assembly stays as it is, with attributes
    added; otherwise blocks and faces are those of the scene, and ``name`` what the source calls
    them. Result: JSON. Every node of a block that is built has ``order``, its place in the build,
    ``place_step`` and ``held``, a list of step, robot and node; the graph has ``plan``, a list of
    steps.
    """
    rows = [*step_states(scene, steps)]
    kept = None if source is None else source.graph
    whole = _assembly(scene) if kept is None else kept
    graph = assembly_graph(whole, "source")[0]
    found = entry("source", graph, "node", "vertex")
    names = source.names if source else {}
    nodes = {
        brick.name: found[names[brick.name] if kept is not None else str(brick.name)]
        for brick in scene.bricks
    }
    for i, brick in enumerate(scene.placed):
        nodes[brick.name].update(order=i, place_step=None, held=[])
        if source and kept is None:
            nodes[brick.name]["name"] = names[brick.name]
    for row in rows:
        for name in row.new:
            nodes[name]["place_step"] = row.step.number
        for robot, (node, name) in row.holds.items():
            nodes[name]["held"].append([row.step.number, robot, node])
    graph.setdefault("attributes", {})["plan"] = [_plain(row) for row in rows]
    return json.dumps(whole) + "\n"


def _plain(row: StepStates) -> _Document:
    holds = {robot: [node, brick] for robot, (node, brick) in row.holds.items()}
    step = row.step
    return {"step": step.number, "type": step.kind.value, "placed": list(row.new), "holds": holds}


def _assembly(scene: Scene) -> _Document:
    """Return the blocks of a scene and the faces between them as an assembly.

    Faces on the ground make a support of their own, a surface.
    """
    edges: dict[str, dict[str, Any]] = {str(brick.name): {} for brick in scene.bricks}
    for joint in scene.joints:
        a, b = map(str, joint.bricks)
        if joint.corners is not None:
            edge = edges[a].setdefault(b, {"interfaces": []})
            edge["interfaces"].append(_interface(joint.corners))
    nodes: dict[str, _Document] = {
        str(brick.name): {"block": _block(*vertices_of(brick))} for brick in scene.bricks
    }
    ground = max(brick.name for brick in scene.bricks) + 1
    faces = [(end.brick, end.corners) for end in scene.grounds if end.corners is not None]
    if faces:
        nodes[str(ground)] = {"block": _sheet([face for _, face in faces]), "is_support": True}
        edges[str(ground)] = {}
        for name, corners in faces:
            edge = edges[str(ground)].setdefault(str(name), {"interfaces": []})
            edge["interfaces"].append(_interface(corners))
    graph = {
        "attributes": {"name": scene.name},
        "default_node_attributes": {"block": None, "is_support": False},
        "default_edge_attributes": {"interfaces": None},
        "node": nodes,
        "edge": edges,
        "max_node": ground if faces else ground - 1,
    }
    return {
        "dtype": "compas_assembly.datastructures/Assembly",
        "data": {
            "attributes": {"name": scene.name},
            "graph": {"dtype": "compas.datastructures/Graph", "data": graph},
        },
    }


def _interface(corners: Sequence[Sequence[float]]) -> _Document:
    points = [list(corner) for corner in corners]
    return {"dtype": "compas_assembly.datastructures/Interface", "data": {"points": points}}


def _block(points: Floats, faces: Sequence[Sequence[int]]) -> _Document:
    return {"dtype": "compas_assembly.datastructures/Block", "data": _mesh(points, faces)}


def _sheet(polygons: Sequence[Sequence[Sequence[float]]]) -> _Document:
    """Return polygons as a block that is not closed: the ground where bricks stand."""
    ends = np.cumsum([0, *map(len, polygons)]).tolist()
    faces = [list(range(a, b)) for a, b in pairwise(ends)]
    return _block(np.concatenate([np.array(p) for p in polygons]), faces)


def _mesh(points: Floats, faces: Sequence[Sequence[int]]) -> _Document:
    rows = points.tolist()
    return {
        "attributes": {},
        "default_vertex_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
        "default_edge_attributes": {},
        "default_face_attributes": {},
        "vertex": {str(i): dict(zip("xyz", row, strict=True)) for i, row in enumerate(rows)},
        "face": {str(i): list(face) for i, face in enumerate(faces)},
        "facedata": {},
        "edgedata": {},
        "max_vertex": len(rows) - 1,
        "max_face": len(faces) - 1,
    }
