"""The charts of time against the worst step, and of time as arches grow."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.harness.profiles import pareto
from experiments.harness.runs import NO_PROOF, REFERENCE
from seqopt.report.style import (
    BLUE,
    GRAY,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    SMALL,
    VERMILION,
    dress,
    name_panels,
    new_figure,
    plain,
    styled,
)

KINDS = {
    "sequence without choice": ("D", GRAY),
    "three-robot loop, choice proven": ("o", BLUE),
    "free schedule, choice proven": ("s", GREEN),
}
ASIDE = {  # points: where words stand
    "free, 3 robots": (-45, -4),
    "free, fewest steps": (6, 8),
    "loop, sum of ratios": (7, -11),
    "loop, ranks": (7, 4),
    "loop, worst ratio": (7, 5),
}
WAYS = {
    "loop, ranks": "ranks",
    "loop, sum of ratios": "sum of ratios",
    "loop, worst ratio": "worst ratio",
    "free, fewest steps": "3 robots, fewest steps",
    "free, dry": "3, laid dry",
}
TOP = 2.0  # worst ratio up to which points are drawn
LINES = {
    ("frame 1e7", "overlap_dp"): ("everything, stiff-bar frame", VERMILION, "s", "-"),
    (REFERENCE, "overlap_dp"): ("everything, rigid bricks", BLUE, "o", "-"),
    (REFERENCE, NO_PROOF): ("the same without proof", SKY, "D", "--"),
}
CHOOSING = {
    "overlap_mip": ("choice alone: integer program", PURPLE, "^", ":"),
    "overlap_lp": ("choice alone: linear program", ORANGE, "v", ":"),
    "overlap_dp": ("choice alone: dynamic programming", INK, "P", ":"),
}


@styled
def worst_step_chart(runs: pd.DataFrame, ratios: pd.DataFrame) -> Figure:
    """Draw time against the worst ratio on the reference arch, and how time grows with bricks."""
    figure = new_figure(4.2)
    worst, growth = figure.subplots(1, 2)
    _ratios(worst, ratios)
    _growth(growth, runs[runs["criterion"] == "equations-2-3"])
    dress(worst, growth)
    name_panels(worst, growth)
    return figure


def _ratios(axes: Axes, ratios: pd.DataFrame) -> None:
    """Draw time against the worst ratio of ways with and without a schedule that is given."""
    fixed, free = ratios["proven"].fillna("") == "", ratios["way"].str.startswith("free")
    kinds = (fixed, ~fixed & ~free, ~fixed & free)
    for rows, (label, (marker, color)) in zip(kinds, KINDS.items(), strict=True):
        part = ratios[rows]
        height = part["worst_ratio"].clip(upper=TOP)
        axes.plot(part["seconds"], height, marker, color=color, ms=6, label=label)
    for row in ratios.to_dict("records"):
        way, ratio = str(row["way"]), float(row["worst_ratio"])
        words = WAYS.get(way, way.removeprefix("free, "))
        words += f": {ratio:.0f}, above" if ratio > TOP else ""
        axes.annotate(
            words,
            (float(row["seconds"]), min(ratio, TOP)),
            ASIDE.get(way, (7, -3)),
            textcoords="offset points",
            fontsize=SMALL,
        )
    proven = ratios[~fixed].reset_index(drop=True)
    loss = proven["worst_ratio"].round(15).to_numpy()
    best = proven[pareto(proven["seconds"].to_numpy(), loss)].sort_values("seconds")
    axes.step(best["seconds"], best["worst_ratio"], color=INK, lw=0.8, where="post", zorder=0)
    axes.axhline(1, color=GRAY, lw=0.8, ls=":")
    axes.set(xscale="log", xlabel="time from scene to plan [s]", xlim=(0.03, 400), ylim=(0.6, 2.45))
    axes.set(ylabel="worst step over the best published maxima")
    axes.set_title("reference arch: the worst step")
    axes.set_yticks([0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
    plain(axes.xaxis)
    axes.legend(loc="upper right")


def _growth(axes: Axes, runs: pd.DataFrame) -> None:
    """Draw how the exact choice costs more with more bricks, by stage."""
    for (engine, name), (label, color, marker, dashes) in LINES.items():
        own = runs[(runs["engine"] == engine) & (runs["formulation"] == name)]
        own = own[own["status"] != "time limit"].sort_values("bricks")
        axes.plot(own["bricks"], own["total"], dashes, marker=marker, color=color, label=label)
    reference = runs[runs["engine"] == REFERENCE]
    for name, (label, color, marker, dashes) in CHOOSING.items():
        own = reference[reference["formulation"] == name].sort_values("bricks")
        choose = own[["compile", "solve"]].sum(axis=1)
        axes.plot(own["bricks"], choose, dashes, marker=marker, color=color, label=label)
    axes.set(xscale="log", yscale="log", xlabel="bricks of the arch", ylabel="time [s]")
    axes.set(ylim=(1e-4, 3e5))
    axes.set_xticks([7, 13, 25, 49], ["7", "13", "25", "49"])
    axes.minorticks_off()
    plain(axes.yaxis)
    axes.set_yticks([1e-4, 1e-3, 0.01, 0.1, 1, 10, 100])
    axes.set_title("longer arches: time by stage")
    axes.legend(loc="upper left")
