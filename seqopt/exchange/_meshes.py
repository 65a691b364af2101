"""Blocks of meshes: where one ends and the next begins, names, repair, and OBJ files of them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from seqopt._registry import Later
from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import SceneError
from seqopt.exchange._content import LARGEST, MOST_BLOCKS, MOST_CORNERS, Content, FileBlock
from seqopt.scene._checks import as_vectors, short
from seqopt.scene.boxes import vertices_of
from seqopt.scene.scene import Scene
from seqopt.scene.shape import FLAT, Polyhedron, bend, edges, fans

NX, SPATIAL = Later("networkx"), Later("scipy.spatial")  # 0.3 and 0.2 s, for imports alone
_Polygons = Sequence[Sequence[int]]
_Edges = frozenset[tuple[int, int]]
_Loop = tuple[int, ...]
_LEAST = 4  # faces of a closed block
_NAMED = 5  # things in a line; more are counted
NO_BLOCKS = "points and lines are no blocks: give closed meshes"
_WELD = 1e-6  # distance of vertices that are one, over the size of the block


def _split_blocks(vertices: Floats, faces: _Polygons) -> list[list[int]]:
    """Return the places of the faces of each block of a mesh.

    A block ends where, in the file's order, every edge has been used twice, corners in one place
    being one. If blocks are left open so, one is what shares vertices, where these say it. Faces
    without edges belong to none.
    """
    place = _united(vertices)
    united = [[int(place[v]) for v in face] for face in faces]
    sides = list[_Edges]()
    for face in united:  # without edges that it passes twice
        own = set[tuple[int, int]]()
        for a, b in edges(face):
            own ^= {(min(a, b), max(a, b))} if a != b else set()
        sides.append(frozenset(own))
    part, real = _parts(len(vertices), faces), [i for i, own in enumerate(sides) if own]
    blocks, rest = _closed(real, sides)
    if rest:
        alone = len({v for face in faces for v in face}) == sum(map(len, faces))
        groups = _grouped(real, _parts(len(vertices), united) if alone else part)
        ends = [_closed(group, sides) for group in groups]
        return [block for closed, left in ends for block in [*closed, left] if block]
    out = list[list[int]]()
    for block in blocks:  # in parts that share no vertices, if each is closed too
        groups = _grouped(block, part)
        out += [block] if any(_closed(group, sides)[1] for group in groups) else groups
    return out


def _united(vertices: Floats) -> Ints:
    """Return one number for all vertices in one place."""
    points, place = np.unique(vertices, axis=0, return_inverse=True)
    reach = _WELD * float(np.ptp(points, axis=0).max(initial=0.0))
    pairs = SPATIAL.KDTree(points).query_pairs(reach, output_type="ndarray")
    return _linked(len(points), pairs)[place.reshape(-1)]


def _closed(faces: Iterable[int], sides: Sequence[_Edges]) -> tuple[list[list[int]], list[int]]:
    """Return the blocks that faces close one after the other, and the faces that are left."""
    blocks, block = list[list[int]](), list[int]()
    seen, once = set[_Edges](), set[tuple[int, int]]()
    for i in faces:
        block.append(i)
        once ^= sides[i] if sides[i] not in seen else set()
        seen.add(sides[i])
        if not once and len(seen) >= _LEAST:
            blocks.append(block)
            block, seen = [], set()
    if blocks and {sides[i] for i in block} <= {sides[i] for i in blocks[-1]}:
        blocks[-1] += block
        block = []
    return blocks, block


def _grouped(faces: Iterable[int], part: Ints) -> list[list[int]]:
    """Return faces by the part that they belong to, in their order."""
    out = defaultdict(list)
    for i in faces:
        out[part[i]].append(i)
    return [*out.values()]


def _parts(count: int, faces: _Polygons) -> Ints:
    """Return the number of the part of every face; parts share no vertex."""
    ends = np.array([(face[0], v) for face in faces for v in face[1:]]).reshape(-1, 2)
    return _linked(count, ends)[[face[0] for face in faces]]


def _linked(count: int, links: Ints) -> Ints:
    """Return the number of the group that each of so many things is in, given links."""
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def mesh_content(
    vertices: Floats, faces: _Polygons, source: str, names: Sequence[str] = ()
) -> Content:
    """Return the blocks of a mesh. ``names``: of each face, or none."""
    own = _split_blocks(vertices, faces) if faces else []
    found = [
        FileBlock(names[block[0]] if names else "", *_compact(vertices, [faces[i] for i in block]))
        for block in own
    ]
    return _named(found, source)


def object_content(objects: Iterable[FileBlock], source: str) -> Content:
    """Return the blocks of objects that have a name each; an object may be several blocks."""
    found, corners = list[FileBlock](), 0
    for own in objects:
        corners += sum(map(len, own.faces))
        if corners > MOST_CORNERS or len(found) > MOST_BLOCKS:  # a file may have one many times
            raise SceneError(
                f"{source}: more than {MOST_BLOCKS} blocks, or {MOST_CORNERS} corners of faces; "
                "give fewer"
            )
        sides = [face for face in own.faces if len(face) > 2]
        if any(not 0 <= min(face) <= max(face) < len(own.vertices) for face in sides):
            raise SceneError(
                f"{source}: a face of {short(own.key or 'a mesh')} names a vertex that is not "
                f"there; {len(own.vertices)} are"
            )
        for part in _split_blocks(own.vertices, sides) if sides else []:
            vertices, faces = _compact(own.vertices, [sides[i] for i in part])
            found.append(replace(own, vertices=vertices, faces=faces))
    return _named(found, source)


def _named(blocks: list[FileBlock], source: str) -> Content:
    if not blocks:
        raise SceneError(f"{source}: it has no faces; {NO_BLOCKS}")
    if len(blocks) > MOST_BLOCKS:
        raise SceneError(f"{source}: {len(blocks)} blocks; {MOST_BLOCKS} is the most")
    seen, keys = Counter[str](), list[str]()
    for block in blocks:  # numbered where several have one name; places if some have none
        seen[block.key] += 1
        keys.append(block.key if seen[block.key] == 1 else f"{block.key}-{seen[block.key]}")
    if "" in seen or len({*keys}) < len(keys):
        keys = [*map(str, range(len(keys)))]
    several = [
        f"{count} closed pieces are called {name}: each is a block of its own"
        for name, count in seen.items()
        if count > 1 and name
    ]
    return Content(
        tuple(replace(block, key=key) for block, key in zip(blocks, keys, strict=True)),
        said=("a mesh: no supports, faces or order", *several[:_NAMED]),
    )


def _compact(points: Floats, faces: _Polygons) -> tuple[Floats, tuple[tuple[int, ...], ...]]:
    """Return the points that faces use, and the faces between these."""
    used = sorted({v for face in faces for v in face})
    place = {v: i for i, v in enumerate(used)}
    return points[used], tuple(tuple(place[v] for v in face) for face in faces)


_CUT = "faces that are not flat are cut into triangles"
_WELDED = "vertices in one place are united"
_TWICE = "faces that stand there twice are left out"
_OPEN = "supports are surfaces that are not closed"
_TURNED = "faces are turned so that all agree which side is outside"


@dataclass(frozen=True, eq=False, repr=False)
class Surface(FrozenValue):
    """A surface that is not closed, as of a support; both of its sides are faces."""

    points: Floats  # (V, 3); m
    faces: tuple[tuple[int, ...], ...]  # places among the vertices


@dataclass(frozen=True)
class Repaired:
    """A block whose faces are in order, or a support as a surface, and what was mended how often.

    ``facets``: its faces as the file has them, also those that are not flat: where it touches
    others.
    """

    solid: Polyhedron | Surface
    facets: Surface
    mended: Counter[str]


def repair_shape(block: FileBlock, *, may_be_open: bool = False) -> Repaired:
    """Return a block as a polyhedron, or as a surface if it is not closed and may be."""
    mended: Counter[str] = Counter()
    points, faces = block.vertices, [_plain(face) for face in block.faces]
    size = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    times = Counter(frozenset(edge) for face in faces for edge in edges(face))
    if any(count != 2 for count in times.values()):
        place = _united(points)
        kept, first = np.unique(place, return_index=True)
        if united := len(points) - len(kept):
            mended[_WELDED] += united
        faces = [_plain(tuple(first[place[[*face]]].tolist())) for face in faces]
    single = {frozenset(face): face for face in reversed(faces)}  # of those with the same vertices
    if len(single) < len(faces):
        mended[_TWICE] += len(faces) - len(single)
    faces = [face for face in faces if single.get(frozenset(face)) is face and len(face) > 2]
    faces = _agreeing(points, faces, mended)
    facets = Surface(points, tuple(face for face in faces if bend(points[list(face)]) < np.inf))
    faces = [part for face in faces for part in _flat(points, face, size, mended)]
    corners, named = _compact(points, faces)
    try:
        return Repaired(Polyhedron(as_vectors(corners), named), facets, mended)
    except SceneError as error:
        if may_be_open and faces:
            mended[_OPEN] += 1
            both = Surface(points, (*facets.faces, *(face[::-1] for face in facets.faces)))
            return Repaired(both, both, mended)
        raise SceneError(f"block {block.key}: {error}{_remedy(block.key, faces)}") from error


def _remedy(key: str, faces: Sequence[_Loop]) -> str:
    """Return what to do about faces that bound no solid, as the end of a line."""
    times = Counter(frozenset(edge) for face in faces for edge in edges(face)).values()
    inner = sum(count > 2 for count in times)
    if inner:
        return (
            f"; {inner} of its edges have more than two faces: delete faces inside it, unite "
            "pieces that cut each other"
        )
    return f'; if it is ground, say --supports "{key}"' if 1 in times else ""


def _plain(face: Sequence[int]) -> _Loop:
    """Return a face without vertices that follow themselves."""
    return tuple(v for v, before in zip(face, (*face[-1:], *face[:-1]), strict=True) if v != before)


def _flat(points: Floats, face: _Loop, size: float, mended: Counter[str]) -> list[_Loop]:
    """Return a face, or triangles in its place if it is not flat; none if it has no area."""
    refused = len(set(face)) < len(face)  # by the polyhedron
    if refused or len(face) == 3 or bend(points[list(face)]) <= FLAT * size:
        return [face]
    mended[_CUT] += 1
    if len(face) == 4:
        a, b, c, d = face
        shorter = np.linalg.norm(points[a] - points[c]) <= np.linalg.norm(points[b] - points[d])
        return [(a, b, c), (a, c, d)] if shorter else [(a, b, d), (b, c, d)]
    return [(a, b, c) for a, b, c in fans([face]).tolist()]


def _agreeing(points: Floats, faces: list[_Loop], mended: Counter[str]) -> list[_Loop]:
    """Return faces turned so that they agree which side is outside, and that it is outside."""
    meeting, turned = defaultdict(list), dict[int, bool]()
    for i, face in enumerate(faces):
        for a, b in edges(face):
            meeting[frozenset((a, b))].append((i, a < b))
    beside = NX.empty_graph(len(faces))  # faces that meet in an edge, two alone
    for (i, up), (j, too) in (meet for meet in meeting.values() if len(meet) == 2):
        beside.add_edge(i, j, turns=up == too)
    for start in beside:
        if start not in turned:
            turned[start] = False
            for i, j in NX.bfs_edges(beside, start):
                turned[j] = turned[i] ^ beside[i][j]["turns"]
    out = [face[::-1] if turned[i] else face for i, face in enumerate(faces)]
    spokes = points - points.mean(axis=0)
    if np.linalg.det(spokes[fans(out)]).sum() < 0:  # six times the volume within
        out = [face[::-1] for face in out]
    if changed := sum(face != before for face, before in zip(out, faces, strict=True)):
        mended[_TURNED] += changed
    return out


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
