"""Shapes, frames and transformations of COMPAS: read as arrays, and written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.exchange._content import Entry, entry, listing, mapping, number, point
from seqopt.exchange._grip_frames import Frame
from seqopt.scene._checks import short
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES

_PLAIN = 1e-9  # by how much rounding may change the last row of a transformation
_DIGITS = 9  # of lengths, m, and of axes that are written: a nanometer
Document = dict[str, Any]
_Solid = tuple[Floats, list[list[int]]]


def payload(value: Any) -> Any:
    """Return what an object holds, under whichever key its version uses; itself if it is bare."""
    for _ in range(4):
        if isinstance(value, dict):
            inner = value.get("data", value.get("value"))
            value = inner if isinstance(inner, dict | list) else value
    return value


def held_by(where: str, value: Any) -> Entry:
    """Return what a serialized object holds, which is an object too."""
    return mapping(where, payload(value))


def kind(value: Any) -> str:
    """Return the last part of what an object says that it is, in small letters; empty if none."""
    name = value.get("dtype") if isinstance(value, dict) else None
    return name.rsplit("/", 1)[-1].lower() if isinstance(name, str) else ""


def solid_of(where: str, value: Any) -> _Solid:
    """Return the vertices (V, 3) and faces of a mesh, a polyhedron or a box.

    Vertices and faces of a mesh have keys.
    """
    held = payload(value)
    if isinstance(held, dict) and {"xsize", "ysize", "zsize"} <= set(held):
        size = [number(f"{where}: {key}", held[key]) for key in ("xsize", "ysize", "zsize")]
        origin, axes = frame_of(where, held.get("frame"))
        return origin + 0.5 * (BOX_CORNERS * size) @ axes, [list(face) for face in BOX_FACES]
    if isinstance(held, dict) and "vertices" in held:
        rows = [point(f"{where}: a vertex", row) for row in listing(where, held["vertices"])]
        sides = listing(where, entry(where, held, "faces"))
        return np.array(rows).reshape(-1, 3), [_corners(where, side, None) for side in sides]
    vertex = mapping(f"{where}: vertex", entry(where, held, "vertex"))
    face = mapping(f"{where}: face", entry(where, held, "face"))
    place = {key: i for i, key in enumerate(vertex)}
    xyz = [
        [number(f"{where}: vertex {key}", mapping(where, v).get(axis, 0.0)) for axis in "xyz"]
        for key, v in vertex.items()
    ]
    return np.array(xyz).reshape(-1, 3), [
        _corners(f"{where}: face {key}", side, place) for key, side in face.items()
    ]


def _corners(where: str, side: Any, place: dict[str, int] | None) -> list[int]:
    """Return the places of a face's vertices; a vertex that closes the circle is left out."""
    keys = listing(where, side)
    out = []
    for key in keys:
        named = place.get(str(key)) if place is not None else key
        if not isinstance(named, int) or isinstance(named, bool):
            raise SceneError(f"{where}: there is no vertex {short(key)}")
        out.append(named)
    return out[:-1] if len(out) > 1 and out[0] == out[-1] else out


def frame_of(where: str, value: Any) -> tuple[Floats, Floats]:
    """Return the origin (3,) and the axes (3, 3), as rows, of a frame; the world's if None."""
    if value is None:
        return np.zeros(3), np.eye(3)
    held = payload(value)
    origin, first, second = (
        point(f"{where}: {key}", entry(where, held, key)) for key in ("point", "xaxis", "yaxis")
    )
    third = np.cross(first, second)
    sizes = [float(np.linalg.norm(axis)) for axis in (first, third)]
    if not min(sizes) > 0:
        raise SceneError(f"{where}: xaxis and yaxis span no plane")
    first, third = first / sizes[0], third / sizes[1]
    return origin, np.stack([first, np.cross(third, first), third])


def transformation_of(where: str, value: Any) -> Floats:
    """Return a transformation (4, 4): with a ``matrix``, or a matrix; none if None."""
    if value is None:
        return np.eye(4)
    held = payload(value)
    rows = listing(where, held.get("matrix", held) if isinstance(held, dict) else held)
    matrix = [[number(where, x) for x in listing(where, row)] for row in rows]
    if [len(row) for row in matrix] != [4] * 4:
        raise SceneError(f"{where} is {short(value)}; a matrix of four by four is expected")
    if not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0), rtol=0.0, atol=_PLAIN):
        raise SceneError(f"{where} ends in {matrix[3]}; give a matrix that ends in 0, 0, 0, 1")
    return np.array(matrix)


def compas_frame(frame: Frame | None) -> Document | None:
    """Return a frame; None where there is none."""
    if frame is None:
        return None
    rows = {"point": frame.point, "xaxis": frame.xaxis, "yaxis": frame.yaxis}
    data = {name: [round(x, _DIGITS) + 0.0 for x in row] for name, row in rows.items()}
    return {"dtype": "compas.geometry/Frame", "data": data}


def mesh_data(points: Floats, faces: Sequence[Iterable[int]]) -> Document:
    """Return what a mesh of COMPAS holds."""
    rows = points.tolist()
    return {
        "attributes": {},
        "default_vertex_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
        "default_edge_attributes": {},
        "default_face_attributes": {},
        "vertex": {str(i): dict(zip("xyz", row, strict=True)) for i, row in enumerate(rows)},
        "face": {str(i): list(face) for i, face in enumerate(faces)},
        "facedata": {},
        "edgedata": {},
        "max_vertex": len(rows) - 1,
        "max_face": len(faces) - 1,
    }
