"""Boxes from a table: where each is, how large, how it is turned."""

from __future__ import annotations

import csv
import io
import math

import numpy as np
from scipy.spatial.transform import Rotation

from seqopt.errors import SceneError
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
from seqopt.scene.checks import short
from seqopt.scene.imports.compas_data import LARGEST
from seqopt.scene.imports.content import MOST_BLOCKS, Content, FileBlock

_NEEDED = ("x", "y", "z", "length", "width", "height")
_TURNS = ("roll", "pitch", "yaw")
_COLUMNS = (*_NEEDED, *_TURNS, "name", "support", "density", "course")
YES, NO = ("1", "true", "yes"), ("", "0", "false", "no")


def read_boxes(text: str, source: str) -> Content:
    r"""Return the boxes of a table.

    ``text``: CSV. Columns ``x``, ``y``, ``z`` (the centroid), ``length``, ``width`` and ``height``
    (along the box's own x, y and z) are needed; ``roll``, ``pitch``, ``yaw`` (degrees about x, then
    y, then z), ``name``, ``support`` (1 or 0), ``density`` (kg/m³) and ``course`` may be there.
    Raises `SceneError` if it is no such table.

    Examples
    --------
    >>> read_boxes("x,y,z,length,width,height\n0,0,0.5,1,1,1\n", "boxes").blocks[0].key
    '1'
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
    if text not in (*YES, *NO):
        raise SceneError(f"{where}: support is {short(text)}; give 1 or 0")
    return text in YES
