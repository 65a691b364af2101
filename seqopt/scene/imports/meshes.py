"""Meshes of blocks: OBJ with its polygons and objects, PLY and STL.

trimesh reads PLY and STL. Of an OBJ it keeps triangles alone, cut as fans, which a face that is not
convex does not survive, and joins all objects; so OBJ has a few lines of its own here.
"""

from __future__ import annotations

import io
import logging
from collections import Counter
from collections.abc import Iterable, Sequence
from importlib import import_module
from importlib.util import find_spec

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from seqopt.arrays import Floats, Ints
from seqopt.errors import FileError, SceneError
from seqopt.scene.checks import short
from seqopt.scene.imports.compas_data import LARGEST
from seqopt.scene.imports.content import MOST_BLOCKS, Content, FileBlock
from seqopt.scene.imports.repair import WELD

_Polygons = Sequence[Sequence[int]]
_Edges = frozenset[tuple[int, int]]
_LEAST = 4  # faces of a closed block


def _split_blocks(vertices: Floats, faces: _Polygons) -> list[list[int]]:
    """Return the faces of each block of a mesh.

    A block ends where, in the file's order, every edge has been used twice, corners in one place
    being one: so blocks may share vertices, and faces need not. If blocks are left open so, one is
    what shares vertices, where these say it.

    ``vertices`` (V, 3); ``faces``: places among the vertices. Result: places among the faces.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]])
    >>> up = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> down = [(0, 1, 2), (0, 4, 1), (0, 2, 4), (1, 4, 2)]
    >>> _split_blocks(corners, [*up, *down])
    [[0, 1, 2, 3], [4, 5, 6, 7]]
    """
    place = _united(vertices)
    united = [[int(place[v]) for v in face] for face in faces]
    edges = [_edges(face) for face in united]
    part = _parts(len(vertices), faces)
    blocks, rest = _closed(range(len(faces)), edges)
    if rest:
        alone = len({v for face in faces for v in face}) == sum(map(len, faces))
        groups = _grouped(range(len(faces)), _parts(len(vertices), united) if alone else part)
        ends = [_closed(group, edges) for group in groups]
        return [block for closed, left in ends for block in [*closed, left] if block]
    return _once([own for block in blocks for own in _unmixed(block, edges, part)], edges)


def _united(vertices: Floats) -> Ints:
    """Return one number for all vertices in one place."""
    from scipy.spatial import KDTree  # noqa: PLC0415  # slow to import, and seldom needed

    points, place = np.unique(vertices, axis=0, return_inverse=True)
    reach = WELD * float(np.ptp(points, axis=0).max(initial=0.0))
    pairs = KDTree(points).query_pairs(reach, output_type="ndarray")
    return _linked(len(points), pairs)[place.reshape(-1)]


def _edges(face: Sequence[int]) -> _Edges:
    """Return the edges of a face, without those that it passes twice."""
    out = set[tuple[int, int]]()
    for a, b in zip(face, (*face[1:], face[0]), strict=True):
        out ^= {(min(a, b), max(a, b))} if a != b else set()
    return frozenset(out)


def _closed(faces: Iterable[int], edges: Sequence[_Edges]) -> tuple[list[list[int]], list[int]]:
    """Return the blocks that faces close one after the other, and the faces that are left.

    A face that its block has already counts once.
    """
    blocks, block = list[list[int]](), list[int]()
    seen, once = set[_Edges](), set[tuple[int, int]]()
    for i in faces:
        block.append(i)
        once ^= edges[i] if edges[i] not in seen else set()
        seen.add(edges[i])
        if not once and len(seen) >= _LEAST:
            blocks.append(block)
            block, seen = [], set()
    if blocks and {edges[i] for i in block} <= {edges[i] for i in blocks[-1]}:
        blocks[-1] += block
        block = []
    return blocks, block


def _unmixed(block: list[int], edges: Sequence[_Edges], part: Ints) -> list[list[int]]:
    """Return closed faces, in parts that share no vertices if each is closed too."""
    groups = _grouped(block, part)
    return [block] if any(_closed(group, edges)[1] for group in groups) else groups


def _once(blocks: list[list[int]], edges: Sequence[_Edges]) -> list[list[int]]:
    """Return blocks of which no two have the same faces; what stands there twice is one."""
    found: dict[frozenset[_Edges], list[int]] = {}
    for block in blocks:
        found.setdefault(frozenset(edges[i] for i in block), []).extend(block)
    return [*found.values()]


def _grouped(faces: Iterable[int], part: Ints) -> list[list[int]]:
    """Return faces by the part that they belong to, in their order."""
    out: dict[int, list[int]] = {}
    for i in faces:
        out.setdefault(int(part[i]), []).append(i)
    return [*out.values()]


def _parts(count: int, faces: _Polygons) -> Ints:
    """Return the number of the part of every face; parts share no vertex."""
    ends = np.array([(face[0], v) for face in faces for v in face[1:]]).reshape(-1, 2)
    return _linked(count, ends)[[face[0] for face in faces]]


def _linked(count: int, links: Ints) -> Ints:
    """Return the number of the group that each of so many things is in, given links."""
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


_Faces = list[list[int]]
_UNASKED = logging.NullHandler()  # else Python prints what no one listens to


def read_obj(text: str, source: str) -> Content:
    """Return the blocks of a Wavefront OBJ file.

    Result: its blocks, by the names of objects or groups, whichever are more.
    """
    vertices: list[list[float]] = []
    faces: _Faces = []
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
    return _content(points, faces, source, max(names.values(), key=lambda own: len(set(own))))


def read_mesh(content: bytes, source: str, form: str) -> Content:
    """Return the blocks of a PLY or STL file.

    ``form``: ``ply`` or ``stl``. Raises `FileError` if trimesh is not installed.
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
    logging.getLogger("trimesh").addHandler(_UNASKED)
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


def _content(vertices: Floats, faces: _Faces, source: str, names: Sequence[str] = ()) -> Content:
    if not faces:
        raise SceneError(f"{source}: it has no faces; give closed meshes")
    own = _split_blocks(vertices, faces)
    if len(own) > MOST_BLOCKS:
        raise SceneError(f"{source}: {len(own)} blocks; {MOST_BLOCKS} is the most")
    keys = _keys([names[block[0]] if names else "" for block in own])
    blocks = [
        _block(key, vertices, [faces[i] for i in block])
        for key, block in zip(keys, own, strict=True)
    ]
    return Content(tuple(blocks), said=("a mesh: no supports, faces or order",))


def _keys(names: Sequence[str]) -> list[str]:
    """Return the names of blocks, numbered where several have one; places if some have none."""
    seen = Counter[str]()
    keys = []
    for name in names:
        seen[name] += 1
        keys.append(name if seen[name] == 1 else f"{name}-{seen[name]}")
    return keys if "" not in seen and len(set(keys)) == len(keys) else [*map(str, range(len(keys)))]


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
