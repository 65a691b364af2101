"""Meshes as closed polyhedra: repaired where possible, with a note of every repair."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.boxes import as_vectors
from seqopt.scene.imports.content import FileBlock
from seqopt.scene.imports.detection import Surface
from seqopt.scene.shape import FLAT, Polyhedron, bend

WELD = 1e-6  # distance of vertices that are one, over the size of the block
_Face = tuple[int, ...]

_CUT = "faces that are not flat are cut into triangles"
_WELDED = "vertices in one place are united"
_TWICE = "faces that stand there twice are left out"
_OPEN = "supports are surfaces that are not closed"
_TURNED = "faces are turned so that all agree which side is outside"


@dataclass(frozen=True)
class Repaired:
    """A block whose faces are in order.

    ``solid``: a surface where a support is not closed; ``facets``: its faces as the file has them,
    also those that are not flat: where it touches others; ``mended``: what was done, and to how
    many faces or vertices.
    """

    solid: Polyhedron | Surface
    facets: Surface
    mended: Counter[str]


def repair_shape(block: FileBlock, *, may_be_open: bool = False) -> Repaired:
    """Return a block as a polyhedron, or a support that is not closed as a surface.

    ``block``: in m; ``may_be_open``: whether it is a support, of which the surface alone counts.
    """
    mended: Counter[str] = Counter()
    points, faces = block.vertices, [_plain(face) for face in block.faces]
    size = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    if _open_edges(faces):
        points, faces = _welded(points, faces, WELD * size, mended)
    faces = [face for face in _once(faces, mended) if len(face) > 2]
    faces = _agreeing(points, faces, mended)
    facets = Surface(points, tuple(face for face in faces if bend(points[list(face)]) < np.inf))
    faces = [part for face in faces for part in _flat(points, face, size, mended)]
    used = sorted({v for face in faces for v in face})
    place = {v: i for i, v in enumerate(used)}
    try:
        named = tuple(tuple(place[v] for v in face) for face in faces)
        return Repaired(Polyhedron(as_vectors(points[used]), named), facets, mended)
    except SceneError as error:
        if may_be_open and faces:
            mended[_OPEN] += 1
            both = Surface(points, (*facets.faces, *(face[::-1] for face in facets.faces)))
            return Repaired(both, both, mended)
        raise SceneError(f"block {block.key}: {error}") from error


def _plain(face: Sequence[int]) -> _Face:
    """Return a face without vertices that follow themselves."""
    return tuple(v for v, before in zip(face, (*face[-1:], *face[:-1]), strict=True) if v != before)


def _once(faces: list[_Face], mended: Counter[str]) -> list[_Face]:
    """Return faces of which no two have the same vertices."""
    found = {frozenset(face): face for face in reversed(faces)}
    if len(found) < len(faces):
        mended[_TWICE] += len(faces) - len(found)
    return [face for face in faces if found.get(frozenset(face)) is face]


def _open_edges(faces: Sequence[_Face]) -> bool:
    return any(times != 2 for times in _edges(faces).values())


def _edges(faces: Sequence[_Face]) -> Counter[frozenset[int]]:
    return Counter(
        frozenset((a, b))
        for face in faces
        for a, b in zip(face, (*face[1:], *face[:1]), strict=True)
    )


def _welded(
    points: Floats, faces: list[_Face], reach: float, mended: Counter[str]
) -> tuple[Floats, list[_Face]]:
    """Return points, those in one place united, and the faces between them."""
    from scipy.spatial import KDTree  # noqa: PLC0415  # slow to import, and seldom needed

    first = np.arange(len(points))
    for a, b in sorted(KDTree(points).query_pairs(reach)) if len(points) and reach > 0 else ():
        first[b] = min(first[b], first[a])
    united = int((first != np.arange(len(points))).sum())
    if united:
        mended[_WELDED] += united
    return points, [_plain(tuple(int(first[v]) for v in face)) for face in faces]


def _flat(points: Floats, face: _Face, size: float, mended: Counter[str]) -> list[_Face]:
    """Return a face, or triangles in its place if it is not flat; none if it has no area."""
    if len(set(face)) < len(face):
        return [face]  # the polyhedron refuses it
    off = bend(points[list(face)])
    if off <= FLAT * size:
        return [face]
    if len(face) == 3:
        return [face]
    mended[_CUT] += 1
    if len(face) == 4:
        a, b, c, d = face
        shorter = np.linalg.norm(points[a] - points[c]) <= np.linalg.norm(points[b] - points[d])
        return [(a, b, c), (a, c, d)] if shorter else [(a, b, d), (b, c, d)]
    return [(face[0], face[k], face[k + 1]) for k in range(1, len(face) - 1)]


def _agreeing(points: Floats, faces: list[_Face], mended: Counter[str]) -> list[_Face]:
    """Return faces turned so that they agree which side is outside, and that it is outside."""
    beside = defaultdict(list)
    for i, face in enumerate(faces):
        for a, b in zip(face, (*face[1:], face[0]), strict=True):
            beside[frozenset((a, b))].append((i, a < b))
    turned: dict[int, bool] = {}
    for start in range(len(faces)):
        if start not in turned:
            turned[start] = False
            _spread(start, faces, beside, turned)
    out = [face[::-1] if turned[i] else face for i, face in enumerate(faces)]
    if _volume(points, out) < 0:
        out = [face[::-1] for face in out]
    changed = sum(face != before for face, before in zip(out, faces, strict=True))
    if changed:
        mended[_TURNED] += changed
    return out


def _spread(
    start: int,
    faces: list[_Face],
    beside: dict[frozenset[int], list[tuple[int, bool]]],
    turned: dict[int, bool],
) -> None:
    """Note which faces must be turned to agree with one, neighbor by neighbor."""
    waiting = [start]
    while waiting:
        i = waiting.pop()
        face = faces[i]
        for a, b in zip(face, (*face[1:], face[0]), strict=True):
            meet = beside[frozenset((a, b))]
            for j, up in meet if len(meet) == 2 else ():
                if j not in turned:
                    turned[j] = turned[i] ^ (up == (a < b))
                    waiting.append(j)


def _volume(points: Floats, faces: list[_Face]) -> float:
    """Return six times the signed volume within faces."""
    spokes = points - points.mean(axis=0)
    fans = [(f[0], f[k], f[k + 1]) for f in faces for k in range(1, len(f) - 1)]
    return float(np.linalg.det(spokes[np.array(fans, dtype=np.int64).reshape(-1, 3)]).sum())
