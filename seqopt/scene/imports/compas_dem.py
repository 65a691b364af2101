"""Models of compas_dem and their problems: elements with transformations, contacts, materials."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.imports.compas_data import kind, mesh, moved, payload, transformation
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

    Returns
    -------
    Content

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
    elements = _elements(source, held)
    densities = _densities(source, held)
    blocks = [
        _block(f"{source}: element {i}", str(i), item, densities) for i, item in enumerate(elements)
    ]
    place = _places(source, held, {str(item.get("guid")): i for i, item in enumerate(elements)})
    faces = tuple(
        FileFace((entry(source, place, a), entry(source, place, b)), corners)
        for a, b, corners in _contacts(source, held)
    )
    return Content(tuple(blocks), faces, law=law, said=tuple(said))


def _elements(source: str, held: Entry) -> list[Entry]:
    """Return the elements, which stand by their identifier or in a list."""
    found = entry(source, held, "elements")
    rows = [*found.values()] if isinstance(found, dict) else listing(f"{source}: elements", found)
    return [mapping(f"{source}: element {i}", item) for i, item in enumerate(rows)]


def _densities(source: str, held: Entry) -> dict[str, float]:
    """Return the densities of materials by their identifier."""
    found = held.get("materials") or {}
    rows = [*found.values()] if isinstance(found, dict) else listing(source, found)
    out = {}
    for item in rows:
        value = mapping(source, payload(item)).get("density")
        if value is not None:
            out[str(item.get("guid"))] = number(f"{source}: density", value)
    return out


def _block(where: str, key: str, item: Entry, densities: dict[str, float]) -> FileBlock:
    held = mapping(where, payload(item))
    vertices, faces = mesh(where, entry(where, held, "geometry", "shape"))
    matrix = transformation(f"{where}: transformation", held.get("transformation"))
    return FileBlock(
        key,
        moved(vertices, matrix),
        faces,
        support=held.get("is_support") is True,
        density=densities.get(str(held.get("material"))),
    )


def _places(source: str, held: Entry, by_guid: dict[str, int]) -> dict[str, int]:
    """Return the places of the elements of the graph's nodes."""
    nodes = mapping(source, mapping(source, held.get("graph") or {}).get("node") or {})
    out = {}
    for key, node in nodes.items():
        element = mapping(f"{source}: node {key}", node).get("element")
        if str(element) not in by_guid:
            raise SceneError(f"{source}: node {key} is of element {element}, which is not there")
        out[key] = by_guid[str(element)]
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
