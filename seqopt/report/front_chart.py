"""The chart of a Pareto set: its first number against each of the others (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter, MaxNLocator, ScalarFormatter

from seqopt.report.front_numbers import shown, worst_of
from seqopt.report.style import GRAY, VERMILION, dress, new_figure, styled
from seqopt.report.wording import in_words

LABELS = {
    "F_largest": "largest grip force [N]",
    "M_sup": "support moment M_sup [N m]",
    "T_max": "tension T_max [N]",
    "C_max": "compression C_max [N]",
    "D_max": "displacement D_max [1e-3 mm]",
    "steps": "steps of the plan",
    "regrips": "regrips",
    "bond": "bond needed [kPa]",
    "friction": "friction needed",
    "tilt": "tilt survived [deg]",
}
MARKERS = "sD^vP*"
IN_A_ROW = 2  # charts
LEAST = 0.01  # share of its numbers that an axis spans at least
FAR = 2.5  # a method so much worse than the set makes an axis logarithmic


@styled
def drawn(
    table: pd.DataFrame,
    methods: Mapping[str, pd.DataFrame],
    beside: Mapping[str, pd.DataFrame],
) -> Figure:
    """Return the chart of the table of a Pareto set; see `seqopt.report.fronts.front_figure`.

    Parameters
    ----------
    table : pandas.DataFrame
        Of `seqopt.placement.front.Front`.
    methods, beside : mapping of str to pandas.DataFrame
        Tables of methods, and of other Pareto sets, by name.
    """
    names = [str(name) for name in table.columns if name not in ("steps", "regrips")] + ["steps"]
    first, others = names[0], names[1:] or ["regrips"]
    across = min(len(others), IN_A_ROW)
    down = -(-len(others) // across)
    figure = new_figure(0.8 + 2.5 * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    marks = {name: worst_of(rows) | {"steps": len(rows)} for name, rows in methods.items()}
    for axes, name in zip(panels, others, strict=False):
        for label, other in beside.items():
            ways = (shown(other[c], c) for c in (first, name))
            axes.plot(*ways, "o", ms=4, mfc="none", mec=GRAY, mew=0.8, label=f"{label}, its set")
        x, y = (shown(table[c], c) for c in (first, name))
        dots = axes.scatter(x, y, c=table["steps"], cmap="viridis", s=18, zorder=2)
        _mark(axes, marks, (first, name))
        axes.set(xlabel=LABELS.get(first, first), ylabel=LABELS.get(name, name))
        if axes.get_ylim()[1] > FAR * float(pd.Series(y).max()):
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter(LogFormatter())
            axes.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(2, 0.5)))
        _open(axes)
        dress(axes)
    for axes in panels[len(others) :]:
        axes.set_axis_off()
    words: dict[str, Any] = {"label": "points of the set: steps of the plan"}
    words["ticks"] = MaxNLocator(integer=True)
    figure.colorbar(dots, ax=list(panels), shrink=0.7, **words)
    handles, labels = panels[0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _mark(axes: Axes, marks: Mapping[str, Mapping[str, float]], names: tuple[str, str]) -> None:
    """Mark where methods stand that make no choice."""
    for marker, (method, worst) in zip(MARKERS, marks.items(), strict=False):
        if all(name in worst for name in names):
            at = [shown(worst[name], name) for name in names]
            look: dict[str, Any] = {"color": VERMILION, "mfc": "none", "ms": 8, "ls": "none"}
            axes.plot(*at, marker, label=in_words(method), zorder=3, mew=2, **look)


def _open(axes: Axes) -> None:
    """Keep rounding from looking like a trade-off: axes span a hundredth of what they show."""
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        middle, least = (low + high) / 2, LEAST * max(abs(low), abs(high))
        if axis.get_scale() == "linear" and high - low < least:
            axis.set_view_interval(middle - least / 2, middle + least / 2, ignore=True)
        if axis.get_scale() == "linear":
            axis.set_major_formatter(ScalarFormatter(useOffset=False))
