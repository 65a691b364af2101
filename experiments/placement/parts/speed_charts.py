"""The charts of speed against accuracy."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.harness.charts import note, subplots, ticks
from experiments.harness.runs import NO_PROOF, REFERENCE
from experiments.placement.parts.speed_points import speed_tables
from seqopt.arrays import Floats
from seqopt.report import _style as inks
from seqopt.report._speed._chart import speed_chart
from seqopt.report._style import dress, looks, name_panels, plain, styled
from seqopt.report.text import in_words


def pareto(cost: Floats, loss: Floats) -> np.ndarray:
    """Return which points no other one beats in cost and loss at once, (n,) bool."""
    no_worse = (cost[:, None] <= cost) & (loss[:, None] <= loss)
    return ~(no_worse & ((cost[:, None] < cost) | (loss[:, None] < loss))).any(axis=0)


def performance_profile(costs: pd.DataFrame, ratios: Floats) -> pd.DataFrame:
    """Return the share of instances that each solver does within a multiple of the best.

    ``costs`` have a row per instance and a column per solver; infinite where it failed.
    """
    return data_profile(costs.div(costs.min(axis=1), axis=0), ratios)


def data_profile(evaluations: pd.DataFrame, budgets: Floats) -> pd.DataFrame:
    """Return the share of instances that each solver does within a budget of evaluations."""
    return pd.DataFrame({b: (evaluations <= b).mean() for b in budgets}).T


def shifted_mean(values: Floats, shift: float) -> float:
    """Return the geometric mean of values shifted by a constant, shifted back."""
    return float(np.exp(np.log(np.asarray(values) + shift).mean()) - shift)


KINDS = {
    "sequence without choice": ("D", inks.GRAY),
    "three-robot loop, choice proven": ("o", inks.BLUE),
    "free schedule, choice proven": ("s", inks.GREEN),
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
    ("frame 1e7", "overlap_dp"): ("everything, stiff-bar frame", inks.VERMILION, "s", "-"),
    (REFERENCE, "overlap_dp"): ("everything, rigid bricks", inks.BLUE, "o", "-"),
    (REFERENCE, NO_PROOF): ("the same without proof", inks.SKY, "D", "--"),
}
CHOOSING = {
    "overlap_mip": ("choice alone: integer program", inks.PURPLE, "^", ":"),
    "overlap_lp": ("choice alone: linear program", inks.ORANGE, "v", ":"),
    "overlap_dp": ("choice alone: dynamic programming", inks.INK, "P", ":"),
}


@styled
def worst_step_chart(runs: pd.DataFrame, ratios: pd.DataFrame) -> Figure:
    """Draw time against the worst ratio on the reference arch, and how time grows with bricks."""
    figure, (worst, growth) = subplots(4.2, 1, 2)
    _ratios(worst, ratios)
    _growth(growth, runs[runs["criterion"] == "equations-2-3"])
    dress(worst, growth)
    name_panels(worst, growth)
    return figure


def _ratios(axes: Axes, ratios: pd.DataFrame) -> None:
    fixed, free = ratios["proven"].fillna("") == "", ratios["way"].str.startswith("free")
    kinds = (fixed, ~fixed & ~free, ~fixed & free)
    for rows, (label, (marker, color)) in zip(kinds, KINDS.items(), strict=True):
        height = ratios["worst_ratio"][rows].clip(upper=TOP)
        axes.plot(ratios["seconds"][rows], height, marker, color=color, ms=6, label=label)
    for way, seconds, ratio in ratios[["way", "seconds", "worst_ratio"]].itertuples(index=False):
        words = WAYS.get(way, way.removeprefix("free, "))
        words += f": {ratio:.0f}, above" if ratio > TOP else ""
        note(axes, words, (seconds, min(ratio, TOP)), ASIDE.get(way, (7, -3)))
    proven = ratios[~fixed].reset_index(drop=True)
    loss = proven["worst_ratio"].round(15).to_numpy()
    best = proven[pareto(proven["seconds"].to_numpy(), loss)].sort_values("seconds")
    axes.step(best["seconds"], best["worst_ratio"], color=inks.INK, lw=0.8, where="post", zorder=0)
    axes.axhline(1, color=inks.GRAY, lw=0.8, ls=":")
    axes.set(xscale="log", xlabel="time from scene to plan [s]", xlim=(0.03, 400), ylim=(0.6, 2.45))
    axes.set(ylabel="worst step over the best published maxima")
    axes.set(title="reference arch: the worst step")
    axes.set_yticks([0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
    plain(axes.xaxis)
    axes.legend(loc="upper right")


def _growth(axes: Axes, runs: pd.DataFrame) -> None:
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
    axes.set(ylim=(1e-4, 3e5), title="longer arches: time by stage")
    ticks([7, 13, 25, 49], axes.xaxis)
    plain(axes.yaxis)
    axes.set_yticks([1e-4, 1e-3, 0.01, 0.1, 1, 10, 100])
    axes.legend(loc="upper left")


CLOSE = 0.01  # gap up to which an answer counts as close in profiles
LOOKS = looks(("overlap_dp", "overlap_lp", "overlap_mip", "cascade", "rank_search", "beam"))


def headline(points: pd.DataFrame) -> Figure:
    """Return README's chart: what `seqopt compare --speed` draws, for its scenes side by side."""
    return speed_chart(*speed_tables(points))


@styled
def profile_charts(runs: pd.DataFrame) -> Figure:
    own = runs[(runs["engine"] == REFERENCE) & runs["formulation"].isin(LOOKS)]
    own = own.assign(instance=own["scene"] + own["criterion"], choose=own["compile"] + own["solve"])
    figure, parts = subplots(3.7, 1, 3, sharey=True)
    for axes, tolerance, text in ((parts[0], 1e-6, "optimal"), (parts[1], CLOSE, "within 1 %")):
        costs = _by_instance(own, own["choose"].where(own["gap"] <= tolerance, np.inf))
        _steps(axes, performance_profile(costs, np.logspace(0, 4, 81)))
        axes.set(xlabel="time to choose\nover the shortest", title=f"plans {text}, by time")
    parts[0].set(ylabel="share of the scenes and criteria [%]")
    models = own["models"].astype(float).where(own["gap"] <= CLOSE, np.inf)
    _steps(parts[2], data_profile(_by_instance(own, models / own["moves"]), np.logspace(1, 4, 81)))
    parts[2].set(xlabel="structures analyzed\nper repositioning", title="within 1 %, by analyses")
    name_panels(*parts)
    figure.legend(*parts[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _by_instance(own: pd.DataFrame, cost: pd.Series) -> pd.DataFrame:
    return own.assign(cost=cost).pivot_table("cost", "instance", "formulation")


def _steps(axes: Axes, profile: pd.DataFrame) -> None:
    """Draw a line per formulation; lines that coincide stand a little apart."""
    last: list[tuple[float, ...]] = []
    for number, (name, style) in enumerate(LOOKS.items()):
        if name in profile:
            values = 100 * profile[name].to_numpy()
            same = sum(np.allclose(values, other) for other in last)
            last.append(tuple(values))
            line = style.line() | {"markevery": (4 + 2 * number, 16), "mfc": "white"}
            axes.plot(profile.index, values - 1.6 * same, label=in_words(name), lw=1.2, **line)
    axes.set(xscale="log", ylim=(-9, 103), xlim=profile.index[[0, -1]])
    plain(axes.xaxis)
    dress(axes)
