"""What every picture of the counterparts is made of: rows of an item, colors, looks of axes."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes

OURS, STUDY, OFF = "#2166ac", "#222222", "#c8102e"


def of(table: pd.DataFrame, label: str, quantity: str = "") -> pd.DataFrame:
    """Return the rows of an item, or of one of its quantities."""
    rows = table[table["id"] == label]
    return rows[rows["quantity"] == quantity] if quantity else rows


def number(rows: pd.DataFrame) -> pd.Series:
    """Return the numbers at the end of where the rows are: steps, tests, bricks."""
    return rows["at"].str.extract(r"(\d+)")[0].astype(int)


def tidy(axes: Axes) -> None:
    axes.grid(visible=True, lw=0.2)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=7)


def pair(axes: Axes, x: object, rows: pd.DataFrame, color: str = OURS, name: str = "") -> None:
    """Draw our values filled and printed ones as rings."""
    axes.plot(x, rows["ours"], ".", ms=5, color=color, label=f"{name}here")
    axes.plot(x, rows["printed"], "o", ms=7, mfc="none", mew=0.8, color=color, label="printed")
