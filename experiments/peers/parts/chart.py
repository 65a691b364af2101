"""The chart of the peers: time per model, two settings."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from seqopt.report.style import BLUE, GRAY, SMALL, VERMILION, name_panels, new_figure, plain, styled

OURS, BOUND, SPARSE = "seqopt", "dense products", "sparse products"
LABELS = {
    OURS: "seqopt, fast engine",
    "OpenSeesPy": "OpenSeesPy, stiff bars",
    "PyNite": "PyNite, stiff bars",
    "pyconmech": "pyconmech, stiff bars",
    "SciPy bars, SuperLU": "SciPy loop, stiff bars, SuperLU",
    "SciPy bars, banded": "SciPy loop, stiff bars, banded Cholesky",
    "SciPy bricks, SuperLU": "SciPy loop, rigid bricks, SuperLU",
    "SciPy bricks, banded": "SciPy loop, rigid bricks, banded Cholesky",
}
TITLES = {
    "criterion": "what the criterion needs",
    "all fields": "every edge force and node displacement",
}


@styled
def chart(table: pd.DataFrame) -> Figure:
    figure = new_figure(5.6)
    whole = table[table["setting"] == "all fields"].sort_values("model_us", ascending=False)
    order = [tool for tool in whole["tool"] if tool not in (BOUND, SPARSE)]
    panels = figure.subplots(2, 1, sharex=True)
    for axes, (setting, title) in zip(panels, TITLES.items(), strict=True):
        part = table[table["setting"] == setting].set_index("tool")
        least = float(part["model_us"][BOUND])
        axes.axvline(least, color=GRAY, lw=0.8)
        axes.annotate(
            f"dense matrix products alone: {least:.1f} µs", (least, -0.75), (4, 0),
            textcoords="offset points", va="center", fontsize=SMALL,
        )  # fmt: skip
        for row, tool in enumerate(order):
            value, ratio = float(part["model_us"][tool]), float(part["ratio"][tool])
            color, marker = (VERMILION, "D") if tool == OURS else (BLUE, "o")
            axes.plot([0.5, value], [row, row], color=color, lw=1, zorder=1)
            axes.plot(value, row, marker, color=color, ms=6)
            text = f"{value:.1f} µs" if tool == OURS else f"{short(value)} µs, {short(ratio)} times"
            axes.annotate(
                text, (value, row), (8, 0), textcoords="offset points", va="center", fontsize=SMALL
            )
        axes.set(xscale="log", xlim=(0.5, 1e6), ylim=(len(order) - 0.4, -1.3), title=title)
        axes.set_yticks(range(len(order)), [LABELS[tool] for tool in order])
        axes.tick_params(axis="y", length=0)
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.minorticks_off()
    plain(panels[1].xaxis)
    panels[1].set_xlabel("time per structure analyzed [µs]")
    name_panels(*panels)
    return figure


def short(value: float) -> str:
    """Return two digits, or three of large numbers, with a mark for thousands."""
    return f"{value:,.0f}" if value < 1000 else f"{float(f'{value:.3g}'):,.0f}"
