"""Small multiples: the error of every engine, a panel per limit."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from experiments.harness.plotting import new_figure, save_figure

REFUSED = 1e2  # where a refusal is drawn
FLOOR = 1e-16
PANELS = {
    "bricks": "Chain, free or with grips: bricks",
    "wall": "Wall in running bond: bricks",
    "slenderness": "25 bricks: length over width",
    "joint held": "One loose joint, three grips beyond it",
    "turning held": "The same, loose in turning only",
    "joint free": "One loose joint, nothing beyond it",
    "grips": "Grips at the tip of 100 bricks",
    "parted": "One joint missing: 12 bricks + 13 loose ones",
    "contrast": "Chain: bar over joint stiffness of the frame",
}
STYLES = {
    "frame": ("stiff-bar frame", "tab:orange", "s"),
    "direct": ("direct solve of the stiffness", "tab:green", "^"),
    "mixed": ("mixed solve: wrenches and motions", "tab:gray", "d"),
    "fast": ("fast engine", "tab:blue", "o"),
}
LOOSE = {"joint held", "turning held", "joint free"}
NAMED = {"grips", "parted"}


def chart(table: pd.DataFrame) -> None:
    figure = new_figure(11, 9.5)
    grid = figure.subplots(3, 3, sharey=True)
    for axes, (sweep, title) in zip(grid.ravel(), PANELS.items(), strict=True):
        part = table[table["sweep"] == sweep]
        for engine, group in part.groupby("engine", sort=False):
            for count, line in group.groupby("bricks" if sweep == "contrast" else "sweep"):
                _line(axes, str(engine), line.sort_values("value"), faint=count == 338)
        _dress(axes, sweep, part)
        axes.set_title(title, fontsize=10, loc="left")
    for axes in grid[:, 0]:
        axes.set_ylabel("largest relative error")
    grid[0, 0].set_ylim(FLOOR / 2, 10 * REFUSED)
    ticks = [10.0**p for p in range(-16, 1, 2)]
    grid[0, 0].set_yticks([*ticks, REFUSED], [f"1e{p}" for p in range(-16, 1, 2)] + ["refused"])
    handles, labels = grid[0, 0].get_legend_handles_labels()
    order = [labels.index(text) for text, _, _ in reversed(STYLES.values())]
    figure.legend(
        [handles[i] for i in order],
        [labels[i] for i in order],
        loc="outside lower center",
        ncols=4,
        frameon=False,
        fontsize=9,
    )
    save_figure(figure, "engine_limits.png")


def _line(axes: Axes, engine: str, rows: pd.DataFrame, *, faint: bool) -> None:
    """Draw one engine: a line where it answered every grip set, dashes where it refused some."""
    text, color, marker = STYLES[engine]
    x = rows["value"].to_numpy(float)
    solved = (rows["status"] == "solved").to_numpy()
    error = np.maximum(rows["error"].to_numpy(float), FLOOR)
    lane = REFUSED * {"fast": 3.0, "mixed": 1.4, "direct": 0.65, "frame": 0.3}[engine]
    named = rows["sweep"].iloc[0] in NAMED
    look = {"color": color, "ms": 4, "lw": 0 if named else 1.2, "alpha": 0.45 if faint else 1.0}
    shape = "none" if faint else None
    axes.plot(x, np.where(solved, error, np.nan), marker, ls="-", mfc=shape, label=text, **look)
    dashes = "none" if named else "--"
    some = np.where(solved, np.nan, error)  # of the grip sets that it answered all the same
    axes.plot(x, some, ls=dashes, marker=".", **{**look, "lw": 0 if named else 0.9})
    refused = np.where(solved, np.nan, lane)
    axes.plot(x, refused, "x", ls=dashes, **{**look, "lw": 0 if named else 0.9, "ms": 4})


def _dress(axes: Axes, sweep: str, part: pd.DataFrame) -> None:
    """Set scales and labels of one panel."""
    axes.set_yscale("log")
    axes.axhline(1e-9, color="k", lw=0.8, ls=":")
    if sweep == "bricks":
        axes.text(2, 2e-9, "promised to 100 bricks", fontsize=7, color="0.3")
    axes.axhspan(REFUSED / 8, 10 * REFUSED, color="0.95", zorder=0)
    axes.grid(visible=True, lw=0.2)
    axes.tick_params(labelsize=8)
    if sweep in NAMED:
        names = part.drop_duplicates("value").sort_values("value")
        axes.set_xticks(names["value"], names["label"], rotation=30, ha="right")
        axes.set_xlim(-0.5, len(names) - 0.5)
        return
    axes.set_xscale("log")
    if sweep in LOOSE:
        axes.invert_xaxis()
        axes.set_xlabel("stiffness over that of the other joints", fontsize=8)
    if sweep == "contrast":
        axes.text(3e6, 1e-4, "strong: 25 bricks\nfaint: 338 bricks", fontsize=8, color="0.3")
    if sweep == "wall":
        axes.set_xticks([10, 30, 100, 300], ["10", "30", "100", "300"])
        axes.xaxis.set_minor_locator(NullLocator())
