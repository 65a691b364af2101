"""The figure of `experiments.placement.staged_construction`: responses along two builds."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from seqopt.report.style import BLUE, INK, VERMILION, dress, new_figure, styled

SHOWN = {
    "cantilever": "cantilever method, two robots",
    "three-robot, published": "published plan, three robots",
}
LABELS = {
    "F_largest_N": "largest robot\nforce [N]",
    "M_sup_Nm": "support moment\nM_sup [N m]",
    "T_max_N": "largest tension\nT_max [N]",
    "D_max_1e-3mm": "largest displacement\nD_max [1e-3 mm]",
}
STYLES = {
    "scratch": (BLUE, "-", "every step from scratch"),
    "fitted": (VERMILION, "--", "staged, bricks fitted to the deformed structure"),
    "planned": (INK, ":", "staged, bricks where they are planned (the same forces)"),
}


@styled
def chart(table: pd.DataFrame) -> Figure:
    """Draw a row of panels per response, and a column per build."""
    figure = new_figure(7.6)
    axes = figure.subplots(len(LABELS), len(SHOWN), sharex="col", sharey="row")
    for cells, name in zip(axes.T, SHOWN, strict=True):
        mine = table[table["method"] == name]
        for cell, column in zip(cells, LABELS, strict=True):
            for analysis, (color, dash, text) in STYLES.items():
                if analysis == "planned" and column != "D_max_1e-3mm":
                    continue  # the same forces
                rows = mine[mine["analysis"] == analysis]
                cell.plot(rows["step"], rows[column], color=color, ls=dash, lw=1.2, label=text)
        cells[0].set_title(SHOWN[name])
        cells[-1].set_xlabel("step")
    for cell, label in zip(axes[:, 0], LABELS.values(), strict=True):
        cell.set_ylabel(label)
    dress(*axes.ravel())
    handles, texts = axes[-1, 0].get_legend_handles_labels()
    figure.legend(handles, texts, loc="outside lower center", ncols=2)
    return figure
