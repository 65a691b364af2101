"""The chart of speed against regret, and of the parts of regret (extra ``plot``)."""

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
    USUAL_NAMES,
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
from seqopt.report.text import in_words
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
PARTS = (
    ("regret", "D", "regret"),
    ("gap", "|", "proven gap"),
    ("error", "x", "error of the model"),
)


@styled
def regret_chart(*tables: RegretTable, width: float = WIDTH) -> Figure:
    """Return the chart of one scene, with the parts of regret, or of several side by side."""
    if len(tables) == 1:
        return _alone(tables[0], width)
    across = 1 if width < WIDTH else 2
    rows = -(-len(tables) // across)
    figure = new_figure(0.7 + 2.6 * rows, width)
    panels = figure.subplots(rows, across, squeeze=False).ravel()
    for axes in panels[len(tables) :]:
        axes.set_visible(False)
    marks = [_regrets(axes, each) for axes, each in zip(panels, tables, strict=False)]
    for axes, each in zip(panels, tables, strict=False):
        took = each.take
        words = f"take {took['engine']}, {_words(took)}: {seconds_text(took['seconds'])}"
        lines = textwrap.wrap(words, int((width / across - 0.6) / LETTER))
        axes.set_title("\n".join([f"{each.scene}, {each.bricks} bricks", *lines]), fontsize=SMALL)
    shown = panels[: len(tables)]
    dress(*shown)
    name_panels(*shown)
    _legend(figure, tables, 2 if width < WIDTH else 4)
    for labels, taken in marks:
        place(figure, labels, taken)
    return figure


def _alone(table: RegretTable, width: float) -> Figure:
    """Return the chart of one scene: regret over time, and its parts way by way."""
    own = table.table.assign(kept=table.kept)  # those not dominated, and defaults
    shown = (own["formulation"].isin(USUAL_NAMES) | own["kept"]) & np.isfinite(own["regret"])
    by = ["regret", "seconds"]
    parts = own[shown].sort_values(by, ascending=False, kind="stable")
    said = table.sentence.replace("_", " ")  # no name of the code
    lines = textwrap.wrap(said, int((width - 0.2) / LETTER), break_on_hyphens=False)
    figure = new_figure(4.3 + 0.15 * len(lines) + 0.3 * len(parts), width)
    figure.suptitle("\n".join(lines), x=0.01, ha="left")
    regrets, beside = figure.subplots(2, 1, height_ratios=[3.4, 0.45 + 0.3 * len(parts)])
    named = f"{table.scene}, {table.bricks} bricks, valued by {table.valued}"
    regrets.set_title(textwrap.fill(named, int((width - 1.0) / LETTER)))
    labels, taken = _regrets(regrets, table)
    _parts(beside, parts, 4 if width < WIDTH else 2)
    dress(regrets, beside)
    name_panels(regrets, beside)
    _legend(figure, [table], 2 if width < WIDTH else 4)
    place(figure, labels, taken)
    return figure


def _words(row: pd.Series[float]) -> str:
    words = in_words(str(row["formulation"])).replace("_", " ")
    words = words.replace("dynamic programming", "dyn. programming")
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
    _curves(axes, table)
    _scales(axes, table, seen)
    return labels, taken


def _curves(axes: Axes, table: RegretTable) -> None:
    """Draw incumbents of ways with the reference over time, and their gaps."""
    for at, findings in table.curves.items():
        row = table.table.iloc[at]
        known = len(findings) > 1 and np.isfinite(row["regret"])
        if not known or row["engine"] != table.reference or row["without"]:
            continue
        best = float(table.table["value"].min()) or 1.0
        start = max(float(row["seconds"]) - findings[-1].seconds, 0.0)
        seconds = [start + each.seconds for each in findings]
        color = _look(str(row["engine"]), str(row["schedule"]))["color"]
        how: dict[str, Any] = {"color": color, "lw": 0.7, "alpha": 0.6, "drawstyle": "steps-post"}
        above = [_height(each.objective / best - 1.0) for each in findings]
        below = [_height(1.0 - each.bound / best) for each in findings]
        axes.plot(seconds, np.where(np.isfinite(above), above, np.nan), zorder=1, **how)
        axes.plot(seconds, np.where(np.isfinite(below), below, np.nan), zorder=1, ls=":", **how)


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


def _parts(axes: Axes, rows: pd.DataFrame, decades: int) -> None:
    """Draw regret, proven gap and error of the model, a line for each way; ticks by decades."""
    for line, (_, row) in enumerate(rows.iterrows()):
        for name, marker, _ in PARTS:
            value = float(row[name])
            if np.isfinite(value):
                mark = _look(str(row["engine"]), str(row["schedule"]), filled=name == "regret")
                axes.plot(_height(value), line, clip_on=False, ms=6, **mark | {"marker": marker})
        name = f"{row['engine']}, {row['schedule']}: {_words(row)}"
        above: dict[str, Any] = {"xytext": (1, 6), "textcoords": "offset points", "fontsize": SMALL}
        text = axes.annotate(name, (0.0, line), xycoords=("axes fraction", "data"), **above)
        text.set_in_layout(False)
    axes.set_yticks([])
    axes.set(xscale="log", xlabel="share of the worst step", ylim=(-0.5, len(rows) + 0.1))
    shares = rows[[name for name, *_ in PARTS]].to_numpy(float)
    most = max(float(np.nanmax(np.where(np.isfinite(shares), shares, np.nan))), 100 * LEAST)
    ticks = [10.0**power for power in range(-4, int(np.ceil(np.log10(most))) + 1, decades)]
    axes.set_xticks([NONE, *ticks], ["0", *map(percent, ticks)])
    axes.set_xticks([], minor=True)
    axes.set(xlim=(NONE / 3, 4 * most), title="what regret is made of, way by way")
    axes.axvspan(NONE / 3, 0.5 * LEAST, color=GREEN, alpha=0.13, lw=0, zorder=0)


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
    if len(tables) == 1:
        marks += [Line2D([], [], **mark, marker=each, label=label) for _, each, label in PARTS]
    figure.legend(handles=marks, loc="outside lower center", ncols=across)
