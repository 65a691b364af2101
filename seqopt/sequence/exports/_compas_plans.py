"""Plans for COMPAS: a building plan of compas_timber, and an assembly with the plan in it.

Both are JSON as `compas.json_load` reads it, written without COMPAS.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import read_text
from seqopt.arrays import Floats
from seqopt.errors import StepError
from seqopt.scene.boxes import vertices_of
from seqopt.scene.imports._building import block_numbers
from seqopt.scene.imports._carried import carry
from seqopt.scene.imports._compas_models import assembly_graph, by_guid
from seqopt.scene.imports._compas_shapes import kind, payload
from seqopt.scene.imports._content import entry, parse_json
from seqopt.scene.imports.formats import read_content, sniffed
from seqopt.scene.scene import Scene
from seqopt.sequence.exports._compas_values import Document, compas_frame, mesh_data, typed
from seqopt.sequence.exports._grip_frames import Frame, Held, brick_frame, hold
from seqopt.sequence.exports._tables import StepStates, step_states
from seqopt.sequence.steps import Step, StepKind


@dataclass(frozen=True)
class Source:
    """A file from which a scene was imported."""

    names: Mapping[int, str]  # of bricks: identifiers of elements of a COMPAS model, else keys
    graph: Any = None  # its document if it is a graph of compas_assembly


def read_source(scene: Scene, path: Path) -> Source:
    """Return the file from which a scene was imported, in any format that ``import`` knows."""
    content, graph = read_content(path), None
    keys = names = [block.key for block in content.blocks]
    if path.suffix.lower() == ".json":
        document = parse_json(read_text(path), str(path))
        form = sniffed(document, str(path))
        graph = document if form == "compas_assembly" and isinstance(document, dict) else None
        if form in ("compas_model", "compas_dem", "compas_timber"):
            held = payload(document)
            held = payload(held["model"]) if "model" in held else held
            rows = by_guid(f"{path}: element", held["elements"])
            beams = form == "compas_timber"  # its blocks are counted among its beams
            guids = [guid for guid, item in rows if not beams or kind(item) == "beam"]
            names = [guids[int(key)] for key in keys]
    found = dict(zip(block_numbers(keys), names, strict=True))
    lost = [brick.name for brick in scene.bricks if brick.name not in found]
    if lost:
        raise StepError(f"the source has no block {lost[0]}; give the file that was imported")
    return Source(found, graph)


def timber_plan(scene: Scene, steps: Sequence[Step], source: Source | None = None) -> str:
    """Return a plan as a ``BuildingPlan`` of compas_timber, JSON, in names of the source if any."""
    names = source.names if source else {b.name: str(b.name) for b in scene.bricks}
    robots, frames = {robot.name: robot for robot in scene.robots}, cache(partial(hold, scene))
    rows, before = [], _Holds()
    for row in step_states(scene, steps):
        grips = {
            robot: (f"{robot} holds {names[brick]} at node {node}", frames(robots[robot], node))
            for robot, (node, brick) in row.holds.items()
        }
        frame = Frame((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        if row.new:
            frame = brick_frame(scene.placed[row.step.bricks - len(row.new)])
        data = {
            "location": compas_frame(frame),
            "geometry": "box",
            "priority": row.step.number - 1,
            "element_ids": [names[name] for name in row.new],
            "instructions": [_text(robot, *said) for robot, said in grips.items()],
            "is_built": False,
            "is_planned": True,
            "elements_held": sorted({names[brick] for _, brick in row.holds.values()}),
            "actor": "ROBOT",
        }
        said = ", ".join(_told(row, names, before))
        rows.append(typed("compas_timber.planning/Step", data, name=said))
        before = row.holds
    return json.dumps(typed("compas_timber.planning/BuildingPlan", {"steps": rows})) + "\n"


_Holds = dict[str, tuple[int, int]]


def _told(row: StepStates, names: Mapping[int, str], before: _Holds) -> Iterator[str]:
    """Yield what robots do in a step, in words, whose grips it changes."""
    for robot, (node, brick) in row.holds.items():
        if before.get(robot) != (node, brick):
            does = "places" if brick in row.new else "takes"
            yield f"{robot} {does} {names[brick]}"
    for robot, (_, brick) in before.items():
        if robot not in row.holds:
            does = "removes" if row.step.kind is StepKind.REMOVE else "lets go of"
            yield f"{robot} {does} {names[brick]}"


def _text(robot: str, said: str, held: Held) -> Document:
    """Return what a robot holds as an instruction: text where its tool is."""
    data = {"id": robot, "location": compas_frame(held.grip), "text": said, "size": held.depth}
    return typed("compas_timber.planning/Text3d", data)


def compas_assembly(scene: Scene, steps: Sequence[Step], source: Source | None = None) -> str:
    """Return an assembly of compas_assembly with the plan as attributes, JSON.

    A source that is an assembly stays as it is, with attributes added; otherwise blocks and faces
    are those of the scene, and ``name`` what the source calls them. Every node of a block that is
    built has ``order``, its place in the build, ``place_step`` and ``held``, a list of step, robot
    and node; the graph has ``plan``, a list of steps.
    """
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
    plan = graph.setdefault("attributes", {})["plan"] = []
    for row in step_states(scene, steps):
        number, kind_of = row.step.number, row.step.kind.value
        for name in row.new:
            nodes[name]["place_step"] = number
        for robot, (node, name) in row.holds.items():
            nodes[name]["held"].append([number, robot, node])
        holds = {robot: list(held) for robot, held in row.holds.items()}
        plan.append({"step": number, "type": kind_of, "placed": list(row.new), "holds": holds})
    keys = {name: names[name] if kept is not None else str(name) for name in nodes}
    carry(graph, keys, scene, "m" if kept is None else None)
    return json.dumps(whole) + "\n"


def _assembly(scene: Scene) -> Document:
    """Return the blocks of a scene and the faces between them as an assembly.

    Faces on the ground make a support of their own, a surface: a block that is not closed.
    """
    nodes: dict[str, Document] = {
        str(brick.name): {"block": _block(*vertices_of(brick))} for brick in scene.bricks
    }
    faces = [(joint.bricks, joint.corners) for joint in scene.joints]
    most = max(brick.name for brick in scene.bricks)
    stands = [end for end in scene.grounds if end.corners is not None]
    if stands:
        most += 1
        polygons = [end.corners for end in stands if end.corners is not None]
        ends = np.cumsum([0, *map(len, polygons)]).tolist()
        sheet = _block(np.concatenate(polygons), [range(a, b) for a, b in pairwise(ends)])
        nodes[str(most)] = {"block": sheet, "is_support": True}
        faces += [((most, end.brick), end.corners) for end in stands]
    edges: dict[str, dict[str, Any]] = {name: {} for name in nodes}
    for (a, b), corners in faces:
        if corners is not None:
            edge = edges[str(a)].setdefault(str(b), {"interfaces": []})
            points = {"points": [list(corner) for corner in corners]}
            edge["interfaces"].append(typed("compas_assembly.datastructures/Interface", points))
    graph = {
        "attributes": {"name": scene.name},
        "default_node_attributes": {"block": None, "is_support": False},
        "default_edge_attributes": {"interfaces": None},
        "node": nodes,
        "edge": edges,
        "max_node": most,
    }
    data = {
        "attributes": {"name": scene.name},
        "graph": typed("compas.datastructures/Graph", graph),
    }
    return typed("compas_assembly.datastructures/Assembly", data)


def _block(points: Floats, faces: Sequence[Iterable[int]]) -> Document:
    return typed("compas_assembly.datastructures/Block", mesh_data(points, faces))
