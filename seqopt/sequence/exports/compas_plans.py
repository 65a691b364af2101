"""Plans for COMPAS: a building plan of compas_timber, and an assembly with the plan in it.

Both are JSON as `compas.json_load` reads it, written without COMPAS.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError, StepError
from seqopt.scene.blocks import vertices_of
from seqopt.scene.imports.compas_data import kind, payload
from seqopt.scene.parts import Brick
from seqopt.scene.scene import Scene
from seqopt.sequence.exports.states import StepStates, step_states
from seqopt.sequence.steps import Step

Document = dict[str, Any]


def timber_plan(scene: Scene, steps: Sequence[Step], document: object = None) -> str:
    """Return a plan as a ``BuildingPlan`` of compas_timber.

    Parameters
    ----------
    scene : Scene
    steps : sequence of Step
    document : object, optional
        The model from which the scene was imported: elements are then named by its identifiers.

    Returns
    -------
    str
        JSON. A step for every step of the plan: the elements that it places, and those that robots
        hold meanwhile.
    """
    names = _element_ids(scene, document)
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


def _element_ids(scene: Scene, document: object) -> dict[int, str]:
    """Return identifiers of elements by the names of their bricks."""
    own = {brick.name: str(brick.name) for brick in scene.bricks}
    if document is None:
        return own
    held = payload(document)
    found = held.get("elements") if isinstance(held, dict) else None
    rows = [*found.values()] if isinstance(found, dict) else found
    if not isinstance(rows, list):
        raise SceneError("the source has no elements; give the model that was imported")
    beams = [item for item in rows if kind(item) == "beam"] or rows
    if max(own) >= len(beams):
        raise SceneError(
            f"the source has {len(beams)} elements, and the scene a brick {max(own)}; give the "
            "model that was imported"
        )
    return {name: str(beams[name].get("guid", name)) for name in own}


def _frame(brick: Brick | None) -> Document:
    """Return the pose of a brick, or the world's."""
    if brick is None:
        return {"point": [0.0] * 3, "xaxis": [1.0, 0.0, 0.0], "yaxis": [0.0, 1.0, 0.0]}
    axes = {"xaxis": list(brick.length_axis), "yaxis": list(brick.width_axis)}
    return {"point": list(brick.position), **axes}


def compas_assembly(scene: Scene, steps: Sequence[Step], document: object = None) -> str:
    """Return an assembly of compas_assembly with the plan as attributes.

    Parameters
    ----------
    scene : Scene
    steps : sequence of Step
    document : object, optional
        The assembly from which the scene was imported: it stays as it is, with attributes added;
        by default blocks and faces are those of the scene.

    Returns
    -------
    str
        JSON. Every node of a block that is built has ``order``, its place in the build,
        ``place_step`` and ``held``, a list of step, robot and node; the graph has ``plan``, a list
        of steps.

    Raises
    ------
    StepError
        If the document is no such assembly, or of other blocks.
    """
    rows = [*step_states(scene, steps)]
    whole = _assembly(scene) if document is None else document
    graph = _graph(whole)
    nodes = _nodes(graph, scene)
    for i, brick in enumerate(scene.placed):
        nodes[brick.name].update(order=i, place_step=None, held=[])
    for row in rows:
        for name in row.new:
            nodes[name]["place_step"] = row.step.number
        for robot, (node, name) in row.holds.items():
            nodes[name]["held"].append([row.step.number, robot, node])
    graph.setdefault("attributes", {})["plan"] = [_plain(row) for row in rows]
    return json.dumps(whole) + "\n"


def _plain(row: StepStates) -> Document:
    holds = {robot: [node, brick] for robot, (node, brick) in row.holds.items()}
    step = row.step
    return {"step": step.number, "type": step.kind.value, "placed": list(row.new), "holds": holds}


def _graph(whole: object) -> Document:
    """Return the graph of an assembly, which is part of its document."""
    held = payload(whole)
    held = payload(held["graph"]) if isinstance(held, dict) and "graph" in held else held
    if isinstance(held, dict) and isinstance(held.get("assembly"), dict):
        held = held["assembly"]
    if not isinstance(held, dict) or not isinstance(held.get("node", held.get("vertex")), dict):
        raise StepError("the source is not an assembly of compas_assembly; give what was imported")
    return held


def _nodes(graph: Document, scene: Scene) -> dict[int, Document]:
    """Return the nodes of bricks by their names: the node's key, or its place from 1."""
    rows: Mapping[str, Document] = graph["node" if "node" in graph else "vertex"]
    by_name = {int(key): node for key, node in rows.items() if key.isdigit()}
    if len(by_name) < len(rows):
        by_name = dict(enumerate(rows.values(), start=1))
    lost = [brick.name for brick in scene.bricks if not isinstance(by_name.get(brick.name), dict)]
    if lost:
        raise StepError(f"the source has no block {lost[0]}; give the assembly that was imported")
    return by_name


def _assembly(scene: Scene) -> Document:
    """Return the blocks of a scene and the faces between them as an assembly.

    Faces on the ground make a support of their own, a surface.
    """
    edges: dict[str, dict[str, Any]] = {str(brick.name): {} for brick in scene.bricks}
    for joint in scene.joints:
        a, b = map(str, joint.bricks)
        if joint.corners is not None:
            edge = edges[a].setdefault(b, {"interfaces": []})
            edge["interfaces"].append(_interface(joint.corners))
    nodes: dict[str, Document] = {
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


def _interface(corners: Sequence[Sequence[float]]) -> Document:
    points = [list(corner) for corner in corners]
    return {"dtype": "compas_assembly.datastructures/Interface", "data": {"points": points}}


def _block(points: Floats, faces: Sequence[Sequence[int]]) -> Document:
    return {"dtype": "compas_assembly.datastructures/Block", "data": _mesh(points, faces)}


def _sheet(polygons: Sequence[Sequence[Sequence[float]]]) -> Document:
    """Return polygons as a block that is not closed: the ground where bricks stand."""
    ends = np.cumsum([0, *map(len, polygons)]).tolist()
    faces = [list(range(a, b)) for a, b in pairwise(ends)]
    return _block(np.concatenate([np.array(p) for p in polygons]), faces)


def _mesh(points: Floats, faces: Sequence[Sequence[int]]) -> Document:
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
