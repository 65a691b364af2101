"""Files of meshes: OBJ and OFF with their polygons; PLY, STL, GLB and 3MF.

trimesh reads the last four. Of an OBJ and an OFF it keeps triangles alone, cut as fans, which a
face that is not convex does not survive, and of an OBJ it joins all objects; so these have a few
lines of their own here.
"""

from __future__ import annotations

import io
import logging
import re
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import FileError, SceneError
from seqopt.scene._checks import short
from seqopt.scene.imports._content import LARGEST, UNITS, Content, FileBlock, moved
from seqopt.scene.imports._meshes import mesh_content, object_content

_UNASKED = logging.NullHandler()  # else Python prints what no one listens to
_NEEDS = {  # packages and the extra that brings them
    "ply": ("trimesh", "blocks"),
    "stl": ("trimesh", "blocks"),
    "glb": ("trimesh", "blocks"),
    "3mf": ("trimesh lxml", "cad"),
    "3dm": ("rhino3dm", "cad"),
}
_UNIT_NAMES = {"millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "in", "foot": "ft"}


def known_unit(name: str, source: str) -> str:
    """Return the unit of length, one of `UNITS`, that a file names: millimeter, inches, feet."""
    plain = {"inches": "inch", "feet": "foot"}.get(name.lower(), name.lower().removesuffix("s"))
    if plain not in _UNIT_NAMES:
        raise SceneError(f"{source}: its unit is {name}; save it in one of {', '.join(UNITS)}")
    return _UNIT_NAMES[plain]


def require_readers(form: str, source: str) -> None:
    """Raise if what reads a format is not installed."""
    packages, extra = _NEEDS[form]
    missing = [name for name in packages.split() if find_spec(name) is None]
    if missing:
        raise FileError(
            f"{source}: reading {form} needs {missing[0]}; pip install 'seqopt[{extra}]'"
        )


def read_obj(text: str, source: str) -> Content:
    """Return the blocks of a Wavefront OBJ file, named as objects, or groups if they are more."""
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    named = {"o": "", "g": ""}
    names: dict[str, list[str]] = {"o": [], "g": []}
    for i, line in enumerate(text.splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if words and words[0] == "v":
            vertices.append(_numbers(f"{source}, line {i}", words[1:4]))
        elif words and words[0] == "f":
            face = [_place(f"{source}, line {i}", w, len(vertices)) for w in words[1:]]
            if len(face) < 3:
                raise SceneError(f"{source}, line {i}: a face has three vertices or more")
            faces.append(face)
            for kind, name in named.items():
                names[kind].append(name)
        elif words and words[0] in named:
            named[words[0]] = " ".join(words[1:])
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    return mesh_content(points, faces, source, max(names.values(), key=lambda own: len(set(own))))


def read_off(text: str, source: str) -> Content:
    """Return the blocks of an OFF file."""
    rows = [words for line in text.splitlines() if (words := line.split("#", 1)[0].split())]
    if not rows or rows[0][0] != "OFF":
        raise SceneError(f"{source}: no off file that can be read; its first word is OFF")
    rows[0] = rows[0][1:]
    counts, *rows = [words for words in rows if words] or [[]]
    try:
        corners, sides = (int(word) for word in counts[:2])
    except ValueError:
        raise SceneError(f"{source}: its counts are {short(' '.join(counts))}") from None
    if not 0 <= corners <= corners + max(sides, 0) <= len(rows):
        raise SceneError(f"{source}: {len(rows)} lines where {corners} + {sides} are announced")
    points = [_numbers(f"{source}, vertex {i}", row[:3]) for i, row in enumerate(rows[:corners])]
    faces = [
        _polygon(f"{source}, face {i}", row, corners)
        for i, row in enumerate(rows[corners : corners + sides])
    ]
    return mesh_content(np.array(points, dtype=float).reshape(-1, 3), faces, source)


def _polygon(where: str, row: list[str], count: int) -> list[int]:
    """Return the places of the vertices of a face: how many, these, and perhaps a color."""
    try:
        size, *named = (int(word) for word in row[: 1 + int(row[0])])
    except ValueError:
        size, named = 0, []
    if not 3 <= size == len(named) or not 0 <= min(named) <= max(named) < count:
        raise SceneError(
            f"{where} is {short(' '.join(row))}; give three vertices of {count} or more"
        )
    return named


def read_mesh(content: bytes, source: str, form: str) -> Content:
    """Return the blocks of a ``ply`` or ``stl`` file, for which trimesh is needed."""
    vertices, faces = _arrays(_loaded(content, source, form, "load_mesh"), source)
    if form == "stl":  # it repeats the vertices of every triangle
        vertices, place = np.unique(vertices, axis=0, return_inverse=True)
        faces = place.reshape(-1)[faces]
    return mesh_content(vertices, faces.tolist(), source)


def read_objects(content: bytes, source: str, form: str) -> Content:
    """Return the blocks of a ``glb`` or ``3mf`` file, named as its nodes, each where it stands.

    A GLB is in m, and y is up there, by the definition of glTF; a 3MF says its unit.
    """
    found = _loaded(content, source, form, "load_scene")
    said = object_content(_nodes(found, source), source)
    if form == "glb":
        return replace(said, usual_unit="m", up="y")
    return replace(said, unit=known_unit(str(found.units), source))


def _nodes(scene: Any, source: str) -> Iterator[FileBlock]:
    """Yield the meshes of a scene of trimesh, in the order of their names and numbers."""
    above, world = scene.graph.transforms.parents, scene.graph.base_frame
    for name in sorted(scene.graph.nodes_geometry, key=_counted):
        matrix, own = scene.graph[name]
        if not hasattr(scene.geometry[own], "faces"):
            continue  # lines and points
        vertices, faces = _arrays(scene.geometry[own], source)
        group = "" if above.get(name) in (None, world) else str(above[name])
        yield FileBlock(str(name), moved(vertices, matrix), faces.tolist(), group=group)


def _counted(name: str) -> list[tuple[int, str]]:
    """Return what sorts names by the numbers in them: stone_2 before stone_10."""
    return [(int(part or 0), text) for text, part in re.findall(r"(\D*)(\d*)", name)]


def _arrays(mesh: Any, source: str) -> tuple[Floats, Ints]:
    """Return the vertices (V, 3) and triangles (F, 3) of a mesh of trimesh."""
    vertices = np.asarray(mesh.vertices, dtype=float)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    if not (np.abs(vertices) <= LARGEST).all():
        raise SceneError(f"{source}: a vertex is not finite; give numbers up to {LARGEST:g}")
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise SceneError(f"{source}: a face names a vertex that is not there; {len(vertices)} are")
    return vertices, faces


def _loaded(content: bytes, source: str, form: str, loader: str) -> Any:
    """Return what trimesh makes of bytes; what it logs is for those who asked for logs."""
    require_readers(form, source)
    logging.getLogger("trimesh").addHandler(_UNASKED)
    joined = {"merge_primitives": True} if form == "glb" else {}  # of several materials
    try:
        load = getattr(import_module("trimesh"), loader)
        return load(io.BytesIO(content), file_type=form, process=False, **joined)
    except MemoryError:
        raise
    except Exception as error:  # whatever a reader of broken bytes may raise
        said = short(str(error) or type(error).__name__, 80)
        raise SceneError(f"{source}: no {form} file that can be read: {said}") from error


def _numbers(where: str, words: list[str]) -> list[float]:
    try:
        row = [float(word) for word in words]
    except ValueError:
        row = []
    if len(row) != 3 or not (np.abs(row) <= LARGEST).all():
        raise SceneError(f"{where}: a vertex is {short(' '.join(words))}; give three numbers")
    return row


def _place(where: str, word: str, count: int) -> int:
    """Return which vertex a word names: from 1, or back from the last."""
    try:
        named = int(word.split("/", 1)[0])
    except ValueError:
        named = 0
    place = named - 1 if named > 0 else count + named
    if named == 0 or not 0 <= place < count:
        raise SceneError(f"{where}: there is no vertex {short(word)}; {count} stand before")
    return place
