"""The chart of speed against regret, and of the parts of regret (extra ``plot``)."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import NullLocator

from seqopt.arrays import Floats
from seqopt.graph.formulation import Finding
from seqopt.report._regret._table import LOST, PARTS, RegretTable, _short, percent, seconds_text
from seqopt.report._style import GREEN, INK, SMALL, WIDTH, dress, look, new_figure, plain, styled
from seqopt.sequence.rules import FREE

ENGINES = ("compliance", "rigid grips", "frame", "discrete")  # in the order of their looks
MARKS = {"loop": ("o", "the loop"), FREE: ("s", "the free schedule")}
PALE = 0.28
LEAST = 1e-6  # what is less is drawn in the band of none
MOST = 1e-3  # from which on an axis is logarithmic, unless regrets are less
LINE, FEW_TICKS = 24, 6  # letters of a line beside a point, and ticks that stand side by side
ABOVE, BELOW = ((-12, 9), "baseline"), ((-4, -8), "top")  # points, from a point to its words
HALO = (withStroke(linewidth=2.5, foreground="white"),)
LETTER = 0.072  # inches of a letter of a title
INCUMBENT: dict[str, Any] = {"lw": 0.7, "ls": "-"}  # over time
BOUND: dict[str, Any] = {"lw": 0.9, "ls": ":"}


@styled
def regret_chart(*tables: RegretTable, width: float = WIDTH) -> Figure:
    """Return the chart of one scene, with the parts of regret, or of several side by side."""
    across = 1 if width < WIDTH or len(tables) == 1 else 2
    if len(tables) == 1:
        heights = [4.4, 0.6 + 0.36 * len(tables[0].alike)]
        figure = new_figure(0.7 + sum(heights), width)
        panels = figure.subplots(2, 1, height_ratios=heights)
        _draw_parts(panels[1], tables[0].alike)
        dress(panels[1])
    else:
        rows = -(-len(tables) // across)
        figure = new_figure(0.7 + 2.6 * rows, width)
        panels = figure.subplots(rows, across, squeeze=False).ravel()
        for axes in panels[len(tables) :]:
            axes.set_visible(False)
    for letter, axes, each in zip("abcdefgh", panels, tables, strict=False):
        _regrets(axes, each)
        took = each.take
        took_s = seconds_text(took["seconds"]).replace(" ", "\N{NO-BREAK SPACE}")
        words = f"take {took['engine']}, {_short(took)}: {took_s}"
        begin, end = (f"({letter}) ", "") if tables[1:] else ("", f", valued by {each.valued}")
        lines = [f"{begin}{each.scene}, {each.bricks} bricks{end}", words.replace("_", " ")]
        most = int((width / across - 0.6) / LETTER)
        axes.set_title("\n".join(textwrap.fill(line, most) for line in lines), fontsize=SMALL)
        lost = each.table[~np.isfinite(each.table["regret"].to_numpy(float))]
        counts = lost.groupby(["engine", "status"], sort=False).size().to_dict().items()
        lines = [f"{engine} {count} {LOST[status]}" for (engine, status), count in counts]
        without = textwrap.fill("no point: " * bool(lines) + ", ".join(lines), most - 6)
        axes.set_xlabel(f"time from scene to plan [s]\n{without}".strip(), fontsize=SMALL)
        dress(axes)
    _legend(figure, tables, 2 if width < WIDTH else 4)
    return figure


def _look(engine: str, schedule: str, *, filled: bool = True) -> dict[str, Any]:
    known = ENGINES.index(engine) if engine in ENGINES else len(ENGINES)
    return look(known).mark(filled=filled) | {"marker": MARKS[schedule][0]}


def _regrets(axes: Axes, table: RegretTable) -> None:
    """Draw regret over time, with words for each way that is not dominated."""
    seen = table.table.assign(kept=table.kept)
    seen = seen[np.isfinite(seen["regret"].to_numpy(float))]
    for name, row in seen.sort_values(["kept", "seconds"], ascending=[True, False]).iterrows():
        at = float(row["seconds"]), float(row["regret"])
        mark = _look(str(row["engine"]), str(row["schedule"]), filled=bool(row["exact"]))
        mark |= {"ms": 6.5, "zorder": 4} if row["kept"] else {"ms": 5.0, "alpha": PALE, "zorder": 3}
        axes.plot(*at, clip_on=False, **mark)
        if name == table.take.name:
            ring: dict[str, Any] = {"ms": 14, "mfc": "none", "mec": INK, "mew": 1.1, "zorder": 5}
            axes.plot(*at, "o", clip_on=False, **ring)
    kept = seen[seen["kept"]].sort_values("seconds")
    least = kept["regret"].cummin()  # no way lies below these steps
    axes.plot(kept["seconds"], least, color=INK, lw=0.8, drawstyle="steps-post", zorder=1)
    _draw_curves(axes, table)
    times = seen["seconds"]
    axes.set(xscale="log", xlim=(float(times.min()) / 2.2, 3.0 * float(times.max())))
    plain(axes.xaxis)
    _scale(axes, "y", seen["regret"].to_numpy(float), "proven 0" if table.is_proven else "0")
    axes.set_ylabel("regret")
    beside: dict[str, Any] = {"textcoords": "offset points", "fontsize": SMALL, "linespacing": 1.0}
    for _, row in table.front.iterrows():
        engine = f"{row['engine']}: " * (row["engine"] != table.reference)
        words = textwrap.fill(engine + _short(row).replace("_", " "), LINE)
        at = float(row["seconds"]), float(row["regret"])
        spot, va = BELOW if row["regret"] > LEAST and at[0] > kept["seconds"].min() else ABOVE
        text = axes.annotate(words, at, spot, va=va, path_effects=HALO, zorder=2, **beside)
        text.set_in_layout(False)


def _draw_curves(axes: Axes, table: RegretTable) -> None:
    """Draw incumbents of ways with the reference over time, and dotted how far bounds are below."""
    best = float(table.table["value"].min()) or 1.0
    for row, found in _drawn(table):
        start = max(float(row["seconds"]) - found[-1].seconds, 0.0)
        seconds = [start + each.seconds for each in found]
        color = _look(str(row["engine"]), str(row["schedule"]))["color"]
        how: dict[str, Any] = {"color": color, "alpha": 0.6, "drawstyle": "steps-post", "zorder": 1}
        above = np.array([each.objective for each in found]) / best - 1.0
        below = 1.0 - np.array([each.bound for each in found]) / best  # a loop's may be above
        for shares, line in ((above, INCUMBENT), (below, BOUND)):
            known = (shares > -LEAST) & np.isfinite(shares)
            axes.plot(seconds, np.where(known, shares, np.nan), **how | line)


def _drawn(table: RegretTable) -> Iterator[tuple[pd.Series[float], Sequence[Finding]]]:
    """Yield the ways with the reference that told several incumbents or bounds, and these."""
    for (_, row), found in zip(table.table.iterrows(), table.curves, strict=False):
        own = row["engine"] == table.reference and not row["without"]
        if own and len(found) > 1 and np.isfinite(float(row["regret"])):
            yield row, found


def _draw_parts(axes: Axes, rows: pd.DataFrame) -> None:
    """Draw regret, proven gap and error of the model, a line for each way, its name above it."""
    for line, (_, row) in enumerate(rows.iterrows()):
        for name, (marker, _) in PARTS.items():
            mark = _look(str(row["engine"]), str(row["schedule"]), filled=name == "regret")
            mark |= {"marker": marker, "ms": 6 if name == "regret" else 12}
            axes.plot(row[name] if np.isfinite(row[name]) else np.nan, line, clip_on=False, **mark)
        more = f" and {row['ways'] - 1} more" * (row["ways"] > 1)
        words = f"{row['engine']}, {row['schedule']}: {_short(row).replace('_', ' ')}{more}"
        place: Any = {"transform": axes.get_yaxis_transform(), "path_effects": HALO}
        axes.text(0.01, line + 0.28, words, fontsize=SMALL, **place)
    axes.set_yticks(range(len(rows)), [])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(-0.5, len(rows) - 0.2)
    _scale(axes, "x", rows[[*PARTS]].to_numpy(float).ravel(), "0")
    axes.set(xlabel="share of the worst step", title="what regret is made of, way by way")


def _scale(axes: Axes, name: str, shares: Floats, zero: str) -> None:
    """Give an axis of shares decades from that of the least one on, and a colored band of none."""
    shown = shares[np.isfinite(shares) & (shares > LEAST)]
    low = np.floor(np.log10(shown.min(initial=MOST)))
    high = max(float(shown.max(initial=0.0)), 10.0 ** (low + 2))
    powers = np.arange(low, np.ceil(np.log10(high)) + 1)
    ticks = 10.0 ** (powers[1::2] if name == "x" and len(powers) > FEW_TICKS else powers)
    getattr(axes, f"set_{name}scale")("symlog", linthresh=10.0**low, linscale=0.6)
    axes.set(**{f"{name}lim": (-(10.0**low), 10.0 * high)})
    axis, span = getattr(axes, f"{name}axis"), axes.axvspan if name == "x" else axes.axhspan
    axis.set_ticks([0.0, *ticks], labels=[zero, *map(percent, ticks)])
    axis.set_minor_locator(NullLocator())
    span(-(10.0**low), 0.6 * 10.0**low, color=GREEN, alpha=0.13, lw=0, zorder=0)


def _legend(figure: Figure, tables: Sequence[RegretTable], across: int) -> None:
    """Draw the legend: engines, schedules and marks."""
    present = dict.fromkeys(str(name) for each in tables for name in each.table["engine"])
    marks = [Line2D([], [], label=name, **_look(name, FREE) | {"marker": "o"}) for name in present]
    mark: dict[str, Any] = {"ls": "none", "color": INK}
    marks += [Line2D([], [], **mark, marker=m, label=words) for m, words in MARKS.values()]
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
        marks += [Line2D([], [], **mark, marker=m, label=words) for m, words in PARTS.values()]
    figure.legend(handles=marks, loc="outside lower center", ncols=across)
