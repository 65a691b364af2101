"""File formats of other programs, how they are recognized, and reading them; tables, folders."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import read_bytes, read_table, read_text
from seqopt.errors import FileError, SceneError, SceneWarning
from seqopt.exchange._building import build_scene
from seqopt.exchange._compas_models import is_meshes, read_assembly, read_meshes, read_model
from seqopt.exchange._compas_shapes import kind, payload
from seqopt.exchange._content import LARGEST, MOST_BLOCKS, Content, FileBlock, Given, assembly_json
from seqopt.exchange._mesh_files import (
    counted,
    read_3dm,
    read_mesh,
    read_obj,
    read_objects,
    read_off,
)
from seqopt.exchange._meshes import without_repeats
from seqopt.scene._checks import cut, printable, short
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import warn_of

_DOCUMENTS: dict[str, Callable[[Any, str], Content]] = {
    "compas_assembly": read_assembly,
    "compas_model": read_model,
    "compas_dem": read_model,
    "compas_meshes": read_meshes,
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
_REFUSED = {  # kinds of COMPAS, and what to save in their place
    "scene": "save its meshes as a list (compas.json_dump)",
    "timbermodel": "save the meshes of its beams as a list (compas.json_dump)",
}
_LYING = 3  # blocks on the ground from which on it is odd if most are there
FORMATS = (*_DOCUMENTS, "boxes", "obj", "off", *_BYTES)


def import_scene(path: str | Path, form: str | None = None, given: Given | None = None) -> Scene:
    r"""Return the scene of a file that another program wrote, or a folder with a block a file.

    Parameters
    ----------
    path
        The file or folder.
    form
        One of `FORMATS`; by default what the file looks like.
    given
        What the file does not say: a unit of length, a density and more.

    Returns
    -------
    Scene
        Its provenance says what was read and what was assumed.

    Raises
    ------
    FileError
        If the file cannot be read, or what reads it is not installed.
    SceneError
        If it is no such file, or lacks what is not given.

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
    name = where.resolve().name if where.is_dir() else where.stem
    scene = build_scene(content, given or Given(), printable("file", name or "file"))
    warn_of(scene, scene.name)
    if given is None or (given.supports is None and given.up is None):
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
    """Return what a file says, in one of `FORMATS`; by default in that which it looks like.

    A folder has a block in each of its files.
    """
    if path.is_dir():
        return without_repeats(_read_folder(path, form))
    return without_repeats(_read(path, form))


def _read(path: Path, form: str | None = None) -> Content:
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
    document = assembly_json(text, source)
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
    if kind(document) in ("blockmodel", "problem"):
        return "compas_dem"
    if kind(document) in _REFUSED:
        raise SceneError(f"{source}: a {kind(document)} cannot be read; {_REFUSED[kind(document)]}")
    held = payload(document)
    inner = {*held} if isinstance(held, dict) else {*()}
    if {"elements", "tree"} <= inner:
        return "compas_model"
    keys = {*document} if isinstance(document, dict) else {*()}
    if document and isinstance(document, dict) and document.get("format") == "seqopt-scene":
        raise SceneError(f"{source}: it is a scene of seqopt already; give it as such")
    if is_meshes(document):
        return "compas_meshes"
    if keys & {"graph", "node", "blocks", "assembly", "data"}:
        return "compas_assembly"
    raise SceneError(f"{source}: no assembly that is known; give one of {', '.join(FORMATS)}")


_NEEDED = ("x", "y", "z", "length", "width", "height")
_TURNS = ("roll", "pitch", "yaw")
_COLUMNS = (*_NEEDED, *_TURNS, "name", "support", "density", "mass", "course")
_YES, _NO = ("1", "true", "yes"), ("", "0", "false", "no")


def _read_boxes(text: str, source: str) -> Content:
    """Return the boxes of a table with the columns `_NEEDED`, the centroid and sizes.

    Others of `_COLUMNS` may be there: turns are in degrees about x, then y, then z.
    """
    names, found = read_table(text, source, SceneError)
    rows = [row for _, row in found]
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        raise SceneError(f"{source}: column {missing[0]} is missing; give {', '.join(_NEEDED)}")
    for name in names:
        if name not in _COLUMNS or names.count(name) > 1:
            why = "occurs twice" if name in _COLUMNS else "is not known"
            raise SceneError(f"{source}: column {short(name)} {why}; give {', '.join(_COLUMNS)}")
    if not rows or len(rows) > MOST_BLOCKS:
        raise SceneError(f"{source}: {len(rows)} rows; give 1 to {MOST_BLOCKS} boxes")
    return Content(
        tuple(_box(f"{source}, row {i}", str(i), row) for i, row in enumerate(rows, start=1)),
        said=("a table of boxes: no faces",),
    )


def _box(where: str, key: str, row: dict[str, str]) -> FileBlock:
    center = np.array([_number(where, row, name) for name in "xyz"])
    size = np.array([_number(where, row, name) for name in ("length", "width", "height")])
    if not size.min() > 0:
        raise SceneError(f"{where}: its sizes are {size.tolist()}; give positive ones")
    angles = [_number(where, row, name, "0") for name in _TURNS]
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  # slow to import

    frame = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    optional = (_number(where, row, name, "nan") for name in ("density", "mass", "course"))
    density, mass, course = (None if math.isnan(value) else value for value in optional)
    if mass is not None and not mass > 0:
        raise SceneError(f"{where}: mass is {mass:g}; give a positive number of kg")
    text = (row.get("support") or "").strip().lower()
    if text not in (*_YES, *_NO):
        raise SceneError(f"{where}: support is {short(text)}; give 1 or 0")
    return FileBlock(
        row.get("name", "").strip() or key,
        center + 0.5 * (BOX_CORNERS * size) @ frame.T,
        BOX_FACES,
        support=text in _YES,
        density=density,
        mass=mass,
        course=course,
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


_MESHES = ("obj", "off", "stl", "ply", "glb", "3mf", "3dm")
_IN_JSON = "compas_meshes"


def _read_folder(path: Path, form: str | None) -> Content:
    """Return the blocks of a folder, named as its files are.

    ``form``: of its files, by default that of the meshes in it. Raises `SceneError` if it has none,
    those of several formats, or a file that is not one block.
    """
    try:
        inside = [file for file in path.iterdir() if not file.name.startswith(".")]
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror}") from error
    forms = {file: _SUFFIXES.get(file.suffix.lower()[1:]) for file in inside if file.is_file()}
    form = form or _form_of(path, {*forms.values()})
    files = [file for file, own in forms.items() if (own or _IN_JSON) == form]
    files.sort(key=lambda file: (counted(file.stem), file.name))
    if not 0 < len(files) <= MOST_BLOCKS:
        raise SceneError(f"{path}: it has {len(files)} files of {form}; give 1 to {MOST_BLOCKS}")
    contents = [_read(file, form) for file in files]
    units = {content.unit for content in contents}
    if len(units) > 1:
        known = ", ".join(sorted(str(unit) for unit in units))
        raise SceneError(f"{path}: its files are in different units, {known}; save all in one")
    left = sorted(file.name for file in {*inside} - {*files})
    said = [f"a folder of {len(files)} files of {form}, a block each: no supports, faces or order"]
    if left:
        said.append(f"{len(left)} other files are left out: {cut(', '.join(left), 80)}")
    pairs = zip(files, contents, strict=True)
    blocks = tuple(_one_block(file, content) for file, content in pairs)
    return replace(contents[0], blocks=blocks, said=tuple(said))


def _form_of(path: Path, forms: set[str | None]) -> str:
    """Return the format of the meshes in a folder."""
    found = [form for form in _MESHES if form in forms]
    if len(found) > 1:
        raise SceneError(f"{path}: it has meshes in {' and '.join(found)}; choose one (--format)")
    if not found and "" not in forms:
        raise SceneError(
            f"{path}: a folder without meshes; give one with a block in each file, in "
            f"{', '.join(_MESHES)} or JSON of COMPAS"
        )
    return found[0] if found else _IN_JSON


def _one_block(file: Path, content: Content) -> FileBlock:
    if len(content.blocks) > 1:
        raise SceneError(
            f"{file}: its mesh is {len(content.blocks)} pieces; unite them to one closed mesh, or "
            "give each a file of its own"
        )
    return replace(content.blocks[0], key=file.stem)
