"""Scenes of COMPAS, and lists and dictionaries of its meshes: what blocks they have."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.imports._compas_models import by_guid
from seqopt.scene.imports._compas_shapes import kind, payload, solid_of, transformation_of
from seqopt.scene.imports._content import Content, Entry, FileBlock, entry, listing, mapping, moved
from seqopt.scene.imports._meshes import object_content

_SOLIDS = ("mesh", "box", "polyhedron")
_DEEPEST = 50  # lists and groups within each other


def is_meshes(document: Any) -> bool:
    """Return whether a document is a mesh of COMPAS, or a list or dictionary of such."""
    if isinstance(document, list):
        return True
    if not isinstance(document, dict) or not document:
        return False
    return _is_solid(document) or all(
        isinstance(value, list) or _is_solid(value) for value in document.values()
    )


def _is_solid(value: Any) -> bool:
    held = payload(value)
    keys = {*held} if isinstance(held, dict) else {*()}
    return kind(value) in _SOLIDS or {"vertex", "face"} <= keys or {"vertices", "faces"} <= keys


def read_meshes(document: Any, source: str) -> Content:
    """Return meshes as blocks, under their names, or their keys in a dictionary."""
    found = object_content(_listed(source, document, "", ""), source)
    return replace(found, said=("a list of meshes: no supports, faces or order",))


def _listed(where: str, value: Any, name: str, group: str, depth: int = 0) -> Iterator[FileBlock]:
    """Yield the meshes of a value; a list or dictionary in another one is a group."""
    if depth > _DEEPEST:
        raise SceneError(f"{where}: lists stand in lists more than {_DEEPEST} deep")
    if isinstance(value, list):
        for i, item in enumerate(value):
            yield from _listed(f"{where}: mesh {i}", item, "", group or name, depth + 1)
    elif isinstance(value, dict) and not kind(value) and not _is_solid(value):
        for key, item in value.items():
            yield from _listed(f"{where}: {key}", item, key, group or name, depth + 1)
    else:
        own = value.get("name") if isinstance(value, dict) else None
        key = name or (own if isinstance(own, str) else "")
        yield FileBlock(key, *solid_of(where, value), group=group)


@dataclass(frozen=True)
class _Node:
    """A node of the tree of a scene."""

    entry: Entry
    group: str  # the names of the nodes above it
    matrix: Floats  # (4, 4); of the node above it, to the world


def read_scene(document: Any, source: str) -> Content:
    """Return the meshes and boxes that a scene shows, each where COMPAS places it."""
    held = mapping(source, payload(document))
    items = dict(by_guid(f"{source}: items", listing(source, entry(source, held, "items"))))
    left = Counter[str]()
    found = object_content(_shown(source, held, items, left), source)
    said = (f"{count} objects are left out: {what}" for what, count in left.items())
    return replace(found, said=("a scene: no supports, faces or order", *said))


def _shown(
    source: str, held: Entry, items: dict[str, Entry], left: Counter[str]
) -> Iterator[FileBlock]:
    """Yield the solids of a scene. ``left``: gets what is left out, and how often."""
    root = mapping(f"{source}: root", entry(source, held, "root"))
    waiting = [_Node(root, "", np.eye(4))]
    while waiting:
        node = waiting.pop()
        settings = mapping(source, node.entry.get("settings") or {})
        name = str(settings.get("name") or "")
        where = f"{source}: object {name}"
        matrix = node.matrix @ transformation_of(where, settings.get("transformation"))
        item = items.get(str(node.entry.get("item")))
        if settings.get("show") is False:
            left["hidden"] += item is not None
        elif item is not None and kind(item) == "brep":
            raise SceneError(f"{where} is a Brep; save its mesh (Brep.to_tesselation)")
        elif item is not None and not _is_solid(item):
            left[kind(item)] += 1
        elif item is not None:
            vertices, faces = solid_of(where, item)
            yield FileBlock(name, moved(vertices, matrix), faces, group=node.group)
        inner = "" if node.entry is root else f"{node.group}::{name}".removeprefix("::")
        children = listing(f"{where}: children", node.entry.get("children") or [])
        waiting += [_Node(mapping(where, child), inner, matrix) for child in reversed(children)]
