"""Files of meshes: OBJ with its polygons, PLY and STL.

trimesh reads PLY and STL. Of an OBJ it keeps triangles alone, cut as fans, which a face that is not
convex does not survive, and it joins all objects; so this has a few lines of its own here.
"""

from __future__ import annotations

import io
import logging
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from seqopt._files import read_bytes
from seqopt.errors import FileError, SceneError
from seqopt.exchange._content import LARGEST, Content
from seqopt.exchange._meshes import mesh_content
from seqopt.scene._checks import short
from seqopt.scene.boxes import vertices_of
from seqopt.scene.scene import Scene

_UNASKED = logging.NullHandler()  # else Python prints unhandled errors


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


def write_obj(scene: Scene) -> str:
    """Return bricks as a mesh each, in m: objects of an OBJ file, called as the bricks are."""
    lines, first = list[str](), 1
    for brick in scene.bricks:
        points, faces = vertices_of(brick)
        lines.append(f"o {brick.name}")
        lines += ["v " + " ".join(map(repr, row)) for row in np.asarray(points).tolist()]
        lines += ["f " + " ".join(str(first + i) for i in face) for face in faces]
        first += len(points)
    return "\n".join(lines) + "\n"


def read_mesh(path: Path, form: str) -> Content:
    """Return the blocks of a ``ply`` or ``stl`` file; what trimesh logs is for who asked for it."""
    content, source = read_bytes(path), str(path)
    if find_spec("trimesh") is None:
        raise FileError(f"{source}: reading {form} needs trimesh; pip install 'seqopt[blocks]'")
    logging.getLogger("trimesh").addHandler(_UNASKED)
    try:
        mesh = import_module("trimesh").load_mesh(
            io.BytesIO(content), file_type=form, process=False
        )
        vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    except MemoryError:
        raise
    except Exception as error:  # a reader of broken bytes may raise any error
        said = short(str(error) or type(error).__name__, 80)
        raise SceneError(f"{source}: no {form} file that can be read: {said}") from error
    if not (np.abs(vertices) <= LARGEST).all():
        raise SceneError(f"{source}: a vertex is not finite; give numbers up to {LARGEST:g}")
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise SceneError(f"{source}: a face names a vertex that is not there; {len(vertices)} are")
    if form == "stl":  # it repeats the vertices of every triangle
        vertices, place = np.unique(vertices, axis=0, return_inverse=True)
        faces = place.reshape(-1)[faces]
    return mesh_content(vertices, faces.tolist(), source)
