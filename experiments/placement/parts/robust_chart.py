"""The figure of `experiments.placement.robust_placement`: plans in scenarios they do not know."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from seqopt.report.style import BLUE, GRAY, VERMILION, dress, new_figure, styled

TITLES = {
    "worst-peak": "worst step, worst scenario",
    "worst-total": "sum, worst scenario",
    "cvar=0.9": "sum, mean of the worst tenth",
}


@styled
def chart(table: pd.DataFrame) -> Figure:
    """Draw what plans are worth in unseen scenarios, over how many they were made for."""
    figure = new_figure(3.4)
    panels = figure.subplots(1, len(TITLES))
    for panel, (aim, title) in zip(panels, TITLES.items(), strict=True):
        draw(panel, table[table["aim"] == aim])
        panel.set(title=title, xlabel="scenarios the plan is made for", xscale="log")
        counts = sorted(table["scenarios"].unique())
        panel.set_xticks(counts, [str(count) for count in counts])
        panel.set_xticks([], minor=True)
        panel.set_xlim(counts[0] / 1.4, counts[-1] * 1.4)
        dress(panel)
    panels[0].set_ylabel("cost in unseen scenarios")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def draw(panel: Axes, rows: pd.DataFrame) -> None:
    """Draw one aim: every seed as a point, their mean, and what it is measured by."""
    panel.plot(rows["scenarios"], rows["unseen_robust"], "o", color=BLUE, mfc="white",
               label="robust plan, each draw")  # fmt: skip
    mean = rows.groupby("scenarios")["unseen_robust"].mean()
    panel.plot(mean.index, mean, "-", color=BLUE, label="its mean")
    nominal, known = rows["unseen_nominal"].iloc[0], rows["unseen_knows_it"].iloc[0]
    panel.axhline(nominal, color=VERMILION, ls="--", label="nominal plan")
    panel.axhline(known, color=GRAY, ls=":", lw=2, label="plan that knows each scenario")
