"""Files of meshes: OBJ with its polygons; PLY, STL and GLB; Rhino.

trimesh reads PLY, STL and GLB. Of an OBJ it keeps triangles alone, cut as fans, which a face that
is not convex does not survive, and it joins all objects; so this has a few lines of its own here.
rhino3dm does not mesh: polysurfaces are read face by face, and their faces must be flat.
"""

from __future__ import annotations

import io
import logging
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import parse_json, read_bytes
from seqopt.arrays import Floats, Ints
from seqopt.errors import FileError, SceneError
from seqopt.exchange._content import LARGEST, UNITS, Content, FileBlock, moved
from seqopt.exchange._meshes import mesh_content, object_content
from seqopt.scene._checks import short
from seqopt.scene.boxes import vertices_of
from seqopt.scene.scene import Scene

_UNASKED = logging.NullHandler()  # else Python prints unhandled errors
_NEEDS = {  # packages and the extra that brings them
    "ply": ("trimesh", "blocks"),
    "stl": ("trimesh", "blocks"),
    "glb": ("trimesh", "blocks"),
    "3dm": ("rhino3dm", "cad"),
}
_UNIT_NAMES = {"millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "in", "foot": "ft"}


def require_reader(form: str, source: str) -> None:
    """Raise if the package that reads a format is not installed."""
    package, extra = _NEEDS[form]
    if find_spec(package) is None:
        raise FileError(f"{source}: reading {form} needs {package}; pip install 'seqopt[{extra}]'")


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
    """Return the blocks of a ``ply`` or ``stl`` file, for which trimesh is needed."""
    source = str(path)
    vertices, faces = _arrays(_loaded(path, form, "load_mesh"), source)
    if form == "stl":  # it repeats the vertices of every triangle
        vertices, place = np.unique(vertices, axis=0, return_inverse=True)
        faces = place.reshape(-1)[faces]
    return mesh_content(vertices, faces.tolist(), source)


def read_glb(path: Path) -> Content:
    """Return the blocks of a ``glb`` file, named as its nodes, each where it stands.

    It is in m, and y is up there, by the definition of glTF.
    """
    source, found = str(path), _loaded(path, "glb", "load_scene")
    return replace(object_content(_nodes(found, source), source), usual_unit="m", up="y")


def _nodes(scene: Any, source: str) -> Iterator[FileBlock]:
    """Yield the meshes of a scene of trimesh, in the order of their names and numbers."""
    above, world = scene.graph.transforms.parents, scene.graph.base_frame

    def counted(name: str) -> list[tuple[int, str]]:  # stone_2 before stone_10
        return [(int(part or 0), text) for text, part in re.findall(r"(\D*)(\d*)", name)]

    for name in sorted(scene.graph.nodes_geometry, key=counted):
        matrix, own = scene.graph[name]
        if not hasattr(scene.geometry[own], "faces"):
            continue  # lines and points
        vertices, faces = _arrays(scene.geometry[own], source)
        group = "" if above.get(name) in (None, world) else str(above[name])
        yield FileBlock(str(name), moved(vertices, matrix), faces.tolist(), group=group)


def _arrays(mesh: Any, source: str) -> tuple[Floats, Ints]:
    """Return the vertices (V, 3) and triangles (F, 3) of a mesh of trimesh."""
    vertices = np.asarray(mesh.vertices, dtype=float)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    if not (np.abs(vertices) <= LARGEST).all():
        raise SceneError(f"{source}: a vertex is not finite; give numbers up to {LARGEST:g}")
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise SceneError(f"{source}: a face names a vertex that is not there; {len(vertices)} are")
    return vertices, faces


def _loaded(path: Path, form: str, loader: str) -> Any:
    """Return what trimesh makes of a file; what it logs is for those who asked for logs."""
    content, source = read_bytes(path), str(path)
    require_reader(form, source)
    logging.getLogger("trimesh").addHandler(_UNASKED)
    joined = {"merge_primitives": True} if form == "glb" else {}  # of several materials
    try:
        content = _counted_glb(content) if form == "glb" else content
        load = getattr(import_module("trimesh"), loader)
        return load(io.BytesIO(content), file_type=form, process=False, **joined)
    except MemoryError:
        raise
    except Exception as error:  # a reader of broken bytes may raise any error
        said = short(str(error) or type(error).__name__, 80)
        raise SceneError(f"{source}: no {form} file that can be read: {said}") from error


def _counted_glb(content: bytes) -> bytes:
    """Return a GLB whose arrays have no more numbers than it has bytes.

    One without numbers of its own is all zeros, as many as it says.
    """
    length = int.from_bytes(content[12:16], "little")
    text = content[20 : 20 + length].decode("utf-8", "replace")
    document = parse_json(text, "its text")
    arrays = document.get("accessors", ()) if isinstance(document, dict) else ()
    counts = [each.get("count", 0) if isinstance(each, dict) else 0 for each in arrays]
    numbers = [count for count in counts if isinstance(count, int | float)]
    if not sum(numbers) <= len(content):
        raise FileError(f"it counts {sum(numbers):g} points or corners, and has none")
    return content


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


_DEEPEST = 20  # blocks of Rhino within each other
_SAME = 1e-4  # by how much faces and edges may bend, over the size; Rhino joins what is off by less
_Solid = tuple[Floats, list[Sequence[int]]]


def read_3dm(path: Path) -> Content:
    """Return the closed objects that are visible in a file of Rhino."""
    content, source = read_bytes(path), str(path)
    require_reader("3dm", source)
    file = import_module("rhino3dm").File3dm.FromByteArray(content)
    if file is None:
        raise SceneError(f"{source}: no 3dm file that can be read")
    named = str(file.Settings.ModelUnitSystem).rsplit(".", 1)[-1]  # as inches, feet
    plain = {"inches": "inch", "feet": "foot"}.get(named.lower(), named.lower().removesuffix("s"))
    unit = _UNIT_NAMES.get(plain)
    if unit is None and named not in ("None", "Unset"):
        raise SceneError(f"{source}: its unit is {named}; save it in one of {', '.join(UNITS)}")
    left = Counter[str]()
    solids = [*_objects(file, source, left)]
    said = [f"{count} objects are left out: {what}" for what, count in left.items()]
    if not solids:
        why = "; ".join(said) or "it is empty"
        raise SceneError(f"{source}: no closed mesh or solid is visible; {why}")
    found = object_content(solids, source)
    return replace(found, unit=unit, said=(*found.said, *said))


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
        definition = file.InstanceDefinitions.FindId(shape.ParentIdefId)
        keys = () if definition is None else definition.GetObjectIds()
        found = (file.Objects.FindId(str(key)) for key in keys)
        for inner in [item.Geometry for item in found if item is not None]:
            for vertices, faces in _solids(file, inner, where, left, depth + 1):
                yield moved(vertices, matrix), faces


def _polysurface(where: str, solid: Any) -> _Solid:
    """Return a closed polysurface by its own faces, if these are flat."""
    if solid is None or not solid.IsSolid:
        raise SceneError(f"{where} is an open surface; close it (Cap), or hide it")
    flat = _flat(where, solid)
    if flat is None:
        raise SceneError(
            f"{where} has faces that are curved or have holes; in Rhino, turn it into a mesh (Mesh)"
        )
    return flat


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


def _points(where: str, rows: Sequence[Any]) -> Floats:
    found = np.array([(row.X, row.Y, row.Z) for row in rows], dtype=float).reshape(-1, 3)
    if not (np.abs(found) <= LARGEST).all():
        raise SceneError(f"{where}: a vertex is not finite; give numbers up to {LARGEST:g}")
    return found


_READERS: dict[str, Callable[[str, Any], _Solid]] = {
    "Mesh": lambda where, shape: (
        _points(where, [shape.Vertices[i] for i in range(len(shape.Vertices))]),
        # a triangle of Rhino names its last corner twice
        [[*dict.fromkeys(shape.Faces[i])] for i in range(len(shape.Faces))],
    ),
    "Extrusion": lambda where, shape: _polysurface(where, shape.ToBrep(True)),  # noqa: FBT003  # in faces without kinks
    "Brep": _polysurface,
}
