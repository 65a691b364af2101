"""Words beside points of a chart that cover neither each other nor any point (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from seqopt.report._style import GRAY, INK, SMALL

RADII = (7, 12, 20, 30, 42, 56, 72, 90)  # points, from a point to its words
FAR = 16  # from where on a line leads to them
ROOM = 4.0  # half of the size of a point, in points
AIR = 1.5  # points between two texts


@dataclass(frozen=True)
class Label:
    """Words for a point; those that are not ``needed`` are left out where there is no room."""

    axes: Axes
    at: tuple[float, float]
    words: str
    needed: bool


def place(
    figure: Figure, labels: Sequence[Label], taken: Sequence[tuple[Axes, float, float]]
) -> None:
    """Write labels where there is room, the needed ones first, around points that are taken."""
    FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]  # which settles where everything is
    scale = figure.dpi / 72
    boxes = [_around(axes, x, y, ROOM * scale) for axes, x, y in taken]
    boxes += [text.get_window_extent() for axes in figure.axes for text in axes.texts]
    for label in sorted(labels, key=lambda each: not each.needed):
        text = _written(label)
        found = _spot(text, label, boxes, scale)
        if found is None:
            text.remove()
        else:
            boxes.append(found)


def _around(axes: Axes, x: float, y: float, half: float) -> Bbox:
    across, up = axes.transData.transform((x, y))
    return Bbox.from_extents(across - half, up - half, across + half, up + half)


def _written(label: Label) -> Annotation:
    text = label.axes.annotate(
        label.words,
        label.at,
        (0, 0),
        textcoords="offset points",
        fontsize=SMALL,
        color=INK if label.needed else GRAY,
        linespacing=1.0,
    )
    text.set_in_layout(False)
    return text


def _lead(label: Label, shift: tuple[float, float]) -> None:
    """Draw a line from a point to its words."""
    line = {"arrowstyle": "-", "lw": 0.5, "color": GRAY, "shrinkA": 0, "shrinkB": 4}
    found = label.axes.annotate("", label.at, shift, textcoords="offset points", arrowprops=line)
    found.set_in_layout(False)


def _spots() -> Iterator[tuple[float, float]]:
    """Yield directions with their distances, points: the nearest and those beside first."""
    for radius in RADII:
        for degrees in (0, 45, 90, 315, 135, 270, 180, 225, 20, 70, 340, 290, 110, 160, 250, 200):
            angle = np.radians(degrees)
            yield radius * float(np.cos(angle)), radius * float(np.sin(angle))


def _spot(text: Annotation, label: Label, boxes: Sequence[Bbox], scale: float) -> Bbox | None:
    """Move a text to the first spot that is free, and return what it takes up there.

    Where none is, needed words go where they cover least, others nowhere.
    """
    inside = label.axes.get_window_extent()
    own = text.get_window_extent()
    wide, high = own.width, own.height
    x, y = label.axes.transData.transform(label.at)
    best, least = None, np.inf
    for dx, dy in _spots():
        left = x + dx * scale - wide * _share(dx)
        low = y + dy * scale - high * _share(dy)
        box = Bbox.from_bounds(left, low, wide, high)
        out = _outside(box, inside)
        covered = out + sum(_shared(box, other, AIR * scale) for other in boxes)
        if covered < least:
            best, least = (dx, dy, box), covered
        if not covered:
            break
    if best is None or (least > 0 and not label.needed):
        return None
    dx, dy, box = best
    text.set_position((dx, dy))
    across: dict[float, Any] = {0.0: "left", 0.5: "center", 1.0: "right"}
    up: dict[float, Any] = {0.0: "bottom", 0.5: "center", 1.0: "top"}
    text.set(ha=across[_share(dx)], va=up[_share(dy)])
    if float(np.hypot(dx, dy)) > FAR:
        _lead(label, (dx, dy))
    return box


def _share(shift: float) -> float:
    """Return which share of a text lies before its anchor."""
    return 0.0 if shift > 1 else 1.0 if shift < -1 else 0.5


def _outside(box: Bbox, room: Bbox) -> float:
    """Return how much of a box lies outside of another, pixels squared."""
    shared = Bbox.intersection(box, room)
    area = box.width * box.height
    return area - (shared.width * shared.height if shared is not None else 0.0)


def _shared(box: Bbox, other: Bbox, air: float) -> float:
    found = Bbox.intersection(box.padded(air), other)
    return 0.0 if found is None else found.width * found.height
