"""The chart of the peers: time per model, two settings."""

from __future__ import annotations

import pandas as pd

from experiments.harness.plotting import new_figure, save_figure

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


def chart(table: pd.DataFrame) -> None:
    figure = new_figure(9, 3.6)
    whole = table[table["setting"] == "all fields"].sort_values("model_us", ascending=False)
    order = [tool for tool in whole["tool"] if tool not in (BOUND, SPARSE)]
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, (setting, title) in zip(panels, TITLES.items(), strict=True):
        part = table[table["setting"] == setting].set_index("tool")
        for row, tool in enumerate(order):
            value, ratio = float(part["model_us"][tool]), float(part["ratio"][tool])
            color = "C1" if tool == OURS else "C0"
            axes.plot([0.5, value], [row, row], color=color, lw=1, alpha=0.5)
            axes.plot(value, row, "o", color=color, ms=6)
            text = f"{value:.1f}" if tool == OURS else f"{short(value)}  ({short(ratio)} times)"
            axes.text(value * 1.45, row, text, va="center", fontsize=8)
        least = float(part["model_us"][BOUND])
        axes.axvline(least, color="k", lw=0.8, ls=":")
        label = f"dense matrix products alone: {least:.1f}"
        axes.text(least * 1.2, -0.8, label, fontsize=7.5, va="center")
        axes.set(xscale="log", xlim=(0.5, 1e7), ylim=(len(order) - 0.4, -1.3))
        axes.set_yticks(range(len(order)), [LABELS[tool] for tool in order], fontsize=8)
        axes.set_xlabel("time per model [µs]", fontsize=9)
        axes.tick_params(axis="x", labelsize=8)
        axes.tick_params(axis="y", length=0)
        axes.set_title(title, fontsize=9)
        axes.spines[["top", "right", "left"]].set_visible(False)
    save_figure(figure, "peers.png")


def short(value: float) -> str:
    """Return two digits, or three of large numbers, with a mark for thousands."""
    return f"{value:,.0f}" if value < 1000 else f"{float(f'{value:.3g}'):,.0f}"
