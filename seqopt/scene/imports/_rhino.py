"""Files of Rhino: closed meshes, extrusions and polysurfaces, with their names and layers.

rhino3dm does not mesh. A polysurface whose faces are flat between straight edges is read face by
face, as it is; for others the file must hold the mesh with which Rhino last rendered it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene._checks import short
from seqopt.scene.imports._content import LARGEST, Content, FileBlock, moved
from seqopt.scene.imports._mesh_files import known_unit, require_readers
from seqopt.scene.imports._meshes import object_content

_DEEPEST = 20  # blocks of Rhino within each other
_SAME = 1e-4  # by how much faces and edges may bend, over the size; Rhino joins what is off by less
_Solid = tuple[Floats, list[Sequence[int]]]


def read_3dm(content: bytes, source: str) -> Content:
    """Return the closed objects that are visible in a file of Rhino."""
    require_readers("3dm", source)
    file = import_module("rhino3dm").File3dm.FromByteArray(content)
    if file is None:
        raise SceneError(f"{source}: no 3dm file that can be read")
    unit = str(file.Settings.ModelUnitSystem).rsplit(".", 1)[-1]
    left = Counter[str]()
    solids = [*_objects(file, source, left)]
    said = [f"{count} objects are left out: {what}" for what, count in left.items()]
    if not solids:
        why = "; ".join(said) or "it is empty"
        raise SceneError(f"{source}: no closed mesh or solid is visible; {why}")
    found = object_content(solids, source)
    return replace(
        found,
        unit=None if unit in ("None", "Unset") else known_unit(unit, source),
        said=(*found.said, *said),
    )


def _objects(file: Any, source: str, left: Counter[str]) -> Iterator[FileBlock]:
    """Yield the solids of a file under their names, or those of their layers where they have none.

    ``left``: gets what is left out, and how often.
    """
    layers = {layer.Index: layer for layer in file.Layers}
    for item in file.Objects:
        own = item.Attributes
        layer = layers.get(own.LayerIndex)
        if own.IsInstanceDefinitionObject:
            continue
        if not own.Visible or (layer is not None and not layer.Visible):
            left["hidden"] += 1
            continue
        group = "" if layer is None else layer.FullPath or layer.Name
        name = own.Name or group or "object"
        where = f"{source}: object {short(own.Name or str(own.Id))}"
        for vertices, faces in _solids(file, item.Geometry, where, left):
            yield FileBlock(name, vertices, faces, group=group)


def _solids(
    file: Any, shape: Any, where: str, left: Counter[str], depth: int = 0
) -> Iterator[_Solid]:
    """Yield the vertices and faces of an object; of a block of Rhino, those of all its objects."""
    kind = type(shape).__name__
    if kind in _READERS:
        yield _READERS[kind](where, shape)
    elif kind == "SubD":
        raise SceneError(f"{where} is a SubD; turn it into a mesh, or hide it")
    elif kind != "InstanceReference":
        left["curves, points, text"] += 1
    elif depth == _DEEPEST:
        raise SceneError(f"{where}: blocks stand in blocks {_DEEPEST} deep; explode some")
    else:
        matrix = np.reshape(shape.Xform.ToFloatArray(True), (4, 4))  # noqa: FBT003  # by row
        for inner in _inside(file, shape):
            for vertices, faces in _solids(file, inner, where, left, depth + 1):
                yield moved(vertices, matrix), faces


def _inside(file: Any, block: Any) -> list[Any]:
    """Return the objects of which a block of Rhino is made."""
    definition = file.InstanceDefinitions.FindId(block.ParentIdefId)
    keys = () if definition is None else definition.GetObjectIds()
    found = (file.Objects.FindId(str(key)) for key in keys)
    return [item.Geometry for item in found if item is not None]


def _extrusion(where: str, shape: Any) -> _Solid:
    """Return an extrusion; if it is round, its mesh is its own and not that of its faces."""
    solid = shape.ToBrep(True)  # noqa: FBT003  # in faces without kinks
    mesh = shape.GetMesh(import_module("rhino3dm").MeshType.Any)
    flat = None if solid is None or not solid.IsSolid else _flat(where, solid)
    if flat is None and mesh is not None:
        return _joined(where, [mesh])
    return _polysurface(where, solid) if flat is None else flat


def _polysurface(where: str, solid: Any) -> _Solid:
    """Return a closed polysurface: its own faces if these are flat, else its render mesh."""
    if not solid.IsSolid:
        raise SceneError(f"{where} is an open surface; close it (Cap), or hide it")
    flat = _flat(where, solid)
    if flat is not None:
        return flat
    every = import_module("rhino3dm").MeshType.Any
    meshes = [solid.Faces[i].GetMesh(every) for i in range(len(solid.Faces))]
    if any(mesh is None for mesh in meshes):
        raise SceneError(
            f"{where} has faces that are curved or have holes, and the file no mesh of it; in "
            "Rhino, turn it into a mesh (Mesh), or shade it and save with render meshes"
        )
    return _joined(where, meshes)


def _flat(where: str, solid: Any) -> _Solid | None:
    """Return the faces of a polysurface; None unless they are flat between straight edges."""
    corners = [solid.Vertices[i].Location for i in range(len(solid.Vertices))]
    points = _points(where, corners)
    near = _SAME * float(np.ptp(points, axis=0).max(initial=0.0))
    straight = [solid.Edges[i].IsLinear(near) for i in range(len(solid.Edges))]
    faces: list[Sequence[int]] = []
    for i in range(len(solid.Faces)):
        face = solid.Faces[i]
        loop = face.OuterLoop
        trims = [loop.Trims[k] for k in range(loop.TrimCount)]
        bent = any(trim.EdgeIndex < 0 or not straight[trim.EdgeIndex] for trim in trims)
        if bent or len(face.Loops) != 1 or not face.IsPlanar(near):
            return None
        around = [trim.StartVertexIndex for trim in trims]
        faces.append(around[::-1] if face.OrientationIsReversed else around)
    return points, faces


def _joined(where: str, meshes: Sequence[Any]) -> _Solid:
    """Return meshes as one; a triangle of Rhino names its last corner twice."""
    rows: list[Any] = []
    faces: list[Sequence[int]] = []
    for mesh in meshes:
        sides = (mesh.Faces[i] for i in range(len(mesh.Faces)))
        faces += [[len(rows) + v for v in dict.fromkeys(side)] for side in sides]
        rows += [mesh.Vertices[i] for i in range(len(mesh.Vertices))]
    return _points(where, rows), faces


def _points(where: str, rows: Sequence[Any]) -> Floats:
    found = np.array([(row.X, row.Y, row.Z) for row in rows], dtype=float).reshape(-1, 3)
    if not (np.abs(found) <= LARGEST).all():
        raise SceneError(f"{where}: a vertex is not finite; give numbers up to {LARGEST:g}")
    return found


def _mesh(where: str, shape: Any) -> _Solid:
    return _joined(where, [shape])


_READERS: dict[str, Callable[[str, Any], _Solid]] = {
    "Mesh": _mesh,
    "Extrusion": _extrusion,
    "Brep": _polysurface,
}
