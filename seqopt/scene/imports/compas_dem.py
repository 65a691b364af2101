"""Models of compas_dem and their problems: elements with transformations, contacts, materials."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.imports.compas_data import kind, mesh, moved, payload
from seqopt.scene.imports.compas_tree import Element, by_guid, read_elements
from seqopt.scene.imports.content import Content, FileBlock, FileFace
from seqopt.scene.imports.documents import Entry, entry, listing, mapping, number, point
from seqopt.scene.library.law import JointLaw


def read_model(document: Any, source: str) -> Content:
    """Return what a block model, or a problem about one, says.

    Parameters
    ----------
    document : object
        A JSON document.
    source : str
        What to call it in messages.

    Raises
    ------
    SceneError
        If it is no such model.
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
