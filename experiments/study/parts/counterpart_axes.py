"""What every picture of the counterparts is made of: rows of an item, colors, looks of axes."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes

from seqopt.report.style import BLUE, INK, VERMILION, dress

OURS, STUDY, OFF = BLUE, "#222222", VERMILION


def of(table: pd.DataFrame, label: str, quantity: str = "") -> pd.DataFrame:
    """Return the rows of an item, or of one of its quantities."""
    rows = table[table["id"] == label]
    return rows[rows["quantity"] == quantity] if quantity else rows


def number_of(rows: pd.DataFrame) -> pd.Series:
    """Return the numbers at the end of where the rows are: steps, tests, bricks."""
    return rows["at"].str.extract(r"(\d+)")[0].astype(int)


def tidy(axes: Axes) -> None:
    dress(axes)


def pair(axes: Axes, x: object, rows: pd.DataFrame, color: str = OURS, name: str = "") -> None:
    """Draw our values filled and printed ones around them; marks differ by color."""
    ours, ring = {OFF: ("^", "^"), INK: ("s", "s")}.get(color, (".", "o"))
    axes.plot(x, rows["ours"], ours, ms=4, color=color, ls="none", label=f"{name}here")
    axes.plot(x, rows["printed"], ring, ms=8, mfc="none", mew=1, color=color, ls="none",
              label=f"{name}printed")  # fmt: skip
