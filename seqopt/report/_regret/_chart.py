"""The chart of speed against regret, and of the parts of regret (extra ``plot``)."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from seqopt.graph.formulation import Finding
from seqopt.report._regret._table import (
    CUT,
    DONE,
    FAILED,
    FALLS,
    NAMED,
    USUAL_NAMES,
    RegretTable,
    near,
    percent,
    seconds_text,
)
from seqopt.report._style import (
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
LEAST = 1e-6  # what is less is drawn in the band of none
MOST = 1e-3  # from which on an axis is logarithmic, unless regrets are less
LINE = 24  # letters of a line beside a point
ABOVE, BELOW = ((-12, 9), "baseline"), ((-4, -8), "top")  # points, from a point to its words
HALO = (withStroke(linewidth=2.5, foreground="white"),)
LETTER = 0.072  # inches of a letter of a title
FEW_TICKS = 6
INCUMBENT: dict[str, Any] = {"lw": 0.7, "ls": "-"}  # over time
BOUND: dict[str, Any] = {"lw": 0.9, "ls": ":"}
PARTS = {"regret": "D", "gap": "|", "error": "x"}  # and their marks
LOST = {CUT: "stopped", FAILED: "without a plan", FALLS: "fall", DONE: "not allowed"}


@styled
def regret_chart(*tables: RegretTable, width: float = WIDTH) -> Figure:
    """Return the chart of one scene, with the parts of regret, or of several side by side."""
    across = 1 if width < WIDTH or len(tables) == 1 else 2
    if len(tables) == 1:
        parts = _alike(tables[0].table)
        heights = [4.4, 0.6 + 0.36 * len(parts)]
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
        without = textwrap.fill(_without_point(each.table), most - 6)
        axes.set_xlabel(f"time from scene to plan [s]\n{without}".strip(), fontsize=SMALL)
    shown = panels[: len(tables)]
    dress(*shown)
    if len(tables) > 1:
        name_panels(*shown)
    _legend(figure, tables, 2 if width < WIDTH else 4)
    return figure


def _words(row: pd.Series[float]) -> str:
    words = str(row["formulation"]).replace("_", " ")
    return f"{words}, {row['without']}" if row["without"] else words


def _without_point(table: pd.DataFrame) -> str:
    """Return how many ways failed or were stopped, in words; the table names them, and why."""
    lost = table[~np.isfinite(table["regret"].to_numpy(float))]
    counts = lost.groupby(["engine", "status"], sort=False).size().to_dict().items()
    words = [f"{engine} {count} {LOST[status]}" for (engine, status), count in counts]
    return "no point: " * bool(words) + ", ".join(words)


def _look(engine: str, schedule: str, *, filled: bool = True) -> dict[str, Any]:
    known = ENGINES.index(engine) if engine in ENGINES else len(ENGINES)
    return look(known).mark(filled=filled) | {"marker": MARKS[schedule]}


def _alike(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row for the ways whose regret has the same parts, and how many; the best last."""
    own = table[np.isfinite(table["regret"].to_numpy(float))]
    own = own.assign(unusual=~own["formulation"].isin(USUAL_NAMES) | (own["without"] != ""))
    own = own.sort_values(["regret", "unusual", "seconds"])
    by = [own["engine"], own["schedule"], *(own[part].map(percent) for part in PARTS)]
    alike = own.groupby(by, sort=False)
    found: pd.DataFrame = alike.head(1).assign(ways=alike["regret"].size().to_numpy())[::-1]
    return found


def _least(values: Iterable[float]) -> float:
    """Return from where on an axis of shares is logarithmic: from the decade of the least one."""
    least = min((each for each in values if each > LEAST), default=MOST)
    return float(10.0 ** np.floor(np.log10(min(least, MOST))))


def _height(share: float, least: float) -> float:
    return max(share, least) if share > LEAST else least / 6


def _regrets(axes: Axes, table: RegretTable) -> None:
    """Draw regret over time, with words for each way that is not dominated."""
    seen = table.table.assign(kept=table.kept)
    seen = seen[np.isfinite(seen["regret"].to_numpy(float))].sort_values(
        ["kept", "seconds"], ascending=[True, False]
    )
    least = _least(seen["regret"])
    seen = seen.assign(height=[_height(float(each), least) for each in seen["regret"]])
    for name, row in seen.iterrows():
        at = float(row["seconds"]), float(row["height"])
        mark = _look(str(row["engine"]), str(row["schedule"]), filled=bool(row["exact"]))
        pale: dict[str, Any] = {"ms": 5.0, "alpha": PALE, "zorder": 3}
        axes.plot(*at, clip_on=False, **mark, **({"ms": 6.5, "zorder": 4} if row["kept"] else pale))
        if name == table.take.name:
            ring: dict[str, Any] = {"ms": 14, "mfc": "none", "mec": INK, "mew": 1.1, "zorder": 5}
            axes.plot(*at, "o", clip_on=False, **ring)
    kept = seen[seen["kept"]][::-1]  # no way lies below these steps
    steps: dict[str, Any] = {"color": INK, "lw": 0.8, "drawstyle": "steps-post", "zorder": 1}
    axes.plot(kept["seconds"], kept["height"].cummin(), **steps)
    _draw_curves(axes, table, least)
    _scales(axes, table, seen, least)
    beside: dict[str, Any] = {"textcoords": "offset points", "fontsize": SMALL, "linespacing": 1.0}
    front = kept[kept["regret"] <= kept["regret"].cummin()]
    front = front.sort_index(key=lambda names: names != table.take.name, kind="stable")
    for _, row in front[~near(front["height"]).duplicated()].iterrows():  # else words overlap
        engine = f"{row['engine']}: " * (row["engine"] != table.reference)
        words = textwrap.fill(engine + _words(row), LINE)
        at = float(row["seconds"]), float(row["height"])
        spot, va = BELOW if row["regret"] > LEAST and at[0] > kept["seconds"].min() else ABOVE
        text = axes.annotate(words, at, spot, va=va, path_effects=HALO, zorder=2, **beside)
        text.set_in_layout(False)


def _draw_curves(axes: Axes, table: RegretTable, least: float) -> None:
    """Draw incumbents of ways with the reference over time, and dotted how far bounds are below."""
    best = float(table.table["value"].min()) or 1.0
    for row, found in _drawn(table):
        start = max(float(row["seconds"]) - found[-1].seconds, 0.0)
        seconds = [start + each.seconds for each in found]
        color = _look(str(row["engine"]), str(row["schedule"]))["color"]
        how: dict[str, Any] = {"color": color, "alpha": 0.6, "drawstyle": "steps-post", "zorder": 1}
        above = [each.objective / best - 1.0 for each in found]
        below = [1.0 - each.bound / best for each in found]
        for shares, line in ((above, INCUMBENT), (below, BOUND)):
            known = [-LEAST < each < np.inf for each in shares]  # a loop's bound may be above
            heights = np.where(known, [_height(each, least) for each in shares], np.nan)
            axes.plot(seconds, heights, **how | line)


def _drawn(table: RegretTable) -> Iterator[tuple[pd.Series[float], Sequence[Finding]]]:
    """Yield the ways with the reference that told several incumbents or bounds, and these."""
    for (_, row), found in zip(table.table.iterrows(), table.curves, strict=False):
        own = row["engine"] == table.reference and not row["without"]
        if own and len(found) > 1 and np.isfinite(float(row["regret"])):
            yield row, found


def _draw_parts(axes: Axes, rows: pd.DataFrame) -> None:
    """Draw regret, proven gap and error of the model, a line for each way, its name above it."""
    shares = rows[[*PARTS]].to_numpy(float)
    shares = shares[np.isfinite(shares)]
    least = _least(shares)
    most = max(100 * least, *shares)
    for line, (_, row) in enumerate(rows.iterrows()):
        for name, marker in PARTS.items():
            value = float(row[name])
            if np.isfinite(value):
                mark = _look(str(row["engine"]), str(row["schedule"]), filled=name == "regret")
                at = _height(value, least), line
                size = 6 if name == "regret" else 10
                axes.plot(*at, clip_on=False, ms=size, **mark | {"marker": marker})
        more = f" and {row['ways'] - 1} more" * (row["ways"] > 1)
        words = f"{row['engine']}, {row['schedule']}: {_words(row)}{more}"
        axes.text(least / 16, line + 0.28, words, fontsize=SMALL, path_effects=HALO)
    axes.set_yticks(range(len(rows)), [])
    axes.tick_params(axis="y", length=0)
    axes.set(xscale="log", xlim=(least / 18, 4 * most), ylim=(-0.5, len(rows) - 0.2))
    _ticks(axes, axes.xaxis, least, most, "0")
    axes.set(xlabel="share of the worst step", title="what regret is made of, way by way")


def _ticks(axes: Axes, axis: Axis, least: float, most: float, zero: str) -> None:
    """Label decades and the band of none, which is colored."""
    powers = np.arange(np.log10(least), np.ceil(np.log10(most)) + 1)
    ticks = 10.0 ** (powers[1::2] if len(powers) > FEW_TICKS and axis is axes.xaxis else powers)
    axis.set_ticks([least / 6, *ticks], labels=[zero, *map(percent, ticks)])
    axis.set_ticks([], minor=True)
    span = axes.axvspan if axis is axes.xaxis else axes.axhspan
    span(least / 18, 0.5 * least, color=GREEN, alpha=0.13, lw=0, zorder=0)


def _scales(axes: Axes, table: RegretTable, seen: pd.DataFrame, least: float) -> None:
    """Give axes their limits, a band of no regret, and the number of ways without a point."""
    times, most = seen["seconds"], max(float(seen["regret"].max()), 100 * least)
    axes.set(xscale="log", yscale="log", xlim=(float(times.min()) / 2.2, 3.0 * float(times.max())))
    axes.set(ylim=(least / 18, 12 * most), ylabel="regret")
    plain(axes.xaxis)
    _ticks(axes, axes.yaxis, least, most, "proven 0" if table.is_proven else "0")


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
    if any(True for each in tables for _ in _drawn(each)):
        curves = (INCUMBENT, "incumbent"), (BOUND, "bound, below the best")
        marks += [Line2D([], [], color=INK, **line, label=words) for line, words in curves]
    if len(tables) == 1:
        words = {"regret": "regret", "gap": "proven gap", "error": "error of the model"}
        marks += [Line2D([], [], **mark, marker=each, label=words[n]) for n, each in PARTS.items()]
    figure.legend(handles=marks, loc="outside lower center", ncols=across)
