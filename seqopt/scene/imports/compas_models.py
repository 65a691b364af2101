"""Assemblies and models of COMPAS's packages: what blocks they have, and where these touch.

Assemblies of compas_assembly and compas_cra: today a graph whose nodes have a ``block``, a mesh,
and ``is_support``, and whose edges have ``interfaces``; earlier ``assembly`` beside ``blocks``,
edges with ``interface_points``, or a network with both. A list of meshes is an assembly of which
nothing else is known.

Models of compas_dem and their problems: elements with transformations, contacts, materials.

Beams of a compas_timber model: boxes from the start of their center lines. Cuts of joints are left
out: a beam is its blank. Beams meet over their faces where these touch; where they run into each
other the model's own joints say who meets whom.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
from seqopt.scene.imports.compas_data import (
    Element,
    Entry,
    by_guid,
    entry,
    frame,
    kind,
    listing,
    mapping,
    mesh,
    moved,
    number,
    payload,
    point,
    read_elements,
)
from seqopt.scene.imports.content import Content, FileBlock, FileFace, FileJoint
from seqopt.scene.library.common import JointLaw


def read_assembly(document: Any, source: str) -> Content:
    """Return what an assembly says. Raises `SceneError` if it is no such assembly."""
    if isinstance(document, list):
        return _meshes(document, source)
    graph, meshes = assembly_graph(document, source)
    nodes = mapping(f"{source}: node", entry(source, graph, "node", "vertex"))
    common = mapping(source, payload(graph.get("node_attributes") or graph.get("dva") or {}))
    keys = [key for key in nodes if meshes is None or key in meshes]
    blocks = [
        _node_block(
            f"{source}: block {key}", key, {**common, **mapping(source, nodes[key])}, meshes
        )
        for key in keys
    ]
    place = {key: i for i, key in enumerate(keys)}
    faces = [
        FileFace((place[a], place[b]), corners)
        for a, b, corners in _faces(graph, source)
        if a in place and b in place
    ]
    said = [f"{len(nodes) - len(keys)} nodes have no block"] if len(keys) < len(nodes) else []
    return Content(tuple(blocks), tuple(faces), said=tuple(said))


def assembly_graph(document: Any, source: str) -> tuple[Entry, dict[str, Any] | None]:
    """Return the graph of an assembly, and its meshes by key where they stand beside it.

    ``document``: A JSON document, of which they are parts. Raises `SceneError` if it is no such
    assembly.
    """
    held = mapping(source, payload(document))
    if "blocks" in held and "assembly" in held:
        return (
            mapping(f"{source}: assembly", payload(held["assembly"])),
            mapping(f"{source}: blocks", held["blocks"]),
        )
    if "graph" in held:
        held = mapping(f"{source}: graph", payload(held["graph"]))
    if "node" not in held:
        raise SceneError(f"{source}: neither graph nor node is there; give an assembly")
    return held, None


def _meshes(document: list[Any], source: str) -> Content:
    """Return a list of meshes as blocks."""
    blocks = []
    for i, item in enumerate(document):
        while isinstance(item, list) and len(item) == 1:
            item = item[0]  # noqa: PLW2901  # some files wrap each mesh
        blocks.append(FileBlock(str(i), *mesh(f"{source}: mesh {i}", item)))
    return Content(tuple(blocks), said=("a list of meshes: no supports, faces or order",))


def _node_block(where: str, key: str, node: Entry, meshes: dict[str, Any] | None) -> FileBlock:
    held = meshes[key] if meshes is not None else entry(where, node, "block")
    vertices, faces = mesh(where, held)
    course = node.get("course")
    return FileBlock(
        key,
        vertices,
        faces,
        support=node.get("is_support") is True,
        course=None if course is None else number(f"{where}: course", course),
    )


def _faces(graph: Entry, source: str) -> Iterator[tuple[str, str, Floats]]:
    """Yield the keys of blocks that touch, and the corners of each face."""
    edges = mapping(f"{source}: edge", graph.get("edge") or {})
    for a, ends in edges.items():
        for b, held in mapping(f"{source}: edge {a}", ends).items():
            where = f"{source}: edge {a}-{b}"
            for corners in _interfaces(where, held if isinstance(held, dict) else {}):
                yield a, b, corners


def _interfaces(where: str, held: Entry) -> Iterator[Floats]:
    """Yield the corners of the faces on an edge, under whichever key its version uses."""
    found = held.get("interfaces")
    found = listing(where, found) if found else [held["interface"]] if held.get("interface") else []
    if held.get("interface_points"):
        found = [{"points": held["interface_points"]}]
    for face in found:
        points = entry(where, payload(face), "points")
        yield np.array([point(where, corner) for corner in listing(where, points)]).reshape(-1, 3)


def read_model(document: Any, source: str) -> Content:
    """Return what a block model, or a problem about one, says.

    Raises `SceneError` if it is no such model.
    """
    held = mapping(source, payload(document))
    law, said = None, list[str]()
    if kind(document) == "problem":
        law = _law(source, held.get("contact_properties"))
        said.append("loads of the problem are left out; blocks carry their weight")
        if "model" not in held:  # some versions keep its identifier alone
            raise SceneError(
                f"{source}: the problem does not hold its model; give the model itself"
            )
        held = mapping(f"{source}: model", payload(held["model"]))
    elements = read_elements(source, held)
    densities = _densities(source, held)
    kept = {i: e for i, e in enumerate(elements) if e.kind != "group"}
    blocks = [_block(str(i), element, densities) for i, element in kept.items()]
    if len(kept) < len(elements):
        said.append(f"{len(elements) - len(kept)} groups only place what is in them")
    known: dict[str, int | None] = {element.guid: None for element in elements}
    known |= {element.guid: k for k, element in enumerate(kept.values())}
    place = _places(source, held, known)
    faces = tuple(
        FileFace((entry(source, place, a), entry(source, place, b)), corners)
        for a, b, corners in _contacts(source, held)
    )
    return Content(tuple(blocks), faces, law=law, said=tuple(said))


def _densities(source: str, held: Entry) -> dict[str, float]:
    """Return the densities of materials by their identifier."""
    out = {}
    for guid, item in by_guid(f"{source}: materials", held.get("materials") or []):
        value = mapping(source, payload(item)).get("density")
        if value is not None:
            out[guid] = number(f"{source}: density", value)
    return out


def _block(key: str, element: Element, densities: dict[str, float]) -> FileBlock:
    where, held = element.where, element.held
    vertices, faces = mesh(where, entry(where, held, "geometry", "shape"))
    return FileBlock(
        key,
        moved(vertices, element.matrix),
        faces,
        support=held.get("is_support") is True,
        density=densities.get(str(held.get("material"))),
    )


def _places(source: str, held: Entry, known: dict[str, int | None]) -> dict[str, int]:
    """Return the places of the blocks of the graph's nodes; groups have none."""
    nodes = mapping(source, mapping(source, held.get("graph") or {}).get("node") or {})
    out = {}
    for key, node in nodes.items():
        element = mapping(f"{source}: node {key}", node).get("element")
        if str(element) not in known:
            raise SceneError(f"{source}: node {key} is of element {element}, which is not there")
        place = known[str(element)]
        if place is not None:
            out[key] = place
    return out


def _contacts(source: str, held: Entry) -> Iterator[tuple[str, str, Floats]]:
    """Yield the keys of blocks that touch, and the corners of each face."""
    graph = mapping(source, held.get("graph") or {})
    for a, ends in mapping(source, graph.get("edge") or {}).items():
        for b, item in mapping(f"{source}: edge {a}", ends).items():
            where = f"{source}: edge {a}-{b}"
            found = mapping(where, item or {}).get("contacts") or []
            for face in listing(where, found):
                points = mapping(where, payload(face)).get("points") or []
                rows = [point(where, corner) for corner in listing(where, points)]
                if len(rows) > 2:  # of points and edges nothing is carried over a face
                    yield a, b, np.array(rows)


def _law(source: str, held: Any) -> JointLaw | None:
    """Return the stiffness of joints by area, if the model has one."""
    if held is None:
        return None
    properties = mapping(source, payload(held))
    found = properties.get("joint_model") or properties.get("contact_model") or {}
    model = mapping(f"{source}: joint model", payload(found))
    normal = model.get("kn", model.get("k_n"))
    side = model.get("kt", model.get("k_t"))
    if normal is None or side is None:
        return None
    across = number(f"{source}: kt", side)
    return JointLaw(translational=(number(f"{source}: kn", normal), across, across))


def read_timber(document: Any, source: str) -> Content:
    """Return the beams of a model. Raises `SceneError` if it is no such model, or has no beams."""
    held = mapping(source, payload(document))
    elements = read_elements(source, held)
    beams = [element for element in elements if element.kind == "beam"]
    if not beams:
        raise SceneError(f"{source}: it has no beams; give a model with some")
    blocks = tuple(_beam(f"{source}: beam {i}", str(i), beam) for i, beam in enumerate(beams))
    place = {beam.guid: i for i, beam in enumerate(beams)}
    joints = tuple(_joint(blocks, pair) for pair in _pairs(source, held, place))
    said = ["beams are their blanks: cuts and fasteners are left out"]
    if len(beams) < len(elements):
        said.append(f"{len(elements) - len(beams)} elements that are not beams are left out")
    return Content(blocks, joints=joints, said=tuple(said))


def _beam(where: str, key: str, beam: Element) -> FileBlock:
    """Return a beam; its frame, where it has one, is that in the model, not that in its group."""
    held = beam.held
    names = ("length", "width", "height")
    size = np.array([number(f"{where}: {name}", entry(where, held, name)) for name in names])
    if not size.min() > 0:
        raise SceneError(f"{where}: its sizes are {size.tolist()}; give positive ones")
    local: Floats = 0.5 * (BOX_CORNERS + np.array([1.0, 0.0, 0.0])) * size
    if held.get("frame") is not None:
        origin, axes = frame(where, held["frame"])
        points = origin + local @ axes
    else:
        points = moved(local, beam.matrix)
    return FileBlock(key, np.asarray(points), BOX_FACES)


def _pairs(source: str, held: Entry, place: dict[str, int]) -> Iterator[tuple[int, int]]:
    """Yield the places of beams that the model's own joints hold together."""
    seen = set()
    for _, item in by_guid(f"{source}: joints", held.get("joints") or []):
        joint = mapping(source, payload(item))
        ends = [str(x) for x in listing(source, joint.get("element_guids") or [])]
        for a, b in combinations(sorted(place[x] for x in ends if x in place), 2):
            if (a, b) not in seen:
                seen.add((a, b))
                yield a, b


def _joint(blocks: tuple[FileBlock, ...], pair: tuple[int, int]) -> FileJoint:
    """Return a joint halfway between the center lines of two beams, where these are nearest."""
    lines = [_center_line(blocks[i].vertices) for i in pair]
    (start, step, side), (other, reach, width) = lines
    at, to = _nearest((start, step), (other, reach))
    middle = 0.5 * (start + at * step + other + to * reach)
    ahead = np.array([block.vertices.mean(axis=0) for block in (blocks[i] for i in pair)])
    along = ahead[1] - ahead[0]
    size = float(np.linalg.norm(along))
    along = along / size if size > 0 else np.array([0.0, 0.0, 1.0])
    return FileJoint(pair, middle, along, min(side, width))


def _center_line(corners: Floats) -> tuple[Floats, Floats, float]:
    """Return the start of a beam's center line, the step to its end, and its smaller side."""
    start, end = corners[:4].mean(axis=0), corners[4:].mean(axis=0)
    sides = np.linalg.norm(corners[[1, 2]] - corners[0], axis=1)
    return start, end - start, float(sides.min())


def _nearest(first: tuple[Floats, Floats], second: tuple[Floats, Floats]) -> tuple[float, float]:
    """Return at which shares of two lines, starts and steps, they are nearest to each other."""
    (start, step), (other, reach) = first, second
    gap = start - other
    a, b, c = float(step @ step), float(step @ reach), float(reach @ reach)
    d, e = float(step @ gap), float(reach @ gap)
    apart = a * c - b * b
    at = 0.5 if apart <= 1e-12 * a * c else float(np.clip((b * e - c * d) / apart, 0.0, 1.0))
    to = float(np.clip((b * at + e) / c, 0.0, 1.0))
    return float(np.clip((b * to - d) / a, 0.0, 1.0)), to
