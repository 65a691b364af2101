"""The chart of the contest: seconds of every formulation over the brick count."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes

from experiments.harness.plotting import new_figure, save_figure

STYLES = {
    "overlap_dp": ("o", "tab:blue"),
    "minimax": ("D", "tab:cyan"),
    "cascade": ("v", "tab:gray"),
    "beam": ("s", "tab:olive"),
    "rank_search": ("^", "tab:brown"),
    "lagrangian": ("P", "tab:green"),
    "labels": ("*", "tab:red"),
    "overlap_lp": ("<", "tab:purple"),
    "overlap_mip": (">", "tab:orange"),
}  # marker and color
SPREAD = 0.015  # of the brick count, by which marks of one formulation stand beside the next


def chart(table: pd.DataFrame) -> None:
    """Draw seconds over brick counts, without budgets on the left and with some on the right."""
    figure = new_figure(9.5, 4.2)
    left, right = figure.subplots(1, 2, sharey=True)
    free = table[table["budgets"] == 0]
    for name, (mark, color) in STYLES.items():
        median = free[free["formulation"] == name].groupby("bricks")["solve"].median()
        size = 9 if mark == "*" else 5
        left.loglog(median.index, median, f"{mark}-", color=color, ms=size, lw=1, label=name)
    _budgeted(right, table[table["budgets"] > 0])
    left.set(title="no budget (median)", xlabel="bricks", ylabel="time to choose [s]")
    right.set(title="one to three budgets (each problem; open: stopped)", xlabel="bricks")
    for axes in (left, right):
        axes.set_xticks([25, 49, 100], ["25", "49", "100"])
        axes.minorticks_off()
        axes.grid(visible=True, lw=0.2)
    figure.legend(*left.get_legend_handles_labels(), loc="outside right center", frameon=False)
    save_figure(figure, "contest.png")


def _budgeted(axes: Axes, table: pd.DataFrame) -> None:
    """Draw a mark for every problem; open where a limit of time or labels stopped it."""
    for place, name in enumerate(("lagrangian", "labels", "overlap_lp", "overlap_mip")):
        mark, color = STYLES[name]
        own = table[table["formulation"] == name]
        at = own["bricks"] * (1 + SPREAD * (place - 1.5) * 4)
        for stopped, face in ((False, color), (True, "none")):
            rows = (own["end"] == "stopped") == stopped
            size = 60 if mark == "*" else 25
            axes.scatter(
                at[rows], own["solve"][rows], size, marker=mark, edgecolors=color, facecolors=face
            )
    axes.set(xscale="log", yscale="log")
