"""Meshes of blocks: OBJ with its polygons and objects, PLY and STL.

trimesh reads PLY and STL. Of an OBJ it keeps triangles alone, cut as fans, which a face that is not
convex does not survive, and joins all objects; so OBJ has a few lines of its own here.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from seqopt.arrays import Floats, Ints
from seqopt.errors import FileError, SceneError
from seqopt.scene.checks import short
from seqopt.scene.imports.content import MOST_BLOCKS, Content, FileBlock
from seqopt.scene.imports.documents import LARGEST

Faces = list[list[int]]
UNASKED = logging.NullHandler()  # else Python prints what no one listens to


def read_obj(text: str, source: str) -> Content:
    """Return the blocks of a Wavefront OBJ file.

    Parameters
    ----------
    text : str
    source : str
        What to call it in messages.

    Returns
    -------
    Content
        A block for every part that shares no vertex with others.

    Raises
    ------
    SceneError
        If it is no such file.
    """
    vertices: list[list[float]] = []
    faces: Faces = []
    for i, line in enumerate(text.splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if words and words[0] == "v":
            vertices.append(_numbers(f"{source}, line {i}", words[1:4]))
        elif words and words[0] == "f":
            face = [_place(f"{source}, line {i}", w, len(vertices)) for w in words[1:]]
            if len(face) < 3:
                raise SceneError(f"{source}, line {i}: a face has three vertices or more")
            faces.append(face)
    return _content(np.array(vertices, dtype=float).reshape(-1, 3), faces, source)


def read_mesh(content: bytes, source: str, form: str) -> Content:
    """Return the blocks of a PLY or STL file.

    Parameters
    ----------
    content : bytes
    source : str
        What to call it in messages.
    form : str
        ``ply`` or ``stl``.

    Returns
    -------
    Content
        A block for every part that shares no vertex with others.

    Raises
    ------
    FileError
        If trimesh is not installed.
    SceneError
        If it is no such file.
    """
    if find_spec("trimesh") is None:
        raise FileError(f"{source}: reading {form} needs trimesh; pip install 'seqopt[blocks]'")
    vertices, faces = _loaded(content, source, form)
    if not (np.abs(vertices) <= LARGEST).all():
        raise SceneError(f"{source}: a vertex is not finite; give numbers up to {LARGEST:g}")
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise SceneError(f"{source}: a face names a vertex that is not there; {len(vertices)} are")
    if form == "stl":  # it repeats the vertices of every triangle
        vertices, place = np.unique(vertices, axis=0, return_inverse=True)
        faces = place.reshape(-1)[faces]
    return _content(vertices, faces.tolist(), source)


def _loaded(content: bytes, source: str, form: str) -> tuple[Floats, Ints]:
    """Return what trimesh makes of bytes; what it logs is for those who asked for logs."""
    logging.getLogger("trimesh").addHandler(UNASKED)
    try:
        found = import_module("trimesh").load_mesh(
            io.BytesIO(content), file_type=form, process=False
        )
        return np.asarray(found.vertices, dtype=float), np.asarray(found.faces, dtype=np.int64)
    except MemoryError:
        raise
    except Exception as error:  # whatever a reader of broken bytes may raise
        said = short(str(error) or type(error).__name__, 80)
        raise SceneError(f"{source}: no {form} file that can be read: {said}") from error


def _content(vertices: Floats, faces: Faces, source: str) -> Content:
    if not faces:
        raise SceneError(f"{source}: it has no faces; give closed meshes")
    part = _parts(len(vertices), faces)
    used = np.unique([part[face[0]] for face in faces])
    if len(used) > MOST_BLOCKS:
        raise SceneError(f"{source}: {len(used)} blocks; {MOST_BLOCKS} is the most")
    sides: dict[int, Faces] = {int(k): [] for k in used}
    for face in faces:
        sides[int(part[face[0]])].append(face)
    blocks = [_block(str(i), vertices, own) for i, own in enumerate(sides.values())]
    return Content(tuple(blocks), said=("a mesh: no supports, faces or order",))


def _parts(count: int, faces: Faces) -> Ints:
    """Return the number of the part that every vertex belongs to, in the order of the vertices."""
    ends = np.array([(face[0], v) for face in faces for v in face[1:]]).reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def _block(key: str, vertices: Floats, faces: Sequence[Sequence[int]]) -> FileBlock:
    used = sorted({v for face in faces for v in face})
    place = {v: i for i, v in enumerate(used)}
    return FileBlock(key, vertices[used], [[place[v] for v in face] for face in faces])


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
