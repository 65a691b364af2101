"""Blocks of a mesh: where its faces close, in the file's order, and what shares vertices."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from seqopt.arrays import Floats, Ints
from seqopt.scene.imports.tidying import WELD

Faces = Sequence[Sequence[int]]
Edges = frozenset[tuple[int, int]]
LEAST = 4  # faces of a closed block


def split_blocks(vertices: Floats, faces: Faces) -> list[list[int]]:
    """Return the faces of each block of a mesh.

    A block ends where, in the file's order, every edge has been used twice, corners in one place
    being one: so blocks may share vertices, and faces need not. If blocks are left open so, one is
    what shares vertices, where these say it.

    Parameters
    ----------
    vertices : (V, 3) float
    faces : sequence of sequence of int
        Places among the vertices.

    Returns
    -------
    list of list of int
        Places among the faces.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]])
    >>> up = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> down = [(0, 1, 2), (0, 4, 1), (0, 2, 4), (1, 4, 2)]
    >>> split_blocks(corners, [*up, *down])
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


def _edges(face: Sequence[int]) -> Edges:
    """Return the edges of a face, without those that it passes twice."""
    out = set[tuple[int, int]]()
    for a, b in zip(face, (*face[1:], face[0]), strict=True):
        out ^= {(min(a, b), max(a, b))} if a != b else set()
    return frozenset(out)


def _closed(faces: Iterable[int], edges: Sequence[Edges]) -> tuple[list[list[int]], list[int]]:
    """Return the blocks that faces close one after the other, and the faces that are left.

    A face that its block has already counts once.
    """
    blocks, block = list[list[int]](), list[int]()
    seen, once = set[Edges](), set[tuple[int, int]]()
    for i in faces:
        block.append(i)
        once ^= edges[i] if edges[i] not in seen else set()
        seen.add(edges[i])
        if not once and len(seen) >= LEAST:
            blocks.append(block)
            block, seen = [], set()
    if blocks and {edges[i] for i in block} <= {edges[i] for i in blocks[-1]}:
        blocks[-1] += block
        block = []
    return blocks, block


def _unmixed(block: list[int], edges: Sequence[Edges], part: Ints) -> list[list[int]]:
    """Return closed faces, in parts that share no vertices if each is closed too."""
    groups = _grouped(block, part)
    return [block] if any(_closed(group, edges)[1] for group in groups) else groups


def _once(blocks: list[list[int]], edges: Sequence[Edges]) -> list[list[int]]:
    """Return blocks of which no two have the same faces; what stands there twice is one."""
    found: dict[frozenset[Edges], list[int]] = {}
    for block in blocks:
        found.setdefault(frozenset(edges[i] for i in block), []).extend(block)
    return [*found.values()]


def _grouped(faces: Iterable[int], part: Ints) -> list[list[int]]:
    """Return faces by the part that they belong to, in their order."""
    out: dict[int, list[int]] = {}
    for i in faces:
        out.setdefault(int(part[i]), []).append(i)
    return [*out.values()]


def _parts(count: int, faces: Faces) -> Ints:
    """Return the number of the part of every face; parts share no vertex."""
    ends = np.array([(face[0], v) for face in faces for v in face[1:]]).reshape(-1, 2)
    return _linked(count, ends)[[face[0] for face in faces]]


def _linked(count: int, links: Ints) -> Ints:
    """Return the number of the group that each of so many things is in, given links."""
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
