"""Small multiples: the error of every engine, a panel per limit."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from seqopt.report.style import BLUE, GRAY, GREEN, VERMILION, dress, new_figure, plain, styled

REFUSED = 1e2  # where a refusal is drawn
FLOOR = 1e-16
PANELS = {
    "bricks": ("chain, free or held", "bricks"),
    "wall": ("wall in running bond", "bricks"),
    "slenderness": ("25 slender bricks", "length over width"),
    "joint held": ("one loose joint,\nthree grips beyond it", "its stiffness over the others'"),
    "turning held": (
        "the same, loose\nin turning only",
        "its stiffness over the others'",
    ),
    "joint free": ("one loose joint,\nnothing beyond it", "its stiffness over the others'"),
    "grips": ("grips at the tip\nof 100 bricks", ""),
    "parted": ("one joint missing:\n12 and 13 bricks", ""),
    "contrast": ("chain; hollow: 338 bricks,\nfilled: 25", "bar over joint stiffness"),
}  # title and abscissa
STYLES = {
    "frame": ("stiff-bar frame", VERMILION, "s"),
    "direct": ("direct solve of the stiffness", GREEN, "^"),
    "mixed": ("mixed solve: forces and motions", GRAY, "d"),
    "fast": ("rigid bricks, fast engine", BLUE, "o"),
}
LOOSE = {"joint held", "turning held", "joint free"}
NAMED = {"grips", "parted"}


@styled
def chart(table: pd.DataFrame) -> Figure:
    figure = new_figure(8.4)
    grid = figure.subplots(3, 3, sharey=True)
    for axes, (sweep, (title, label)) in zip(grid.ravel(), PANELS.items(), strict=True):
        part = table[table["sweep"] == sweep]
        for engine, group in part.groupby("engine", sort=False):
            for count, line in group.groupby("bricks" if sweep == "contrast" else "sweep"):
                _line(axes, str(engine), line.sort_values("value"), faint=count == 338)
        _dress(axes, sweep, part)
        axes.set(title=title, xlabel=label)
    for axes in grid[:, 0]:
        axes.set_ylabel("largest relative error")
    grid[0, 0].set_ylim(FLOOR / 2, 10 * REFUSED)
    ticks = [10.0**p for p in range(-16, 1, 4)]
    grid[0, 0].set_yticks(
        [*ticks, REFUSED], [f"1e{p}" for p in range(-16, 0, 4)] + ["1", "refused"]
    )
    handles, labels = grid[0, 0].get_legend_handles_labels()
    order = [labels.index(text) for text, _, _ in reversed(STYLES.values())]
    key = [handles[i] for i in order]
    key.append(Line2D([], [], color="k", lw=0.9, ls="--", label="refused some sets of grips"))
    key.append(Line2D([], [], color="k", lw=0.8, ls=":", label="1e-9: promised to 100 bricks"))
    figure.legend(handles=key, loc="outside lower center", ncols=3)
    return figure


def _line(axes: Axes, engine: str, rows: pd.DataFrame, *, faint: bool) -> None:
    """Draw one engine: a line where it answered every grip set, dashes where it refused some."""
    text, color, marker = STYLES[engine]
    x = rows["value"].to_numpy(float)
    solved = (rows["status"] == "solved").to_numpy()
    error = np.maximum(rows["error"].to_numpy(float), FLOOR)
    lane = REFUSED * {"fast": 3.0, "mixed": 1.4, "direct": 0.65, "frame": 0.3}[engine]
    named = rows["sweep"].iloc[0] in NAMED
    look = {"color": color, "ms": 4, "lw": 0 if named else 1.2, "markevery": 1 + len(x) // 12}
    shape = "white" if faint else None
    axes.plot(x, np.where(solved, error, np.nan), marker, ls="-", mfc=shape, label=text, **look)
    dashes = "none" if named else "--"
    some = np.where(solved, np.nan, error)  # of the grip sets that it answered all the same
    axes.plot(x, some, ls=dashes, marker=".", **{**look, "lw": 0 if named else 0.9})
    refused = np.where(solved, np.nan, lane)
    axes.plot(x, refused, "x", ls=dashes, **{**look, "lw": 0 if named else 0.9, "ms": 5})


def _dress(axes: Axes, sweep: str, part: pd.DataFrame) -> None:
    """Set the scales and ticks of one panel."""
    axes.set_yscale("log")
    axes.axhline(1e-9, color="k", lw=0.8, ls=":")
    axes.axhspan(REFUSED / 8, 10 * REFUSED, color="0.93", zorder=0)
    dress(axes)
    if sweep in NAMED:
        names = part.drop_duplicates("value").sort_values("value")
        axes.set_xticks(names["value"], names["label"], rotation=90, ha="right",
                        rotation_mode="anchor")  # fmt: skip
        axes.set_xlim(-0.5, len(names) - 0.5)
        return
    axes.set_xscale("log")
    if sweep in LOOSE:
        axes.invert_xaxis()
        axes.set_xticks([10.0**p for p in (0, -6, -12, -18)], ["1", "1e-6", "1e-12", "1e-18"])
    elif sweep == "contrast":
        axes.set_xticks([10.0**p for p in (2, 5, 8, 11)], ["1e2", "1e5", "1e8", "1e11"])
    else:
        plain(axes.xaxis)
    axes.xaxis.set_minor_locator(NullLocator())
