"""Charts of a comparison of methods and formulations (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from seqopt.placement.plan import Plan
from seqopt.report.along import draw_responses, merged, worst_steps
from seqopt.report.comparison import LARGEST, Comparison
from seqopt.report.style import (
    BLUE,
    GRAY,
    SMALL,
    VERMILION,
    dress,
    looks,
    new_figure,
    plain,
    styled,
)
from seqopt.report.wording import typed
from seqopt.study.published import PUBLISHED

EXACT = 1e-7  # %: gaps below are rounding
COSTS = {
    "gap to the optimum [%]": "{:.2g}",
    "time to choose [s]": "{:.2g}",
    "structures analyzed": "{:,.0f}",
}  # how the numbers are written
TITLES = {
    "F_rob": "robot force",
    "M_sup": "support moment",
    "T_max": "edge tension",
    "D_max": "node displacement",
}
COLUMNS = {
    "M_sup_Nm": "support moment\nM_sup [N m]",
    "F_max_N": "largest tension\nT_max [N]",
    "D_max_1e-3mm": "largest displacement\nD_max [1e-3 mm]",
}
ROW = 0.21  # inches of a bar
PRINTED = "plan published by Bruun et al., its responses computed here"


def comparison_figures(result: Comparison) -> dict[str, Figure]:
    """Return the figures of a comparison.

    Parameters
    ----------
    result : Comparison
        Of a scene that has a loop of its robots.

    Returns
    -------
    dict of str to matplotlib.figure.Figure
        By file name, without an ending.
    """
    return {
        "maxima": _maxima(result),
        "responses": responses_figure(result.tables),
        "gap_against_cost": _gaps(result),
    }


@styled
def _maxima(result: Comparison) -> Figure:
    names = list(result.table.index)
    figure = new_figure(1.4 + 2 * ROW * len(names))
    figure.suptitle("Largest response of any step", x=0.01, ha="left")
    panels = figure.subplots(2, 2, sharey=True).ravel()
    for panel, (column, unit) in zip(panels, LARGEST.items(), strict=True):
        colors = [VERMILION if name == PUBLISHED else BLUE for name in names]
        values = result.table[column].astype(float)
        bars = panel.barh([typed(name) for name in names], values, color=colors, height=0.7)
        panel.bar_label(bars, [f" {value:.3g}" for value in values], fontsize=SMALL)
        panel.set_title(f"{TITLES[column]}, {column} [{unit}]")
        panel.margins(x=0.14)
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(axis="y", length=0)
    panels[0].invert_yaxis()
    if PUBLISHED in names:
        key = [Patch(color=BLUE, label="plan made here"), Patch(color=VERMILION, label=PRINTED)]
        figure.legend(handles=key, loc="outside lower center", ncols=2)
    return figure


@styled
def responses_figure(builds: Mapping[str, pd.DataFrame]) -> Figure:
    """Return the largest responses at every number of bricks, a line a build.

    Parameters
    ----------
    builds : mapping of str to pandas.DataFrame
        By name, as `seqopt.analyze` makes them; equal ones share a line.
    """
    plans = merged(builds)
    tables = {_together(names): worst_steps(builds[one]) for one, names in plans.items()}
    figure = new_figure(6.6 + 0.2 * len(tables))
    figure.suptitle("Worst step at every number of bricks", x=0.01, ha="left")
    axes = figure.subplots(len(COLUMNS), 1, sharex=True)
    draw_responses(axes, tables, COLUMNS)
    handles, labels = axes[0].get_legend_handles_labels()
    axes[0].get_legend().remove()
    figure.legend(handles, labels, loc="outside lower left", ncols=1)
    axes[-1].set_yscale("log")
    plain(axes[-1].yaxis)
    return figure


def _together(names: Sequence[str]) -> str:
    """Return what a line is called that several plans share."""
    return typed(names[0]) if len(names) == 1 else f"the same plan: {', '.join(names)}"


@styled
def _gaps(result: Comparison) -> Figure:
    solved = result.table.dropna(subset=["seconds", "gap"])
    figure = new_figure(0.9 + ROW * len(solved))
    panels = figure.subplots(1, 3, sharey=True)
    rows = np.arange(len(solved))
    columns = (100 * solved["gap"], solved["solve_seconds"], solved["models"])
    for panel, column, (title, text) in zip(panels, columns, COSTS.items(), strict=True):
        values = column.to_numpy(float)
        if title.startswith("time"):
            panel.set_xscale("log")
            panel.set_xlim(values.min() / 2, 30 * values.max())
            plain(panel.xaxis)
        else:
            panel.set_xlim(0, 1.45 * max(values.max(), 0.01))
        panel.hlines(rows, panel.get_xlim()[0], values, color=BLUE, lw=1)
        panel.plot(values, rows, "o", color=BLUE, ms=5, clip_on=False)
        for row, value in enumerate(values):
            words = "none" if value < EXACT and panel is panels[0] else text.format(value)
            panel.annotate(
                words, (value, row), (6, 0), textcoords="offset points", va="center", fontsize=SMALL
            )
        panel.set_title(title)
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(axis="y", length=0, pad=8)
    panels[0].set_yticks(rows, [typed(str(name)) for name in solved.index])
    panels[0].set_ylim(len(solved) - 0.5, -0.5)
    return figure


@styled
def trace_figure(plans: Sequence[Plan]) -> Figure:
    """Return a figure of choices and bounds against time.

    Parameters
    ----------
    plans : sequence of Plan
        Of one problem, each by another formulation.

    Returns
    -------
    matplotlib.figure.Figure
        Values of choices filled, bounds hollow and gray, as steps over the time since a
        formulation began.
    """
    figure = new_figure(3.6)
    axes = figure.subplots()
    known_by = looks(plan.formulation.name for plan in plans)
    for plan in plans:
        name = plan.formulation.name
        trace = plan.selection.trace
        seconds = np.array([found.seconds for found in trace])
        for values, more in (
            ([found.objective for found in trace], {"label": typed(name)}),
            ([found.bound for found in trace], {"mfc": "white", "lw": 0.8}),
        ):
            known = np.isfinite(values)
            axes.step(
                seconds[known],
                np.array(values)[known],
                where="post",
                **(known_by[name].line() | more),
            )
    axes.plot([], [], "o-", color=GRAY, mfc="white", lw=0.8, label="lower bound")
    axes.set(xscale="log", xlabel="time [s]", ylabel="objective, and what bounds it below")
    dress(axes)
    axes.legend()
    return figure
