"""Values of COMPAS as JSON: types, frames, meshes, boxes; written without COMPAS."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from seqopt.arrays import Floats
from seqopt.sequence.exports._grip_frames import Frame

Document = dict[str, Any]
_DIGITS = 9  # of lengths, m, and of axes: a nanometer


def typed(kind: str, data: object, **more: object) -> Document:
    """Return data as COMPAS stores a value of a type; ``more``: what it has beside, as a name."""
    return {"dtype": kind, "data": data, **more}


def compas_frame(frame: Frame | None) -> Document | None:
    """Return a frame; None where there is none."""
    if frame is None:
        return None
    rows = (frame.point, frame.xaxis, frame.yaxis)
    parts = zip(("point", "xaxis", "yaxis"), rows, strict=True)
    data = {name: [round(x, _DIGITS) + 0.0 for x in row] for name, row in parts}
    return typed("compas.geometry/Frame", data)


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
