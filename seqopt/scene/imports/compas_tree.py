"""Elements of a COMPAS model, and where its tree of transformations puts them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.checks import short
from seqopt.scene.imports.compas_data import kind, payload, transformation
from seqopt.scene.imports.documents import Entry, entry, listing, mapping


@dataclass(frozen=True)
class Element:
    """An element of a model.

    Attributes
    ----------
    where : str
        What to call it in messages.
    kind : str
        The last part of what it says that it is, in small letters.
    guid : str
        Its identifier.
    held : dict
        What it holds.
    matrix : (4, 4) float
        From its own coordinates to those of the model's world.
    """

    where: str
    kind: str
    guid: str
    held: Entry
    matrix: Floats


def read_elements(source: str, held: Entry) -> list[Element]:
    """Return the elements of a model, each where COMPAS places it.

    An element's transformation is relative to its parent in the tree, and the first of them to the
    model's.

    Parameters
    ----------
    source : str
        What to call the file in messages.
    held : dict
        What the model holds.

    Returns
    -------
    list of Element
        Groups among them.

    Raises
    ------
    SceneError
        If it has no elements, or its tree is none.
    """
    rows = [*by_guid(f"{source}: elements", entry(source, held, "elements"))]
    named = {guid: f"{source}: element {i}" for i, (guid, _) in enumerate(rows)}
    inner = {guid: mapping(named[guid], payload(item)) for guid, item in rows}
    placed: dict[str | None, Floats] = {
        None: transformation(f"{source}: transformation", held.get("transformation"))
    }
    for guid, parent in _tree(source, held):
        if guid not in inner or guid in placed:
            why = "occurs twice" if guid in placed else "is not there"
            raise SceneError(f"{source}: element {short(guid)} of the tree {why}")
        placed[guid] = placed[parent] @ _own(named[guid], inner[guid])
    for guid in inner.keys() - placed.keys():
        placed[guid] = placed[None] @ _own(named[guid], inner[guid])
    return [
        Element(named[guid], kind(item), guid, inner[guid], placed[guid]) for guid, item in rows
    ]


def by_guid(where: str, found: Any) -> Iterator[tuple[str, Entry]]:
    """Yield serialized objects, which stand by their identifiers or in a list, with these.

    Parameters
    ----------
    where : str
        What they are, for messages.
    found : object

    Raises
    ------
    SceneError
        If they are neither.
    """
    listed = not isinstance(found, dict)
    for key, item in enumerate(listing(where, found)) if listed else found.items():
        held = mapping(f"{where} {key}", item)
        yield str(held.get("guid", key) if listed else key), held


def _own(where: str, held: Entry) -> Floats:
    """Return the transformation of an element to its parent; early ones have a frame too."""
    frame = transformation(f"{where}: frame", held.get("frame"))
    return frame @ transformation(f"{where}: transformation", held.get("transformation"))


def _tree(source: str, held: Entry) -> Iterator[tuple[str, str | None]]:
    """Yield the identifiers of elements and of their parents, parents first."""
    tree = mapping(f"{source}: tree", payload(held.get("tree") or {}))
    waiting: list[tuple[Any, str | None]] = [(tree.get("root") or {}, None)]
    while waiting:
        node, above = waiting.pop()
        guid = mapping(f"{source}: a node of the tree", node).get("element")
        if guid is not None:
            yield str(guid), above
            above = str(guid)
        children = listing(f"{source}: children in the tree", node.get("children") or [])
        waiting += [(child, above) for child in children]
