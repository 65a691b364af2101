"""The figure of `experiments.placement.staged_construction`: responses along two builds."""

from __future__ import annotations

import pandas as pd

from experiments.harness.plotting import new_figure, save_figure

SHOWN = ("cantilever", "three-robot, published")
LABELS = {
    "F_largest_N": "largest robot force [N]",
    "M_sup_Nm": "M_sup [N m]",
    "T_max_N": "T_max [N]",
    "D_max_1e-3mm": "Δ_max [1e-3 mm]",
}
STYLES = {
    "scratch": ("#2166ac", "-", "every step from scratch"),
    "fitted": ("#b2182b", "-", "staged, bricks fitted to the deformed structure"),
    "planned": ("#b2182b", ":", "staged, bricks where they are planned"),
}


def chart(table: pd.DataFrame) -> None:
    figure = new_figure(11, 5.5)
    axes = figure.subplots(len(SHOWN), len(LABELS))
    for line, name in zip(axes, SHOWN, strict=True):
        mine = table[table["method"] == name]
        for cell, (column, label) in zip(line, LABELS.items(), strict=True):
            for analysis, (color, dash, text) in STYLES.items():
                if analysis == "planned" and column != "D_max_1e-3mm":
                    continue  # the same forces
                rows = mine[mine["analysis"] == analysis]
                cell.plot(rows["step"], rows[column], color=color, ls=dash, lw=1.1, label=text)
            cell.set(xlabel="step", ylabel=label)
            cell.set_title(name, fontsize=8)
            cell.grid(visible=True, lw=0.2)
            cell.spines[["top", "right"]].set_visible(False)
    handles, texts = axes[0, -1].get_legend_handles_labels()
    figure.legend(handles, texts, loc="outside upper center", ncols=3, frameon=False, fontsize=8)
    save_figure(figure, "staged_construction.png")
