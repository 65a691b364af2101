"""How every picture looks: one width, readable type, lines that need no color (extra ``plot``).

The colors are those of Okabe and Ito (2008), *Color universal design*, which people with any of the
common color deficiencies tell apart; their yellow is left out, since it is faint on white.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

WIDTH = 7.36  # inches: the column of text of the site at 100 pixels an inch
DPI = 200  # two pixels of the file for each one that the site shows
NOTEBOOK_DPI = 110
SMALL, BODY = 8.0, 9.0  # points
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, INK = "#E69F00", "#56B4E9", "#000000"
FEW = 3  # decades on a logarithmic axis
GRAY = "#767676"  # of what is beside the point; 4.5 to 1 against white
COLORS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, INK)
MARKERS = "os^DvP<>X*"
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
PARAMETERS: Any = {
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), BODY),
    **dict.fromkeys(("figure.titlesize", "figure.labelsize"), BODY),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize"), SMALL),
    **dict.fromkeys(("legend.fontsize", "legend.title_fontsize"), SMALL),
    "legend.frameon": False,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.axisbelow": True,
    "grid.linewidth": 0.4,
    "grid.color": "#dddddd",
    "lines.linewidth": 1.4,
    "lines.markersize": 4.5,
    "axes.prop_cycle": f"cycler(color={list(COLORS)})",
    "mathtext.default": "regular",
    "svg.hashsalt": "seqopt",
}
styled = mpl.rc_context(PARAMETERS)  # a decorator of what draws; others keep their own settings


class _Picture(Figure):
    """A figure that pyplot does not manage: it is shown once, where it is returned."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=NOTEBOOK_DPI)
        return buffer.getvalue()


def new_picture(width: float, height: float, layout: Any = None) -> Figure:
    """Return an empty figure, inches, that a notebook shows where it is returned."""
    layout = layout or ConstrainedLayoutEngine(h_pad=0.08, w_pad=0.06)
    return _Picture(figsize=(width, height), layout=layout)


@dataclass(frozen=True)
class Look:
    """How one series is drawn."""

    color: str
    marker: str
    dashes: Any

    def line(self) -> dict[str, Any]:
        """Return arguments of `matplotlib.axes.Axes.plot` for a line with marks."""
        return {"color": self.color, "marker": self.marker, "ls": self.dashes}

    def mark(self, *, filled: bool = True) -> dict[str, Any]:
        """Return arguments of `matplotlib.axes.Axes.plot` for marks alone."""
        face = self.color if filled else "white"
        return {"color": self.color, "marker": self.marker, "ls": "none", "mfc": face}


def look(number: int) -> Look:
    """Return the look of a series, by its number from 0: the first 70 all differ."""
    return Look(*(each[number % len(each)] for each in (COLORS, MARKERS, DASHES)))


def looks(names: Iterable[str]) -> dict[str, Look]:
    """Return the look of every series of a chart."""
    return {name: look(number) for number, name in enumerate(dict.fromkeys(names))}


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure, inches, as wide as the site shows it by default."""
    return new_picture(width, height, "constrained")


def dress(*panels: Axes) -> None:
    """Give charts their grid, and no frame where there is no axis."""
    for axes in panels:
        axes.grid(visible=True, which="major", lw=0.4, color="#dddddd")
        axes.spines[["top", "right"]].set_visible(False)


def plain(*axes: Axis) -> None:
    """Write the numbers of logarithmic axes as people do: 0.01, 1, 500.

    Powers of ten stand for many zeros. Between two decades also 2 and 5 are labeled, where fewer
    than three would be.
    """

    def in_full(value: float, _: object) -> str:
        if 1e-4 <= value < 1e6:
            return f"{value:,g}"
        power = int(np.floor(np.log10(value) + 0.01))
        digit = round(value / 10.0**power)
        return f"${'' if digit == 1 else f'{digit}·'}10^{{{power}}}$"

    for axis in axes:
        low, high = axis.get_view_interval()
        few = np.floor(np.log10(high)) - np.ceil(np.log10(low)) < FEW - 1
        axis.set_major_locator(LogLocator(subs=(1, 2, 5) if few else (1,)))
        axis.set_major_formatter(FuncFormatter(in_full))
        axis.set_minor_locator(NullLocator())


@styled
def picture_files(name: str, figure: Figure) -> dict[str, bytes]:
    """Return a figure as PNG and as SVG by file name, always with the same bytes."""
    out = {}
    for ending, about in (("png", {"Software": None}), ("svg", {"Date": None})):
        buffer = io.BytesIO()
        figure.savefig(buffer, format=ending, dpi=DPI, metadata=about)
        out[f"{name}.{ending}"] = buffer.getvalue()
    return out
