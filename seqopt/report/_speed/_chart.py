"""The chart of speed against accuracy: gap and error of responses over time (extra ``plot``)."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from seqopt.arrays import Floats
from seqopt.report._speed._table import CUT, DONE, FAILED, SpeedTable, error_text, seconds_text
from seqopt.report._style import (
    GRAY,
    GREEN,
    INK,
    SMALL,
    WIDTH,
    dress,
    look,
    name_panels,
    new_figure,
    plain,
    styled,
)
from seqopt.report.text import in_words

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
    others = np.array([other.extents for other in boxes]).reshape(-1, 4)
    best, least = None, np.inf
    for dx, dy in _spots():
        left = x + dx * scale - wide * _share(dx)
        low = y + dy * scale - high * _share(dy)
        box = Bbox.from_bounds(left, low, wide, high)
        covered = _outside(box, inside) + _shared(box.padded(AIR * scale), others)
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
        line = {"arrowstyle": "-", "lw": 0.5, "color": GRAY, "shrinkA": 0, "shrinkB": 4}
        found = label.axes.annotate(
            "", label.at, (dx, dy), textcoords="offset points", arrowprops=line
        )
        found.set_in_layout(False)
    return box


def _share(shift: float) -> float:
    """Return which share of a text lies before its anchor."""
    return 0.0 if shift > 1 else 1.0 if shift < -1 else 0.5


def _outside(box: Bbox, room: Bbox) -> float:
    """Return how much of a box lies outside of another, pixels squared."""
    shared = Bbox.intersection(box, room)
    area = box.width * box.height
    return area - (shared.width * shared.height if shared is not None else 0.0)


def _shared(box: Bbox, others: Floats) -> float:
    """Return how much of a box others cover, each by itself, pixels squared."""
    low, high = np.maximum(others[:, :2], box.min), np.minimum(others[:, 2:], box.max)
    return float((high - low).clip(min=0.0).prod(axis=1).sum())


ENGINES = ("compliance", "frame", "auto", "discrete", "planar")  # in the order of their looks
PALE = 0.28
NONE = 1e-9  # where an error of zero is drawn
LOST = {CUT: (">", "stopped"), FAILED: ("x", "failed"), DONE: ("^", "not allowed")}  # no point
LINE = 22  # letters of a line beside a point
NEAR = 1.35  # times of points that share words differ by less
LETTER = 0.072  # inches of a letter of a title
CORNER = 0.16  # share of a panel


@styled
def speed_chart(*speeds: SpeedTable, width: float = WIDTH) -> Figure:
    """Return the chart of one problem or of several, side by side: above gaps, below errors."""
    narrow = int((width - 0.7) / len(speeds) / LETTER)
    titles = [_title(speed, narrow, full=len(speeds) == 1) for speed in speeds]
    lines = max(title.count("\n") for title in titles)
    figure = new_figure(4.6 + 0.15 * lines + 0.7 * (width < WIDTH), width)
    panels = figure.subplots(
        2, len(speeds), sharex="col", sharey="row", squeeze=False, height_ratios=[3, 2]
    )
    labels, taken = list[Label](), list[tuple[Axes, float, float]]()
    for speed, title, (gaps, errors) in zip(speeds, titles, panels.T, strict=True):
        gaps.set_title(title, fontsize=SMALL if len(speeds) > 1 else None)
        errors.set_xlabel("time from scene to plan [s]")
        for axes, name in ((gaps, "gap"), (errors, "error")):
            taken += _points(axes, speed, name)
            labels += _named(axes, speed, name)
        _limits(speed, gaps, errors)
    _scales(panels, speeds)
    dress(*panels.ravel())
    if len(speeds) > 1:
        name_panels(*panels[0])
    _legend(figure, speeds, across=2 if width < WIDTH else 6)
    place(figure, labels, taken)
    return figure


def _title(speed: SpeedTable, width: int, *, full: bool) -> str:
    """Return what is built, and what to take, as lines."""
    took = speed.take
    what = f"{speed.scene}, {speed.bricks} bricks"
    if full:
        return "\n".join([what, *textwrap.wrap(speed.sentence, width, break_on_hyphens=False)])
    words = f"take {took['engine']} with {_words(took)}: {seconds_text(took['seconds'])}"
    return "\n".join([what, *textwrap.wrap(words, width, break_on_hyphens=False)])


def _words(row: pd.Series[float]) -> str:
    words = in_words(str(row["formulation"])).replace("_", " ")
    return words if row["proof"] else f"{words}, no proof"


def _look(engine: str, *, filled: bool = True) -> dict[str, Any]:
    known = ENGINES.index(engine) if engine in ENGINES else len(ENGINES)
    return look(known).mark(filled=filled)


def _height(name: str, values: pd.Series[float]) -> pd.Series[float]:
    """Return where gaps or errors are drawn: gaps in percent, no error at the foot of the axis."""
    return 100 * values if name == "gap" else values.clip(lower=NONE)


def _seen(speed: SpeedTable, name: str) -> pd.DataFrame:
    """Return the rows with a point, where it is, and whether another one beats it."""
    every: pd.DataFrame = speed.table.assign(kept=speed.kept)
    table = every[np.isfinite(every[name].to_numpy(float))]
    found: pd.DataFrame = table.assign(height=_height(name, table[name]))
    return found


def _points(axes: Axes, speed: SpeedTable, name: str) -> Iterator[tuple[Axes, float, float]]:
    """Draw a point for every plan, those that another one beats pale; yield where they are."""
    seen = _seen(speed, name).sort_values("kept")
    spots = pd.DataFrame({"x": np.log10(seen["seconds"]).round(2), "y": seen["height"]})
    spots = spots.join(seen[["engine", "exact", "kept"]])  # one pale point on another is not pale
    for _, row in seen[~spots.duplicated()].iterrows():
        alpha, size = (1.0, 6.5) if row["kept"] else (PALE, 5.5)
        mark = _look(str(row["engine"]), filled=bool(row["exact"]))
        at = float(row["seconds"]), float(row["height"])
        axes.plot(*at, **mark, ms=size, alpha=alpha, zorder=3 if row["kept"] else 2, clip_on=False)
        yield axes, *at
    took = speed.take
    at = float(took["seconds"]), float(_height(name, pd.Series([took[name]]))[0])
    axes.plot(*at, "o", ms=14, mfc="none", mec=INK, mew=1.1, zorder=4, clip_on=False)


def _named(axes: Axes, speed: SpeedTable, name: str) -> Iterator[Label]:
    """Yield words for points: above for formulations, each once a level; below for engines."""
    seen, named = _seen(speed, name).sort_values("seconds"), set[str]()
    took: Any = speed.take.name  # where in the table the row to take is
    for height, level in seen.groupby("height"):
        level = level.sort_values("kept", ascending=False, kind="stable")  # noqa: PLW2901
        if name == "error":
            first: pd.Series[float] = level.loc[took] if took in level.index else level.iloc[0]
            worst = float(level["error"].max())
            names = dict.fromkeys([str(first["engine"]), *level["engine"]])
            said = ", ".join(names) + (f": {error_text(worst)}" if worst else "")
            engines = textwrap.fill(said, LINE)
            if engines not in named:
                yield Label(axes, _at(first, height), engines, bool(first["kept"]))
            named.add(engines)
        else:
            yield from _named_once(axes, level, height, took)


def _at(row: pd.Series[float], height: object) -> tuple[float, float]:
    return float(row["seconds"]), float(str(height))


def _named_once(axes: Axes, level: pd.DataFrame, height: object, took: Any) -> Iterator[Label]:
    """Yield words for the formulations of one height, none of which is named twice."""
    said = set[str]()
    for own in _neighbors(level):
        first: pd.Series[float] = own.loc[took] if took in own.index else own.iloc[0]
        words = dict.fromkeys([_words(first), *(_words(row) for _, row in own.iterrows())])
        new = [each for each in words if each not in said]
        said |= {*words}
        if new:
            more = f"\nand {len(new) - 1} more" if len(new) > 1 else ""
            yield Label(axes, _at(first, height), new[0] + more, bool(first["kept"]))


def _neighbors(level: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Yield rows in groups: those close in time, of which another one beats all or none."""
    times, kept = level["seconds"].to_numpy(float), level["kept"].to_numpy(bool)
    apart = (times[1:] > NEAR * times[:-1]) | (kept[1:] != kept[:-1])
    for at in np.split(np.arange(len(times)), np.flatnonzero(apart) + 1):
        yield level.iloc[at]


def _limits(speed: SpeedTable, gaps: Axes, errors: Axes) -> None:
    """Draw the end of the time that each had, and say who has no point, and why."""
    table = speed.table[~np.isfinite(speed.table["gap"].to_numpy(float))]
    known = speed.table.drop(table.index)["seconds"]
    late = bool((table["status"] == CUT).any())
    high = max(float(known.max()), speed.limit * late)
    gaps.set(xscale="log", xlim=(float(known.min()) / 2.5, 2.2 * high))
    plain(gaps.xaxis)
    for axes in (gaps, errors) if late else ():
        axes.axvline(speed.limit, color=GRAY, lw=0.8, ls=":")
    across = gaps.get_xaxis_transform()
    for row, ((engine, status), own) in enumerate(table.groupby(["engine", "status"], sort=False)):
        at = (high, 0.95 - 0.085 * row)
        mark: dict[str, Any] = {**_look(str(engine), filled=False), "ms": 6}
        gaps.plot(*at, transform=across, clip_on=False, **mark | {"marker": LOST[str(status)][0]})
        words = f"{engine}: {len(own)} way{'s' * (len(own) > 1)} {LOST[str(status)][1]}"
        beside: dict[str, Any] = {"textcoords": "offset points", "ha": "right", "va": "center"}
        gaps.annotate(words, at, (-7, 0), across, fontsize=SMALL, color=GRAY, **beside)


def _scales(panels: np.ndarray, speeds: Sequence[SpeedTable]) -> None:
    """Let gaps begin at none, errors too, and mark the corner where both are best."""
    gaps = [100 * s.table["gap"].replace(np.inf, np.nan).max() for s in speeds]
    top = 1.45 * max(0.5, np.nanmax(gaps))
    errors = max(1e-2, *(float(s.table["error"].max()) for s in speeds))
    panels[0, 0].set(ylim=(-0.13 * top, top), ylabel="above the proven optimum [%]")
    panels[1, 0].set(yscale="log", ylim=(NONE / 30, 30 * errors), ylabel="error of responses")
    ticks = [10.0**power for power in range(-7, int(np.log10(errors)) + 1, 2)]
    panels[1, 0].set_yticks([NONE, *ticks], ["none", *(error_text(tick) for tick in ticks)])
    panels[1, 0].set_yticks([], minor=True)
    for axes in panels.ravel():
        size: dict[str, Any] = {
            "width": 2 * CORNER,
            "height": 2 * 1.4 * CORNER,
            "transform": axes.transAxes,
        }
        axes.add_patch(Ellipse((0, 0), **size, fc=GREEN, alpha=0.16, lw=0, zorder=0))


def _legend(figure: Figure, speeds: Sequence[SpeedTable], across: int) -> None:
    """Name the engines, and say what marks mean."""
    present = dict.fromkeys(name for speed in speeds for name in speed.table["engine"])
    marks = [Line2D([], [], label=name, **_look(name)) for name in present]
    plain_mark: dict[str, Any] = {"marker": "o", "ls": "none", "color": INK}
    marks += [
        Line2D([], [], **plain_mark, label="proves its plan"),
        Line2D([], [], **plain_mark, mfc="white", label="heuristic"),
        Line2D([], [], **plain_mark, alpha=PALE, label="beaten by another"),
        Line2D([], [], **plain_mark | {"mfc": "none", "ms": 11}, label="take this"),
        Line2D([], [], marker="s", ls="none", ms=9, color=GREEN, alpha=0.2, label="best corner"),
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=across)
