"""File formats of other programs, how they are recognized, and reading them; tables of boxes."""

from __future__ import annotations

import csv
import io
import math
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import read_bytes, read_text
from seqopt.errors import SceneError, SceneWarning
from seqopt.scene._checks import printable, short
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
from seqopt.scene.imports._building import build_scene
from seqopt.scene.imports._compas_models import read_assembly, read_model, read_timber
from seqopt.scene.imports._compas_scenes import is_meshes, read_meshes, read_scene
from seqopt.scene.imports._compas_shapes import kind, payload
from seqopt.scene.imports._content import (
    LARGEST,
    MOST_BLOCKS,
    Content,
    FileBlock,
    Given,
    parse_json,
)
from seqopt.scene.imports._frames import read_frame
from seqopt.scene.imports._mesh_files import read_mesh, read_obj, read_objects, read_off
from seqopt.scene.imports._rhino import read_3dm
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import warn_of

_DOCUMENTS: dict[str, Callable[[Any, str], Content]] = {
    "compas_assembly": read_assembly,
    "compas_model": read_model,
    "compas_dem": read_model,
    "compas_timber": read_timber,
    "compas_scene": read_scene,
    "compas_meshes": read_meshes,
    "frame": read_frame,
}
_BYTES: dict[str, Callable[[bytes, str], Content]] = {
    "3dm": read_3dm,
    "glb": partial(read_objects, form="glb"),
    "3mf": partial(read_objects, form="3mf"),
    "ply": partial(read_mesh, form="ply"),
    "stl": partial(read_mesh, form="stl"),
}
_SUFFIXES = {"csv": "boxes", "obj": "obj", "off": "off", "json": "", **{key: key for key in _BYTES}}
_MESHED = ".glb or .obj, every block a closed mesh with a name"
_INSTEAD = {  # what to save in place of what is not read
    "dwg dxf": "open it in Rhino and save as .3dm, or export closed solids as .stl",
    "gh ghx": "bake it and save from Rhino as .3dm",
    "step stp iges igs sat x_t fcstd": "open it in Rhino and save as .3dm, or in FreeCAD and save "
    "as .obj",
    "ifc rvt": "convert it (IfcConvert a.ifc a.obj, of IfcOpenShell), or export closed meshes as "
    ".obj",
    "skp blend fbx dae max c4d usd usdz": f"export {_MESHED}",
    "gltf": "export .glb, which is one file",
}
_LYING = 3  # blocks on the ground from which on it is odd if most are there
FORMATS = (*_DOCUMENTS, "boxes", "obj", "off", *_BYTES)


def import_scene(path: str | Path, form: str | None = None, given: Given | None = None) -> Scene:
    r"""Return the scene of a file that another program wrote.

    ``form``: one of `FORMATS`; by default what the file looks like. ``given``: what the file does
    not say: a unit of length, a density and more. Result: its provenance says what was read and
    what was assumed. Raises `FileError` if the file cannot be read, or what reads it is not
    installed; `SceneError` if it is no such file, or lacks what is not given.

    Warns
    -----
    SceneWarning
        If something is probably a mistake; see `seqopt.scene.scene_file`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "two.csv")
    ...     _ = path.write_text("x,y,z,length,width,height\n0,0,1,2,1,2\n0,0,2.5,2,1,1\n")
    ...     import_scene(path, given=Given(unit="m", density=2000.0))
    <Scene two: 2 bricks, 1 joints, 1 ground ends, 3 robots>
    """
    if not isinstance(path, str | Path):
        raise SceneError(f"a {type(path).__name__} is not a file; give a path")
    if not isinstance(given, Given | None):
        raise SceneError(f"given is {short(given)}; give Given(unit=..., density=...)")
    where = Path(path)
    content = read_content(where, form)
    scene = build_scene(content, given or Given(), printable("file", where.stem or "file"))
    warn_of(scene, scene.name)
    if content.own is None and (given is None or (given.supports is None and given.up is None)):
        _warn_of_lying(scene, "z" if content.up == "y" else "y")
    return scene


def _warn_of_lying(scene: Scene, up: str) -> None:
    """Warn if most blocks rest on the ground, as they do where another axis is up in the file."""
    low = {ground.brick for ground in scene.grounds}
    if len(low) >= _LYING and 2 * len(low) > len(scene.bricks):
        warnings.warn(
            f"scene {scene.name}: {len(low)} of {len(scene.bricks)} blocks rest on the ground; if "
            f"{up} is up in the file, say so (--up {up})",
            SceneWarning,
            stacklevel=3,
        )


def read_content(path: Path, form: str | None = None) -> Content:
    """Return what a file says, in one of `FORMATS`; by default in that which it looks like."""
    source, suffix = str(path), path.suffix.lower().removeprefix(".")
    named = _SUFFIXES.get(suffix) if form is None else form
    if named is None or (form is not None and form not in FORMATS):
        raise SceneError(_not_read(source, suffix, form))
    if named in _BYTES:
        return _BYTES[named](read_bytes(path), source)
    text = read_text(path)
    texts = {"boxes": _read_boxes, "obj": read_obj, "off": read_off}
    if named in texts:
        return texts[named](text, source)
    document = parse_json(text, source)
    return _DOCUMENTS[named or sniffed(document, source)](document, source)


def _not_read(source: str, suffix: str, form: str | None) -> str:
    """Return why a format is not read, and what to save instead."""
    for suffixes, remedy in _INSTEAD.items():
        if form is None and suffix in suffixes.split():
            return f"{source}: a .{suffix} cannot be read; {remedy}"
    what = f"format is {short(form)}" if form else f"{source}: its format is not known"
    return f"{what}; give one of {', '.join(FORMATS)}"


def sniffed(document: Any, source: str) -> str:
    """Return which of `_DOCUMENTS` a JSON document is."""
    known = {
        "blockmodel": "compas_dem",
        "problem": "compas_dem",
        "timbermodel": "compas_timber",
        "scene": "compas_scene",
    }
    if kind(document) in known:
        return known[kind(document)]
    held = payload(document)
    inner = {*held} if isinstance(held, dict) else {*()}
    if {"elements", "tree"} <= inner:
        return "compas_model"
    keys = {*document} if isinstance(document, dict) else {*()}
    if document and isinstance(document, dict) and document.get("format") == "seqopt-scene":
        raise SceneError(f"{source}: it is a scene of seqopt already; give it as such")
    if {"nodes", "elements"} <= keys:
        return "frame"
    if is_meshes(document):
        return "compas_meshes"
    if keys & {"graph", "node", "blocks", "assembly", "data"}:
        return "compas_assembly"
    raise SceneError(f"{source}: no assembly that is known; give one of {', '.join(FORMATS)}")


_NEEDED = ("x", "y", "z", "length", "width", "height")
_TURNS = ("roll", "pitch", "yaw")
_COLUMNS = (*_NEEDED, *_TURNS, "name", "support", "density", "course")
_YES, _NO = ("1", "true", "yes"), ("", "0", "false", "no")


def _read_boxes(text: str, source: str) -> Content:
    """Return the boxes of a table with the columns `_NEEDED`, the centroid and sizes.

    Others of `_COLUMNS` may be there: turns are in degrees about x, then y, then z.
    """
    try:
        reader = csv.DictReader(io.StringIO(text), restval="")
        rows = [row for row, _ in zip(reader, range(MOST_BLOCKS + 1), strict=False)]
    except csv.Error as error:
        raise SceneError(f"{source}: not a readable CSV file: {error}") from error
    names = [name or "" for name in reader.fieldnames or ()]
    _check_columns(source, names)
    if not rows or len(rows) > MOST_BLOCKS:
        raise SceneError(f"{source}: {len(rows)} rows; give 1 to {MOST_BLOCKS} boxes")
    return Content(
        tuple(_box(f"{source}, row {i}", str(i), row) for i, row in enumerate(rows, start=1)),
        said=("a table of boxes: no faces",),
    )


def _check_columns(source: str, names: list[str]) -> None:
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        raise SceneError(f"{source}: column {missing[0]} is missing; give {', '.join(_NEEDED)}")
    for name in names:
        if name not in _COLUMNS or names.count(name) > 1:
            why = "occurs twice" if name in _COLUMNS else "is not known"
            raise SceneError(f"{source}: column {short(name)} {why}; give {', '.join(_COLUMNS)}")


def _box(where: str, key: str, row: dict[str, str]) -> FileBlock:
    center = np.array([_number(where, row, name) for name in "xyz"])
    size = np.array([_number(where, row, name) for name in ("length", "width", "height")])
    if not size.min() > 0:
        raise SceneError(f"{where}: its sizes are {size.tolist()}; give positive ones")
    angles = [_number(where, row, name, "0") for name in _TURNS]
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  # slow to import

    frame = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    density = _number(where, row, "density", "nan")
    course = _number(where, row, "course", "nan")
    return FileBlock(
        row.get("name", "").strip() or key,
        center + 0.5 * (BOX_CORNERS * size) @ frame.T,
        BOX_FACES,
        support=_flag(where, row),
        density=None if math.isnan(density) else density,
        course=None if math.isnan(course) else course,
    )


def _number(where: str, row: dict[str, str], name: str, otherwise: str = "") -> float:
    text = (row.get(name) or "").strip()
    try:
        value = float(text or otherwise)
    except ValueError:
        value = math.inf
    if abs(value) > LARGEST or (text and math.isnan(value)):
        raise SceneError(f"{where}: {name} is {short(text)}; give a number")
    return value


def _flag(where: str, row: dict[str, str]) -> bool:
    text = (row.get("support") or "").strip().lower()
    if text not in (*_YES, *_NO):
        raise SceneError(f"{where}: support is {short(text)}; give 1 or 0")
    return text in _YES
