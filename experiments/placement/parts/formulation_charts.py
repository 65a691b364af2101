"""Charts of what formulations cost: over bricks, in the contest, and how programs close in."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.harness.charts import subplots, ticks
from seqopt.report._style import GRAY, Look, dress, look, looks, name_panels, plain, styled
from seqopt.report.text import in_words, typed

FORMULATIONS = (
    *("overlap_dp", "minimax", "lagrangian", "labels", "cascade", "beam", "rank_search"),
    *("overlap_lp", "overlap_mip"),
)
BUDGETED = ("lagrangian", "labels", "overlap_lp", "overlap_mip")
SPREAD = 0.06  # of the brick count, by which marks of one formulation stand beside the next
LOOKS = looks(FORMULATIONS)


@styled
def contest_chart(table: pd.DataFrame) -> Figure:
    """Draw seconds over brick counts, without budgets on the left and with some on the right."""
    figure, (left, right) = subplots(4.4, 1, 2, sharey=True)
    free = table[table["budgets"] == 0]
    for name, style in LOOKS.items():
        median = free[free["formulation"] == name].groupby("bricks")["solve"].median()
        left.plot(median.index, median, ms=5.5, mfc="white", label=typed(name), **style.line())
    capped = table[table["budgets"] > 0]
    for place, name in enumerate(BUDGETED):  # a bar where a limit of time or labels stopped it
        own = capped[capped["formulation"] == name]
        at, stopped = own["bricks"] * (1 + SPREAD * (place - 1.5)), own["end"] == "stopped"
        right.plot(at, own["solve"], ms=5.5, **LOOKS[name].mark(filled=False))
        right.plot(at[stopped], own["solve"][stopped], "_", color="k", ms=12, mew=2)
    left.set(title="no budget: median", xlabel="bricks", ylabel="time to choose [s]")
    right.set(title="one to three budgets: each problem", xlabel="bricks")
    for axes in (left, right):
        axes.set(xscale="log", yscale="log", xlim=(21, 125))
        ticks([25, 49, 100], axes.xaxis)
        dress(axes)
        plain(axes.yaxis)
    name_panels(left, right)
    handles, labels = left.get_legend_handles_labels()
    handles.append(Line2D([], [], marker="_", ms=12, mew=2, color="k", ls="none"))
    labels.append("stopped before the proof (right)")
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


TITLES = {"sum": "least sum of costs", "peak": "smallest worst cost"}
FIRST = 0.02  # s, where the time axis begins


@styled
def shape_chart(table: pd.DataFrame, traces: pd.DataFrame) -> Figure:
    """Draw choices and bounds over time, as shares of the optimum, a panel per problem."""
    figure, panels = subplots(4.4, 1, 2)
    for panel, (aim, rows) in zip(panels, table.groupby("aim", sort=False), strict=True):
        for number, (_, row) in enumerate(rows.iterrows()):
            _drawn(panel, row, traces[traces["formulation"] == row["formulation"]], look(number))
        panel.axhline(1.0, color=GRAY, lw=0.8, zorder=0)
        panel.set(xscale="log", xlim=(0.8 * FIRST, 1.2 * table["limit"].max()))
        panel.set(xlabel="time [s]", title=TITLES[aim])
        dress(panel)
        plain(panel.xaxis)
        panel.legend(loc="lower right")
    panels[0].set(ylim=(0.72, 1.08), ylabel="value over the optimum")
    panels[1].set_ylim(-0.05, 1.4)
    kinds = {
        "choice found": {"ls": "-"},
        "bound proven": {"ls": ":"},
        "bound of the program without integers": {"ls": "none", "marker": "D", "mfc": "white"},
    }
    keys = [Line2D([], [], color="k", label=text, **style) for text, style in kinds.items()]
    figure.legend(handles=keys, loc="outside lower center", ncols=3)
    return figure


def _drawn(panel: Axes, row: pd.Series, trace: pd.DataFrame, style: Look) -> None:
    end = pd.DataFrame([row[["seconds", "value", "bound"]].tolist()])
    own = trace[["seconds", "objective", "bound"]].set_axis([0, 1, 2], axis=1)
    points = pd.concat([own, end], ignore_index=True).to_numpy(float)
    for column, more in ((1, {"ls": "-", "label": in_words(row["formulation"])}), (2, {"ls": ":"})):
        known = np.isfinite(points[:, column])
        face = {"mfc": "white" if column == 2 else style.color}
        mark = {"color": style.color, "marker": style.marker, "markevery": max(1, known.sum() // 4)}
        times, values = np.maximum(points[known, 0], FIRST), points[known, column] / row["optimum"]
        panel.step(times, values, where="post", **mark, **face, **more)
    relaxed = row["relaxed"] / row["optimum"]
    panel.plot(FIRST, relaxed, "D", ms=7, mfc="white", color=style.color, clip_on=False)
