"""Beams of a compas_timber model: boxes from the start of their center lines.

Cuts of joints are left out: a beam is its blank. Beams meet over their faces where these touch;
where they run into each other the model's own joints say who meets whom.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SceneError
from seqopt.scene.blocks import BOX_CORNERS, BOX_FACES
from seqopt.scene.imports.compas_data import frame, moved, payload
from seqopt.scene.imports.compas_tree import Element, by_guid, read_elements
from seqopt.scene.imports.content import Content, FileBlock, FileJoint
from seqopt.scene.imports.documents import Entry, entry, listing, mapping, number


def read_timber(document: Any, source: str) -> Content:
    """Return the beams of a model.

    Parameters
    ----------
    document : object
        A JSON document.
    source : str
        What to call it in messages.

    Raises
    ------
    SceneError
        If it is no such model, or has no beams.
    """
    held = mapping(source, payload(document))
    elements = read_elements(source, held)
    beams = [element for element in elements if element.kind == "beam"]
    if not beams:
        raise SceneError(f"{source}: it has no beams; give a model with some")
    blocks = tuple(_beam(f"{source}: beam {i}", str(i), beam) for i, beam in enumerate(beams))
    place = {beam.guid: i for i, beam in enumerate(beams)}
    joints = tuple(_joint(blocks, pair) for pair in _pairs(source, held, place))
    said = ["beams are their blanks: cuts and fasteners are left out"]
    if len(beams) < len(elements):
        said.append(f"{len(elements) - len(beams)} elements that are not beams are left out")
    return Content(blocks, joints=joints, said=tuple(said))


def _beam(where: str, key: str, beam: Element) -> FileBlock:
    """Return a beam; its frame, where it has one, is that in the model, not that in its group."""
    held = beam.held
    names = ("length", "width", "height")
    size = np.array([number(f"{where}: {name}", entry(where, held, name)) for name in names])
    if not size.min() > 0:
        raise SceneError(f"{where}: its sizes are {size.tolist()}; give positive ones")
    local: Floats = 0.5 * (BOX_CORNERS + np.array([1.0, 0.0, 0.0])) * size
    if held.get("frame") is not None:
        origin, axes = frame(where, held["frame"])
        points = origin + local @ axes
    else:
        points = moved(local, beam.matrix)
    return FileBlock(key, np.asarray(points), BOX_FACES)


def _pairs(source: str, held: Entry, place: dict[str, int]) -> Iterator[tuple[int, int]]:
    """Yield the places of beams that the model's own joints hold together."""
    seen = set()
    for _, item in by_guid(f"{source}: joints", held.get("joints") or []):
        joint = mapping(source, payload(item))
        ends = [str(x) for x in listing(source, joint.get("element_guids") or [])]
        for a, b in combinations(sorted(place[x] for x in ends if x in place), 2):
            if (a, b) not in seen:
                seen.add((a, b))
                yield a, b


def _joint(blocks: tuple[FileBlock, ...], pair: tuple[int, int]) -> FileJoint:
    """Return a joint halfway between the center lines of two beams, where these are nearest."""
    lines = [_center_line(blocks[i].vertices) for i in pair]
    (start, step, side), (other, reach, width) = lines
    at, to = _nearest((start, step), (other, reach))
    middle = 0.5 * (start + at * step + other + to * reach)
    ahead = np.array([block.vertices.mean(axis=0) for block in (blocks[i] for i in pair)])
    along = ahead[1] - ahead[0]
    size = float(np.linalg.norm(along))
    along = along / size if size > 0 else np.array([0.0, 0.0, 1.0])
    return FileJoint(pair, middle, along, min(side, width))


def _center_line(corners: Floats) -> tuple[Floats, Floats, float]:
    """Return the start of a beam's center line, the step to its end, and its smaller side."""
    start, end = corners[:4].mean(axis=0), corners[4:].mean(axis=0)
    sides = np.linalg.norm(corners[[1, 2]] - corners[0], axis=1)
    return start, end - start, float(sides.min())


def _nearest(first: tuple[Floats, Floats], second: tuple[Floats, Floats]) -> tuple[float, float]:
    """Return at which shares of two lines, starts and steps, they are nearest to each other."""
    (start, step), (other, reach) = first, second
    gap = start - other
    a, b, c = float(step @ step), float(step @ reach), float(reach @ reach)
    d, e = float(step @ gap), float(reach @ gap)
    apart = a * c - b * b
    at = 0.5 if apart <= 1e-12 * a * c else float(np.clip((b * e - c * d) / apart, 0.0, 1.0))
    to = float(np.clip((b * at + e) / c, 0.0, 1.0))
    return float(np.clip((b * to - d) / a, 0.0, 1.0)), to
