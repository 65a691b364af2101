"""Assemblies of compas_assembly and compas_cra, today's and those of earlier versions.

Today: a graph whose nodes have a ``block``, a mesh, and ``is_support``, and whose edges have
``interfaces``. Earlier: ``assembly`` beside ``blocks``, edges with ``interface_points``; or a
network with both. A list of meshes is an assembly of which nothing else is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.imports.compas_data import mesh, payload
from seqopt.scene.imports.content import Content, FileBlock, FileFace
from seqopt.scene.imports.documents import Entry, entry, listing, mapping, number, point


def read_assembly(document: Any, source: str) -> Content:
    """Return what an assembly says.

    Parameters
    ----------
    document : object
        A JSON document.
    source : str
        What to call it in messages.

    Raises
    ------
    SceneError
        If it is no such assembly.
    """
    if isinstance(document, list):
        return _meshes(document, source)
    graph, meshes = assembly_graph(document, source)
    nodes = mapping(f"{source}: node", entry(source, graph, "node", "vertex"))
    common = mapping(source, payload(graph.get("node_attributes") or graph.get("dva") or {}))
    keys = [key for key in nodes if meshes is None or key in meshes]
    blocks = [
        _block(f"{source}: block {key}", key, {**common, **mapping(source, nodes[key])}, meshes)
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

    Parameters
    ----------
    document : object
        A JSON document, of which they are parts.
    source : str
        What to call it in messages.

    Raises
    ------
    SceneError
        If it is no such assembly.
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


def _block(where: str, key: str, node: Entry, meshes: dict[str, Any] | None) -> FileBlock:
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
