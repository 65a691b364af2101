"""The chart of speed against regret (extra ``plot``)."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from seqopt.arrays import Floats
from seqopt.report._regret._table import (
    CUT,
    DONE,
    FAILED,
    FALLS,
    NAMED,
    RegretTable,
    percent,
    seconds_text,
)
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
from seqopt.sequence.rules import FREE

RADII = (7, 12, 20, 30, 42, 56, 72, 90)  # points, from a point to its words
DEGREES = (0, 45, 90, 315, 135, 270, 180, 225, 20, 70, 340, 290, 110, 160, 250, 200)
SPOTS = np.array(
    [(r * np.cos(angle), r * np.sin(angle)) for r in RADII for angle in np.radians(DEGREES)]
)  # the nearest and those beside first
FAR = 16  # from where on a line leads to them
ROOM = 4.0  # half of the size of a point, in points
AIR = 1.5  # points between two texts
SIDES: tuple[Any, ...] = (("left", "center", "right"), ("bottom", "center", "top"))


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
    """Write labels around points that are taken, the needed ones first.

    Each stands at the first spot that is free; where none is, needed words go where they cover
    least, others nowhere.
    """
    FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]  # which settles where everything is
    scale = figure.dpi / 72
    points = np.array([axes.transData.transform((x, y)) for axes, x, y in taken]).reshape(-1, 2)
    texts = [text.get_window_extent().extents for axes in figure.axes for text in axes.texts]
    boxes = np.vstack([np.hstack([points - ROOM * scale, points + ROOM * scale]), *texts])
    for label in sorted(labels, key=lambda each: not each.needed):
        beside: Any = {"textcoords": "offset points", "fontsize": SMALL, "linespacing": 1.0}
        color = INK if label.needed else GRAY
        text = label.axes.annotate(label.words, label.at, (0, 0), color=color, **beside)
        text.set_in_layout(False)
        size = np.array(text.get_window_extent().size)
        before = np.select([SPOTS > 1, SPOTS < -1], [0.0, 1.0], 0.5)  # share before the anchor
        low = label.axes.transData.transform(label.at) + SPOTS * scale - size * before
        spots, air = np.hstack([low, low + size]), AIR * scale * np.array([-1, -1, 1, 1])
        inside = np.array([label.axes.get_window_extent().extents])
        outside = (spots[:, 2:] - spots[:, :2]).prod(axis=1) - _shared(spots, inside)
        covered = outside + _shared(spots + air, boxes)
        best = int(covered.argmin())
        if covered[best] > 0 and not label.needed:
            text.remove()
            continue
        dx, dy = SPOTS[best].tolist()
        text.set_position((dx, dy))
        ha, va = (names[int(2 * share)] for names, share in zip(SIDES, before[best], strict=True))
        text.set(ha=ha, va=va)
        if float(np.hypot(dx, dy)) > FAR:
            line = {"arrowstyle": "-", "lw": 0.5, "color": GRAY, "shrinkA": 0, "shrinkB": 4}
            how: Any = {"textcoords": "offset points", "arrowprops": line}
            label.axes.annotate("", label.at, (dx, dy), **how).set_in_layout(False)
        boxes = np.vstack([boxes, spots[best]])


def _shared(boxes: Floats, others: Floats) -> Floats:
    """Return how much of boxes (n, 4) others (m, 4) cover, each by itself, pixels squared, (n,)."""
    low = np.maximum(boxes[:, None, :2], others[:, :2])
    high = np.minimum(boxes[:, None, 2:], others[:, 2:])
    return np.asarray((high - low).clip(min=0.0).prod(axis=2).sum(axis=1))


ENGINES = ("compliance", "rigid grips", "frame", "discrete")  # in the order of their looks
MARKS = {"loop": "o", FREE: "s"}
PALE = 0.28
LEAST = 1e-6  # regret from which on the axis is logarithmic; less is drawn in the band of none
NONE = LEAST / 6
LINE = 24  # letters of a line beside a point
LETTER = 0.072  # inches of a letter of a title
LOST = {CUT: "stopped", FAILED: "without a plan", FALLS: "fall", DONE: "not allowed"}


@styled
def regret_chart(*tables: RegretTable, width: float = WIDTH) -> Figure:
    """Return the chart of one scene, or of several side by side."""
    across = 1 if width < WIDTH or len(tables) == 1 else 2
    rows = -(-len(tables) // across)
    figure = new_figure(0.7 + (4.0 if len(tables) == 1 else 2.6) * rows, width)
    panels = figure.subplots(rows, across, squeeze=False).ravel()
    for axes in panels[len(tables) :]:
        axes.set_visible(False)
    marks = [_regrets(axes, each) for axes, each in zip(panels, tables, strict=False)]
    for axes, each in zip(panels, tables, strict=False):
        took = each.take
        words = f"take {took['engine']}, {_words(took)}: {seconds_text(took['seconds'])}"
        valued = f", valued by {each.valued}" if len(tables) == 1 else ""
        lines = [f"{each.scene}, {each.bricks} bricks{valued}", words]
        most = int((width / across - 0.6) / LETTER)
        title = "\n".join(textwrap.fill(line, most) for line in lines)
        axes.set_title(title, fontsize=SMALL)
    shown = panels[: len(tables)]
    dress(*shown)
    if len(tables) > 1:
        name_panels(*shown)
    _legend(figure, tables, 2 if width < WIDTH else 4)
    for labels, taken in marks:
        place(figure, labels, taken)
    return figure


def _words(row: pd.Series[float]) -> str:
    words = str(row["formulation"]).replace("_", " ")
    return f"{words}, {row['without']}" if row["without"] else words


def _look(engine: str, schedule: str, *, filled: bool = True) -> dict[str, Any]:
    known = ENGINES.index(engine) if engine in ENGINES else len(ENGINES)
    return look(known).mark(filled=filled) | {"marker": MARKS[schedule]}


def _height(regret: float) -> float:
    return regret if regret >= LEAST else NONE


def _regrets(axes: Axes, table: RegretTable) -> tuple[list[Label], list[tuple[Axes, float, float]]]:
    """Draw regret over time; return words for points, and where these are."""
    seen = table.table.assign(kept=table.kept)
    seen = seen[np.isfinite(seen["regret"].to_numpy(float))].sort_values(
        ["kept", "seconds"], ascending=[True, False]
    )
    taken, labels, named = (
        list[tuple[Axes, float, float]](),
        list[Label](),
        set[tuple[float, str]](),
    )
    for name, row in seen.iterrows():
        kept, at = bool(row["kept"]), (float(row["seconds"]), _height(float(row["regret"])))
        mark = _look(str(row["engine"]), str(row["schedule"]), filled=bool(row["exact"]))
        how: dict[str, Any] = {"ms": 6.5, "zorder": 3} if kept else {"ms": 5.0, "alpha": PALE}
        axes.plot(*at, clip_on=False, **mark, **how)
        taken.append((axes, *at))
        if name == table.take.name:
            ring: dict[str, Any] = {"ms": 14, "mfc": "none", "mec": INK, "mew": 1.1, "zorder": 4}
            axes.plot(*at, "o", clip_on=False, **ring)
    for _, row in seen[::-1].iterrows():
        key = round(float(row["regret"]), 4), str(row["engine"])
        if key not in named:
            named.add(key)
            at = float(row["seconds"]), _height(float(row["regret"]))
            engine = f"{row['engine']}: " * (row["engine"] != table.reference)
            words = textwrap.fill(engine + _words(row), LINE)
            labels.append(Label(axes, at, words, bool(row["kept"])))
    kept = seen[seen["kept"]][::-1]  # no way lies below these steps
    steps: dict[str, Any] = {"color": INK, "lw": 0.8, "drawstyle": "steps-post", "zorder": 1}
    axes.plot(kept["seconds"], kept["regret"].cummin().map(_height), **steps)
    _scales(axes, table, seen)
    return labels, taken


def _scales(axes: Axes, table: RegretTable, seen: pd.DataFrame) -> None:
    """Give axes their limits, a band of no regret, and the number of ways without a point."""
    times, most = seen["seconds"], max(float(seen["regret"].max()), 100 * LEAST)
    axes.set(xscale="log", yscale="log", xlim=(float(times.min()) / 2.2, 3.0 * float(times.max())))
    axes.set(ylim=(NONE / 3, 4 * most), xlabel="time from scene to plan [s]", ylabel="regret")
    plain(axes.xaxis)
    ticks = [10.0**power for power in range(-6, int(np.ceil(np.log10(most))) + 1)]
    axes.set_yticks([NONE, *ticks], ["proven 0" if table.is_proven else "0", *map(percent, ticks)])
    axes.set_yticks([], minor=True)
    axes.axhspan(NONE / 3, 0.5 * LEAST, color=GREEN, alpha=0.13, lw=0, zorder=0)
    lost = table.table[~np.isfinite(table.table["regret"].to_numpy(float))]
    for line, ((engine, status), own) in enumerate(lost.groupby(["engine", "status"], sort=False)):
        words = f"{engine}: {len(own)} way{'s' * (len(own) > 1)} {LOST[str(status)]}"
        spot: dict[str, Any] = {"xycoords": "axes fraction", "ha": "right", "va": "top"}
        text = axes.annotate(words, (0.995, 0.99 - 0.07 * line), fontsize=SMALL, color=GRAY, **spot)
        text.set_in_layout(False)


def _legend(figure: Figure, tables: Sequence[RegretTable], across: int) -> None:
    """Draw the legend: engines, schedules and marks."""
    present = dict.fromkeys(str(name) for each in tables for name in each.table["engine"])
    marks = [Line2D([], [], label=name, **_look(name, FREE) | {"marker": "o"}) for name in present]
    mark: dict[str, Any] = {"ls": "none", "color": INK}
    marks += [Line2D([], [], **mark, marker=MARKS[kind], label=NAMED[kind]) for kind in MARKS]
    marks += [
        Line2D([], [], **mark, marker="o", mfc="white", label="not proven"),
        Line2D([], [], **mark, marker="o", alpha=PALE, label="dominated"),
        Line2D([], [], color=INK, lw=0.8, label="frontier"),
        Line2D([], [], **mark, marker="o", mfc="none", ms=11, label="take this"),
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=across)
