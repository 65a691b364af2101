"""Tables of boxes: a block a row, by its centroid, dimensions and turns."""

from __future__ import annotations

import math

import numpy as np

from seqopt._registry import Later
from seqopt.errors import SceneError
from seqopt.exchange._content import LARGEST, MOST_BLOCKS, Content, FileBlock
from seqopt.exchange._files import read_table
from seqopt.scene._checks import short
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES

transform = Later("scipy.spatial.transform")  # slow to import

_NEEDED = ("x", "y", "z", "length", "width", "height")
_TURNS = ("roll", "pitch", "yaw")
_COLUMNS = (*_NEEDED, *_TURNS, "name", "support", "density", "mass", "course")
_YES, _NO = ("1", "true", "yes"), ("", "0", "false", "no")


def read_boxes(text: str, source: str) -> Content:
    """Return the boxes of a table with the columns `_NEEDED`, the centroid and sizes.

    Others of `_COLUMNS` may be there: turns are in degrees about x, then y, then z.
    """
    names, found = read_table(text, source, SceneError)
    rows = [row for _, row in found]
    for line, row in found:
        if len(row) > len(names):  # cells beyond the columns are under None
            raise SceneError(f"{source}, line {line}: more cells than the {len(names)} columns")
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
    frame = transform.Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
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
