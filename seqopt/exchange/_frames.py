"""Bar frames: nodes, elements, materials and cross-sections in JSON.

A bar of a frame becomes a beam with a square cross-section of the bar's area. Bars here are rigid:
what they give way by their own length is put into their joints, half of each bar on either side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.exchange._content import (
    GROUND,
    UNITS,
    Content,
    Entry,
    FileBlock,
    FileJoint,
    entry,
    listing,
    mapping,
    number,
    point,
)
from seqopt.scene._checks import short
from seqopt.scene.arch import STANDARD_GRAVITY
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
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


def read_frame(document: Any, source: str) -> Content:
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
