"""Data of COMPAS as all of its packages write them: meshes, frames, boxes, transformations."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
from seqopt.scene.checks import short

Entry = dict[str, Any]
LARGEST = 1e15  # number: products of coordinates beyond lose all digits


def parse_json(text: str, source: str) -> Any:
    """Return a JSON document.

    Raises `SceneError` if it is no JSON, nested too deep, or holds numbers that no float can be.
    """
    try:
        return json.loads(text, parse_constant=_refuse)
    except json.JSONDecodeError as error:
        raise SceneError(f"{source}: not JSON, line {error.lineno}: {error.msg}") from error
    except RecursionError as error:
        raise SceneError(f"{source}: nested too deep for an assembly; give one") from error
    except SceneError as error:
        raise SceneError(f"{source}: {error}") from error
    except ValueError as error:  # an integer of thousands of digits
        raise SceneError(f"{source}: a number has too many digits; give fewer") from error


def _refuse(name: str) -> float:
    raise SceneError(f"{name} stands where a number should; give finite numbers")


def mapping(where: str, value: object) -> Entry:
    """Return an object of a document."""
    if not isinstance(value, dict):
        raise SceneError(f"{where} is {short(value)}; an object is expected")
    return value


def entry(where: str, holder: object, *keys: str) -> Any:
    """Return what stands under the first of some keys that there is.

    Raises `SceneError` if there is none of them, or the holder is no object.
    """
    found = mapping(where, holder)
    for key in keys:
        if key in found:
            return found[key]
    raise SceneError(f"{where}: {' or '.join(keys)} is missing")


def listing(where: str, value: object, most: int = 10**7) -> list[Any]:
    """Return a list of a document.

    ``most``: entries that it may have. Raises `SceneError` if it is something else, or longer.
    """
    if not isinstance(value, list):
        raise SceneError(f"{where} is {short(value)}; a list is expected")
    if len(value) > most:
        raise SceneError(f"{where} has {len(value)} entries; {most} is the most")
    return value


def number(where: str, value: object) -> float:
    """Return a finite number of a document, up to `LARGEST`."""
    try:
        found = float(value) if isinstance(value, int | float) else math.nan
    except OverflowError:
        found = math.inf
    if not abs(found) <= LARGEST or isinstance(value, bool):
        raise SceneError(
            f"{where} is {short(value)}; a finite number up to {LARGEST:g} is expected"
        )
    return found


def point(where: str, value: object) -> Floats:
    """Return a point of a document: three numbers, as they are or in an object of COMPAS.

    Result (3,).
    """
    plain = value
    while isinstance(plain, dict):
        plain = entry(where, plain, "data", "value", "point")
    row = listing(where, plain)
    if len(row) != 3:
        raise SceneError(f"{where} is {short(value)}; three numbers are expected")
    return np.array([number(where, x) for x in row])


_PLAIN = 1e-9  # by how much rounding may change the last row of a transformation
_Solid = tuple[Floats, list[list[int]]]


def payload(value: Any) -> Any:
    """Return what a serialized object holds, under whichever key its version uses.

    Result: itself, if it wraps nothing.
    """
    for _ in range(4):
        if not isinstance(value, dict):
            break
        inner = next((value[key] for key in ("data", "value") if key in value), None)
        if not isinstance(inner, dict | list):
            break
        value = inner
    return value


def kind(value: Any) -> str:
    """Return the last part of what a serialized object says that it is, in small letters.

    Result: empty if it says nothing.
    """
    name = value.get("dtype") if isinstance(value, dict) else None
    return name.rsplit("/", 1)[-1].lower() if isinstance(name, str) else ""


def mesh(where: str, value: Any) -> _Solid:
    """Return the vertices and faces of a mesh.

    ``value``: with ``vertex`` and ``face``, as `compas.datastructures.Mesh` writes them, or with
    ``vertices`` and ``faces``, as `compas.geometry.Polyhedron` does; or a box. Results:
    ``vertices`` (V, 3); ``faces``: places among the vertices.
    """
    held = payload(value)
    if isinstance(held, dict) and {"xsize", "ysize", "zsize"} <= set(held):
        return _box(where, held)
    if isinstance(held, dict) and "vertices" in held:
        rows = [point(f"{where}: a vertex", row) for row in listing(where, held["vertices"])]
        sides = listing(where, entry(where, held, "faces"))
        return np.array(rows).reshape(-1, 3), [_places(where, side, None) for side in sides]
    return _halfedge(where, held)


def _halfedge(where: str, held: Any) -> _Solid:
    """Return a mesh whose vertices and faces have keys."""
    vertex = mapping(f"{where}: vertex", entry(where, held, "vertex"))
    face = mapping(f"{where}: face", entry(where, held, "face"))
    place = {key: i for i, key in enumerate(vertex)}
    rows = [
        [number(f"{where}: vertex {key}", mapping(where, v).get(axis, 0.0)) for axis in "xyz"]
        for key, v in vertex.items()
    ]
    return np.array(rows).reshape(-1, 3), [
        _places(f"{where}: face {key}", side, place) for key, side in face.items()
    ]


def _places(where: str, side: Any, place: dict[str, int] | None) -> list[int]:
    """Return the places of a face's vertices; a vertex that closes the circle is left out."""
    keys = listing(where, side)
    out = []
    for key in keys:
        named = place.get(str(key)) if place is not None else key
        if not isinstance(named, int) or isinstance(named, bool):
            raise SceneError(f"{where}: there is no vertex {short(key)}")
        out.append(named)
    return out[:-1] if len(out) > 1 and out[0] == out[-1] else out


def _box(where: str, held: dict[str, Any]) -> _Solid:
    """Return a box, whose frame is in its middle."""
    size = [number(f"{where}: {key}", held[key]) for key in ("xsize", "ysize", "zsize")]
    origin, axes = frame(where, held.get("frame"))
    return origin + 0.5 * (BOX_CORNERS * size) @ axes, [list(face) for face in BOX_FACES]


def frame(where: str, value: Any) -> tuple[Floats, Floats]:
    """Return a frame.

    ``value``: with ``point``, ``xaxis`` and ``yaxis``; the world's if None. Results: ``origin``
    (3,); ``axes`` (3, 3): rows are unit vectors.
    """
    if value is None:
        return np.zeros(3), np.eye(3)
    held = payload(value)
    origin = point(f"{where}: point", entry(where, held, "point"))
    first = point(f"{where}: xaxis", entry(where, held, "xaxis"))
    second = point(f"{where}: yaxis", entry(where, held, "yaxis"))
    third = np.cross(first, second)
    sizes = [float(np.linalg.norm(axis)) for axis in (first, third)]
    if not min(sizes) > 0:
        raise SceneError(f"{where}: xaxis and yaxis span no plane")
    first, third = first / sizes[0], third / sizes[1]
    return origin, np.stack([first, np.cross(third, first), third])


def _transformation(where: str, value: Any) -> Floats:
    """Return a transformation.

    ``value``: with a ``matrix``, or a matrix; none if None. Result (4, 4).
    """
    if value is None:
        return np.eye(4)
    held = payload(value)
    if isinstance(held, dict) and "matrix" not in held and "point" in held:
        origin, axes = frame(where, held)
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = axes.T, origin
        return out
    rows = listing(where, held["matrix"] if isinstance(held, dict) and "matrix" in held else held)
    matrix = [[number(where, x) for x in listing(where, row)] for row in rows]
    if [len(row) for row in matrix] != [4] * 4:
        raise SceneError(f"{where} is {short(value)}; a matrix of four by four is expected")
    if not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0), rtol=0.0, atol=_PLAIN):
        raise SceneError(f"{where} ends in {matrix[3]}; give a matrix that ends in 0, 0, 0, 1")
    return np.array(matrix)


def moved(points: Floats, matrix: Floats) -> Floats:
    """Return points after a transformation. ``points`` (k, 3); ``matrix`` (4, 4). Result (k, 3)."""
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


@dataclass(frozen=True)
class Element:
    """An element of a model."""

    where: str  # what to call it in messages
    kind: str  # the last part of what it says that it is, in small letters
    guid: str  # its identifier
    held: Entry  # what it holds
    matrix: Floats  # (4, 4); from its own coordinates to those of the model's world


def read_elements(source: str, held: Entry) -> list[Element]:
    """Return the elements of a model, each where COMPAS places it.

    An element's transformation is relative to its parent in the tree, and the first of them to the
    model's.

    ``held``: what the model holds. Result: groups among them. Raises `SceneError` if it has no
    elements, or its tree is none.
    """
    rows = [*by_guid(f"{source}: elements", entry(source, held, "elements"))]
    named = {guid: f"{source}: element {i}" for i, (guid, _) in enumerate(rows)}
    inner = {guid: mapping(named[guid], payload(item)) for guid, item in rows}
    placed: dict[str | None, Floats] = {
        None: _transformation(f"{source}: transformation", held.get("transformation"))
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

    Raises `SceneError` if they are neither.
    """
    listed = not isinstance(found, dict)
    for key, item in enumerate(listing(where, found)) if listed else found.items():
        held = mapping(f"{where} {key}", item)
        yield str(held.get("guid", key) if listed else key), held


def _own(where: str, held: Entry) -> Floats:
    """Return the transformation of an element to its parent; early ones have a frame too."""
    frame = _transformation(f"{where}: frame", held.get("frame"))
    return frame @ _transformation(f"{where}: transformation", held.get("transformation"))


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
