"""Charts of a comparison of methods and formulations (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from seqopt.placement.plan import Plan
from seqopt.report.comparison import LARGEST, Comparison
from seqopt.report.draw import draw_responses
from seqopt.study.published import PUBLISHED

MARKERS = "osv^D<>P*X"
FLOOR = 1e-6  # where a gap of zero is drawn on a logarithmic axis
COLUMNS = {"M_sup_Nm": "M_sup [N m]", "F_max_N": "T_max [N]", "D_max_1e-3mm": "D_max [1e-3 mm]"}


def comparison_figures(result: Comparison) -> dict[str, Figure]:
    """Return the figures of a comparison.

    Parameters
    ----------
    result : Comparison
        Of a scene that has a loop of its robots.

    Returns
    -------
    dict of str to matplotlib.figure.Figure
        By file name.
    """
    return {
        "maxima.png": _maxima(result),
        "responses.png": _responses(result),
        "gap_against_cost.png": _gaps(result),
    }


def _maxima(result: Comparison) -> Figure:
    figure = Figure(figsize=(9, 6), layout="constrained")
    names = list(result.table.index)
    panels = figure.subplots(2, 2, sharey=True).ravel()
    for panel, (column, unit) in zip(panels, LARGEST.items(), strict=True):
        colors = ["#b8643c" if name == PUBLISHED else "#5b7a8c" for name in names]
        panel.barh(names, result.table[column], color=colors)
        panel.set_title(f"largest {column} [{unit}]", fontsize=9)
        panel.tick_params(labelsize=7)
    panels[0].invert_yaxis()
    return figure


def _responses(result: Comparison) -> Figure:
    figure = Figure(figsize=(9, 8), layout="constrained")
    axes = figure.subplots(len(COLUMNS), 1, sharex=True)
    draw_responses(axes, result.tables, COLUMNS)
    axes[0].legend(frameon=False, ncols=4, fontsize=7)
    axes[-1].set_yscale("log")
    return figure


def _gaps(result: Comparison) -> Figure:
    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    solved = result.table.dropna(subset=["seconds", "gap"])
    gap = np.maximum(solved["gap"].to_numpy(float), FLOOR)
    for panel, column, label in (
        (left, "solve_seconds", "time to solve [s]"),
        (right, "models", "models looked at"),
    ):
        values = solved[column].to_numpy(float)
        for i, name in enumerate(solved.index):
            marker = MARKERS[i % len(MARKERS)]
            panel.loglog(values[i], gap[i], marker, ms=9, mfc="none", mew=1.5, label=str(name))
        panel.set_xlabel(label)
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.grid(visible=True, which="both", lw=0.2)
    left.set_ylabel(f"gap to the exact optimum (0 drawn at {FLOOR:g})")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", frameon=False, fontsize=8)
    return figure


def trace_figure(plans: Sequence[Plan]) -> Figure:
    """Return a figure of choices and bounds against time.

    Parameters
    ----------
    plans : sequence of Plan
        Of one problem, each by another formulation.

    Returns
    -------
    matplotlib.figure.Figure
        Values of choices drawn through, bounds dashed, as steps over the time since a formulation
        began.
    """
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    for number, plan in enumerate(plans):
        trace = plan.selection.trace
        seconds = np.array([found.seconds for found in trace])
        for values, style in (
            ([found.objective for found in trace], "-"),
            ([found.bound for found in trace], "--"),
        ):
            known = np.isfinite(values)
            label = plan.formulation.name if style == "-" else None
            marker = MARKERS[number % len(MARKERS)]
            axes.step(
                seconds[known],
                np.array(values)[known],
                style + marker,
                where="post",
                color=f"C{number}",
                ms=4,
                mfc="none",
                label=label,
            )
    axes.set(xscale="log", xlabel="time [s]", ylabel="objective; bound dashed")
    axes.grid(visible=True, which="both", lw=0.2)
    axes.legend(frameon=False, fontsize=8)
    return figure
