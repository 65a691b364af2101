"""File formats of other programs, how they are recognized, and reading them; bar frames, tables.

A bar of a frame becomes a beam with a square cross-section of the bar's area. Bars here are rigid:
what they give way by their own length is put into their joints, half of each bar on either side.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import read_bytes, read_table, read_text
from seqopt.arrays import Floats
from seqopt.errors import SceneError, SceneWarning
from seqopt.scene._checks import printable, short
from seqopt.scene.arch import STANDARD_GRAVITY
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
from seqopt.scene.imports._building import build_scene
from seqopt.scene.imports._compas_models import (
    is_meshes,
    read_assembly,
    read_meshes,
    read_model,
    read_scene,
    read_timber,
)
from seqopt.scene.imports._compas_shapes import kind, payload
from seqopt.scene.imports._content import (
    GROUND,
    LARGEST,
    MOST_BLOCKS,
    UNITS,
    Content,
    Entry,
    FileBlock,
    FileJoint,
    Given,
    assembly_json,
    entry,
    listing,
    mapping,
    number,
    point,
)
from seqopt.scene.imports._folders import read_folder
from seqopt.scene.imports._mesh_files import read_3dm, read_mesh, read_obj, read_objects, read_off
from seqopt.scene.imports._meshes import without_repeats
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import warn_of
from seqopt.scene.shape import plane_axes

_UNITS = {"meter": "m", "m": "m", "centimeter": "cm", "cm": "cm", "millimeter": "mm", "mm": "mm"}
_MEASURES = {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6, "m4": 1.0, "cm4": 1e-8, "mm4": 1e-12}
_MEASURES |= {"kN/m2": 1e3, "kN/cm2": 1e7, "N/mm2": 1e6, "MPa": 1e6, "Pa": 1.0}
_MEASURES |= {"kN/m3": 1e3, "N/m3": 1.0, "kN/cm3": 1e9}  # in m, N
_LEAST = 1e-30  # area, second moment, modulus or density treated as zero


@dataclass(frozen=True)
class _Bar:
    """A bar: ends (2, 3), m; nodes; area, m²; second moments of area and of twist, m⁴; Pa."""

    ends: Floats
    nodes: tuple[int, int]
    area: float
    bending: float
    twist: float
    young: float
    shear: float
    density: float
    layer: float | None

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))


def _read_frame(document: Any, source: str) -> Content:
    """Return the bars of a frame: ``nodes``, ``elements``, ``materials`` and ``cross_secs``.

    Where they do not name units, materials and cross-sections are in kN and m. The density is a
    weight per volume.
    """
    held = mapping(source, document)
    nodes, grounded = _nodes(source, held)
    rows = listing(f"{source}: elements", entry(source, held, "elements"), 20_000)
    bars = [_bar(f"{source}: element {i}", held, row, nodes) for i, row in enumerate(rows)]
    blocks = tuple(_block(i, bar) for i, bar in enumerate(bars))
    said = (
        "bars are rigid; their own flexibility is in the joints, half of each bar on either side",
        "density is taken as a weight per volume (kN/m³ unless the file says otherwise)",
        "loads are left out; bars carry their weight",
    )
    return Content(blocks, joints=tuple(_joints(bars, grounded)), unit="m", said=said)


def _nodes(source: str, held: Entry) -> tuple[Floats, set[int]]:
    """Return the nodes (n, 3) in m, and the places of those on the ground."""
    unit = held.get("unit", "meter")
    if not isinstance(unit, str) or unit not in _UNITS:
        raise SceneError(f"{source}: unit is {short(unit)}; one of {', '.join(_UNITS)} is expected")
    rows = listing(f"{source}: nodes", entry(source, held, "nodes"), 20_000)
    places = [
        point(f"{source}: node {i}", entry(f"{source}: node {i}", row, "point"))
        for i, row in enumerate(rows)
    ]
    fixed = {i for i, row in enumerate(rows) if row.get("is_grounded")}
    for row in listing(source, held.get("supports") or []):
        fixed.add(_index(f"{source}: supports", mapping(source, row).get("node_ind"), len(rows)))
    if not fixed:
        raise SceneError(f"{source}: no node is_grounded; name one")
    return UNITS[_UNITS[unit]] * np.array(places).reshape(-1, 3), fixed


def _index(where: str, value: Any, count: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < count:
        raise SceneError(f"{where}: there is no node {short(value)}; known are 0 to {count - 1}")
    return value


def _bar(where: str, held: Entry, row: Any, nodes: Floats) -> _Bar:
    ends = listing(where, entry(where, row, "end_node_inds"))
    if len(ends) != 2 or ends[0] == ends[1]:
        raise SceneError(f"{where}: end_node_inds are {short(ends)}; give two different nodes")
    pair = (_index(where, ends[0], len(nodes)), _index(where, ends[1], len(nodes)))
    section = _of_element(where, held, "cross_secs", row)
    material = _of_element(where, held, "materials", row)
    area = _measure(where, section, "A", "m2")
    square = area**2 / 12  # second moment of a square's area
    layer = row.get("layer_ind")
    return _Bar(
        ends=nodes[list(pair)],
        nodes=pair,
        area=area,
        bending=min(_measure(where, section, name, "m4", square) for name in ("Iy", "Iz")),
        twist=_measure(where, section, "Jx", "m4", 2 * square),
        young=_measure(where, material, "E", "kN/m2"),
        shear=_measure(where, material, "G12", "kN/m2"),
        density=_measure(where, material, "density", "kN/m3") / STANDARD_GRAVITY,
        layer=None if layer is None else number(f"{where}: layer_ind", layer),
    )


def _of_element(where: str, held: Entry, what: str, row: Entry) -> Entry:
    """Return the cross-section or material of an element: that with its tag, or the first."""
    found = [mapping(where, item) for item in listing(where, entry(where, held, what))]
    if not found:
        raise SceneError(f"{where}: {what} is empty; give one")
    tag = row.get("elem_tag")
    tagged = [item for item in found if tag is not None and tag in (item.get("elem_tags") or ())]
    return (tagged or found)[0]


def _measure(
    where: str, item: Entry, name: str, unit: str, otherwise: float | None = None
) -> float:
    if name not in item and otherwise is not None:
        return otherwise
    named = item.get(f"{name}_unit", unit)
    if not isinstance(named, str) or named not in _MEASURES:
        known = ", ".join(_MEASURES)
        raise SceneError(f"{where}: {name}_unit is {short(named)}; one of {known} is known")
    value = number(f"{where}: {name}", entry(where, item, name)) * _MEASURES[named]
    if not value > _LEAST:
        raise SceneError(f"{where}: {name} is {value:g}; give a positive number")
    return value


def _block(place: int, bar: _Bar) -> FileBlock:
    along = bar.ends[1] - bar.ends[0]
    if not bar.length > 0:
        raise SceneError(f"element {place}: its nodes are in one place; move them apart")
    axes = plane_axes(along / bar.length)
    size = np.array([bar.length, math.sqrt(bar.area), math.sqrt(bar.area)])
    corners = bar.ends.mean(axis=0) + 0.5 * (BOX_CORNERS * size) @ axes
    return FileBlock(str(place), corners, BOX_FACES, density=bar.density, course=bar.layer)


def _joints(bars: list[_Bar], grounded: set[int]) -> list[FileJoint]:
    """Return the joints of bars: each node's first bar with its others, or all with the ground."""
    at: dict[int, list[int]] = {}
    for i, bar in enumerate(bars):
        for node in bar.nodes:
            at.setdefault(node, []).append(i)
    out = []
    for node, mine in sorted(at.items()):
        first = GROUND if node in grounded else mine[0]
        for i in mine if first == GROUND else mine[1:]:
            out.append(_joint(bars, (first, i), node))
    return out


def _joint(bars: list[_Bar], pair: tuple[int, int], node: int) -> FileJoint:
    ends = [bars[i] for i in pair if i != GROUND]
    last = ends[-1]
    place = last.ends[last.nodes.index(node)]
    out = last.ends.mean(axis=0) - place
    soft = np.sum([_softness(bar) for bar in ends], axis=0)
    axial, across, twist, bend = (1 / soft).tolist()
    return FileJoint(
        blocks=pair,
        position=place,
        along=out / np.linalg.norm(out),
        side=math.sqrt(min(bar.area for bar in ends)),
        translational=(axial, across, across),
        rotational=(twist, bend, bend),
    )


def _softness(bar: _Bar) -> list[float]:
    """Return how half a bar, held in its middle, gives way at its end: m/N and rad/(N m)."""
    half = 0.5 * bar.length
    return [
        half / (bar.young * bar.area),
        half**3 / (3 * bar.young * bar.bending),
        half / (bar.shear * bar.twist),
        half / (bar.young * bar.bending),
    ]


_DOCUMENTS: dict[str, Callable[[Any, str], Content]] = {
    "compas_assembly": read_assembly,
    "compas_model": read_model,
    "compas_dem": read_model,
    "compas_timber": read_timber,
    "compas_scene": read_scene,
    "compas_meshes": read_meshes,
    "frame": _read_frame,
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
    r"""Return the scene of a file that another program wrote, or a folder with a block a file.

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
    name = where.resolve().name if where.is_dir() else where.stem
    scene = build_scene(content, given or Given(), printable("file", name or "file"))
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
    """Return what a file says, in one of `FORMATS`; by default in that which it looks like.

    A folder has a block in each of its files.
    """
    if path.is_dir():
        return without_repeats(read_folder(path, form, _SUFFIXES, _read))
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
_COLUMNS = (*_NEEDED, *_TURNS, "name", "support", "density", "mass", "course")
_YES, _NO = ("1", "true", "yes"), ("", "0", "false", "no")


def _read_boxes(text: str, source: str) -> Content:
    """Return the boxes of a table with the columns `_NEEDED`, the centroid and sizes.

    Others of `_COLUMNS` may be there: turns are in degrees about x, then y, then z.
    """
    names, found = read_table(text, source, SceneError)
    rows = [row for _, row in found]
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
    optional = (_number(where, row, name, "nan") for name in ("density", "mass", "course"))
    density, mass, course = (None if math.isnan(value) else value for value in optional)
    if mass is not None and not mass > 0:
        raise SceneError(f"{where}: mass is {mass:g}; give a positive number of kg")
    return FileBlock(
        row.get("name", "").strip() or key,
        center + 0.5 * (BOX_CORNERS * size) @ frame.T,
        BOX_FACES,
        support=_flag(where, row),
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


def _flag(where: str, row: dict[str, str]) -> bool:
    text = (row.get("support") or "").strip().lower()
    if text not in (*_YES, *_NO):
        raise SceneError(f"{where}: support is {short(text)}; give 1 or 0")
    return text in _YES
