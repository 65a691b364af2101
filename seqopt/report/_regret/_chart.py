"""The chart of speed against regret, and of the parts of regret (extra ``plot``)."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

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
from seqopt.sequence.rules import FREE

ENGINES = ("compliance", "rigid grips", "frame", "discrete")  # in the order of their looks
MARKS = {"loop": "o", FREE: "s"}
PALE = 0.28
LEAST = 1e-6  # regret from which on the axis is logarithmic; less is drawn in the band of none
NONE = LEAST / 6
LINE = 24  # letters of a line beside a point
SPOT = (-12, 9)  # points, from a point to its words
HALO = (withStroke(linewidth=2.5, foreground="white"),)
LETTER = 0.072  # inches of a letter of a title
PARTS = {"regret": "D", "gap": "|", "error": "x"}  # and their marks
LOST = {CUT: "stopped", FAILED: "without a plan", FALLS: "fall", DONE: "not allowed"}


@styled
def regret_chart(*tables: RegretTable, width: float = WIDTH) -> Figure:
    """Return the chart of one scene, with the parts of regret, or of several side by side."""
    across = 1 if width < WIDTH or len(tables) == 1 else 2
    if len(tables) == 1:
        whole = tables[0].table  # drawn are ways that are not dominated, or usual, the best last
        own = whole[tables[0].kept | whole["formulation"].isin(USUAL_NAMES)]
        own = own[np.isfinite(own["regret"].to_numpy(float))]
        parts: pd.DataFrame = own.sort_values(["regret", "seconds"])[::-1]
        heights = [4.4, 0.6 + 0.28 * len(parts)]
        figure = new_figure(0.7 + sum(heights), width)
        panels = figure.subplots(2, 1, height_ratios=heights)
        _draw_parts(panels[1], parts)
        dress(panels[1])
    else:
        rows = -(-len(tables) // across)
        figure = new_figure(0.7 + 2.6 * rows, width)
        panels = figure.subplots(rows, across, squeeze=False).ravel()
        for axes in panels[len(tables) :]:
            axes.set_visible(False)
    for axes, each in zip(panels, tables, strict=False):
        _regrets(axes, each)
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
    return figure


def _words(row: pd.Series[float]) -> str:
    words = str(row["formulation"]).replace("_", " ")
    return f"{words}, {row['without']}" if row["without"] else words


def _look(engine: str, schedule: str, *, filled: bool = True) -> dict[str, Any]:
    known = ENGINES.index(engine) if engine in ENGINES else len(ENGINES)
    return look(known).mark(filled=filled) | {"marker": MARKS[schedule]}


def _height(regret: float) -> float:
    return regret if regret >= LEAST else NONE


def _regrets(axes: Axes, table: RegretTable) -> None:
    """Draw regret over time, with words for each way that is not dominated."""
    seen = table.table.assign(kept=table.kept)
    seen = seen[np.isfinite(seen["regret"].to_numpy(float))].sort_values(
        ["kept", "seconds"], ascending=[True, False]
    )
    for name, row in seen.iterrows():
        kept, at = bool(row["kept"]), (float(row["seconds"]), _height(float(row["regret"])))
        mark = _look(str(row["engine"]), str(row["schedule"]), filled=bool(row["exact"]))
        how: dict[str, Any] = {"ms": 6.5, "zorder": 3} if kept else {"ms": 5.0, "alpha": PALE}
        axes.plot(*at, clip_on=False, **mark, **how)
        if name == table.take.name:
            ring: dict[str, Any] = {"ms": 14, "mfc": "none", "mec": INK, "mew": 1.1, "zorder": 4}
            axes.plot(*at, "o", clip_on=False, **ring)
    kept = seen[seen["kept"]][::-1]  # no way lies below these steps
    steps: dict[str, Any] = {"color": INK, "lw": 0.8, "drawstyle": "steps-post", "zorder": 1}
    axes.plot(kept["seconds"], kept["regret"].cummin().map(_height), **steps)
    _draw_curves(axes, table)
    _scales(axes, table, seen)
    beside: dict[str, Any] = {"textcoords": "offset points", "fontsize": SMALL, "linespacing": 1.0}
    front = kept[kept["regret"] <= kept["regret"].cummin()]
    near = (2 * np.log10(front["regret"].map(_height))).round()  # whose words would overlap
    for _, row in front[~near.duplicated()].iterrows():
        engine = f"{row['engine']}: " * (row["engine"] != table.reference)
        words = textwrap.fill(engine + _words(row), LINE)
        at = float(row["seconds"]), _height(float(row["regret"]))
        text = axes.annotate(words, at, SPOT, path_effects=HALO, zorder=5, **beside)
        text.set_in_layout(False)


def _draw_curves(axes: Axes, table: RegretTable) -> None:
    """Draw incumbents of ways with the reference over time, and dotted what bounds leave open."""
    best = float(table.table["value"].min()) or 1.0
    for (_, row), found in zip(table.table.iterrows(), table.curves, strict=False):
        own = row["engine"] == table.reference and not row["without"]
        if not own or len(found) < 2 or not np.isfinite(float(row["regret"])):
            continue
        start = max(float(row["seconds"]) - found[-1].seconds, 0.0)
        seconds = [start + each.seconds for each in found]
        color = _look(str(row["engine"]), str(row["schedule"]))["color"]
        how: dict[str, Any] = {"color": color, "lw": 0.7, "alpha": 0.6, "zorder": 1}
        above = [each.objective / best - 1.0 for each in found]
        below = [1.0 - each.bound / best for each in found]
        for shares, line in ((above, "-"), (below, ":")):
            known = [_height(each) if np.isfinite(each) else np.nan for each in shares]
            axes.plot(seconds, known, line, drawstyle="steps-post", **how)


def _draw_parts(axes: Axes, rows: pd.DataFrame) -> None:
    """Draw regret, proven gap and error of the model, a line for each way."""
    most = 100 * LEAST
    for line, (_, row) in enumerate(rows.iterrows()):
        for name, marker in PARTS.items():
            value = float(row[name])
            if np.isfinite(value):
                most = max(most, value)
                mark = _look(str(row["engine"]), str(row["schedule"]), filled=name == "regret")
                axes.plot(_height(value), line, clip_on=False, ms=6, **mark | {"marker": marker})
    lines = [f"{row['engine']}, {row['schedule']}: {_words(row)}" for _, row in rows.iterrows()]
    axes.set_yticks(range(len(rows)), lines, fontsize=SMALL)
    axes.set(xscale="log", xlim=(NONE / 3, 4 * most), ylim=(-0.6, len(rows) - 0.4))
    ticks = [10.0**power for power in range(-6, int(np.ceil(np.log10(most))) + 1, 2)]
    axes.set_xticks([NONE, *ticks], ["0", *map(percent, ticks)])
    axes.set_xticks([], minor=True)
    axes.set(xlabel="share of the worst step", title="what regret is made of, way by way")
    axes.axvspan(NONE / 3, 0.5 * LEAST, color=GREEN, alpha=0.13, lw=0, zorder=0)


def _scales(axes: Axes, table: RegretTable, seen: pd.DataFrame) -> None:
    """Give axes their limits, a band of no regret, and the number of ways without a point."""
    times, most = seen["seconds"], max(float(seen["regret"].max()), 100 * LEAST)
    axes.set(xscale="log", yscale="log", xlim=(float(times.min()) / 2.2, 3.0 * float(times.max())))
    axes.set(ylim=(NONE / 3, 60 * most), xlabel="time from scene to plan [s]", ylabel="regret")
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
    if len(tables) == 1:
        words = {"regret": "regret", "gap": "proven gap", "error": "error of the model"}
        marks += [Line2D([], [], **mark, marker=each, label=words[n]) for n, each in PARTS.items()]
    figure.legend(handles=marks, loc="outside lower center", ncols=across)
