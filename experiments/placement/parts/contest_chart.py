"""The chart of the contest: seconds of every formulation over the brick count."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from seqopt.report.style import dress, looks, name_panels, new_figure, plain, styled
from seqopt.report.wording import typed

NAMES = (
    "overlap_dp",
    "minimax",
    "lagrangian",
    "labels",
    "cascade",
    "beam",
    "rank_search",
    "overlap_lp",
    "overlap_mip",
)
BUDGETED = ("lagrangian", "labels", "overlap_lp", "overlap_mip")
SPREAD = 0.06  # of the brick count, by which marks of one formulation stand beside the next
LOOKS = looks(NAMES)


@styled
def chart(table: pd.DataFrame) -> Figure:
    """Draw seconds over brick counts, without budgets on the left and with some on the right."""
    figure = new_figure(4.4)
    left, right = figure.subplots(1, 2, sharey=True)
    free = table[table["budgets"] == 0]
    for name, style in LOOKS.items():
        median = free[free["formulation"] == name].groupby("bricks")["solve"].median()
        label = typed(name)
        left.plot(median.index, median, ms=5.5, mfc="white", label=label, **style.line())
    _budgeted(right, table[table["budgets"] > 0])
    left.set(title="no budget: median", xlabel="bricks", ylabel="time to choose [s]")
    right.set(title="one to three budgets: each problem", xlabel="bricks")
    for axes in (left, right):
        axes.set(xscale="log", yscale="log", xlim=(21, 125))
        axes.set_xticks([25, 49, 100], ["25", "49", "100"])
        dress(axes)
        plain(axes.yaxis)
        axes.minorticks_off()
    name_panels(left, right)
    handles, labels = left.get_legend_handles_labels()
    handles.append(Line2D([], [], marker="_", ms=12, mew=2, color="k", ls="none"))
    labels.append("stopped before the proof (right)")
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _budgeted(axes: Axes, table: pd.DataFrame) -> None:
    """Draw a mark for every problem; with a bar where a limit of time or labels stopped it."""
    for place, name in enumerate(BUDGETED):
        own = table[table["formulation"] == name]
        at = own["bricks"] * (1 + SPREAD * (place - 1.5))
        axes.plot(at, own["solve"], ms=5.5, **LOOKS[name].mark(filled=False))
        rows = own["end"] == "stopped"
        axes.plot(at[rows], own["solve"][rows], "_", color="k", ms=12, mew=2)
