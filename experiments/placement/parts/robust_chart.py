"""The figure of `experiments.placement.robust_placement`: plans in scenarios they do not know."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes

from experiments.harness.plotting import new_figure, save_figure

TITLES = {
    "worst-peak": "worst peak",
    "worst-total": "worst total",
    "cvar=0.9": "mean of the worst tenth",
}


def chart(table: pd.DataFrame) -> None:
    """Draw what plans are worth in unseen scenarios, over how many they were made for."""
    figure = new_figure(9, 3.6)
    panels = figure.subplots(1, len(TITLES))
    for panel, (aim, title) in zip(panels, TITLES.items(), strict=True):
        draw(panel, table[table["aim"] == aim])
        panel.set(title=title, xlabel="scenarios the plan is made for", xscale="log")
        counts = sorted(table["scenarios"].unique())
        panel.set_xticks(counts, [str(count) for count in counts])
        panel.set_xticks([], minor=True)
        panel.grid(visible=True, lw=0.2)
    panels[0].set_ylabel("over unseen scenarios")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    save_figure(figure, "robust_placement.png")


def draw(panel: Axes, rows: pd.DataFrame) -> None:
    """Draw one aim: every seed as a point, their mean, and what it is measured by."""
    panel.plot(rows["scenarios"], rows["unseen_robust"], "o", ms=4, color="C0", label="robust plan")
    mean = rows.groupby("scenarios")["unseen_robust"].mean()
    panel.plot(mean.index, mean, "-", color="C0", label="its mean over draws")
    nominal, known = rows["unseen_nominal"].iloc[0], rows["unseen_knows_it"].iloc[0]
    panel.axhline(nominal, color="C3", ls="--", label="nominal plan")
    panel.axhline(known, color="0.4", ls=":", label="plan that knows each scenario")
