"""The charts of speed against accuracy."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from experiments.harness.charts import note, subplots, ticks
from experiments.harness.results import two
from experiments.harness.runs import NO_PROOF, REFERENCE
from seqopt.arrays import Floats
from seqopt.report import _style as inks
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
EXACT_GAP = 1e-9  # gaps below are rounding
SEARCHES = {
    NO_PROOF: "search of Bruun et al., without proof",
    "cascade": "the same, its gap computed",
    "rank_search": "rank search",
    "beam": "beam search",
}  # heuristics
EXACT = {
    "overlap_dp": "dynamic programming",
    "overlap_lp": "linear program",
    "overlap_mip": "integer program",
}
LOOKS = looks((*EXACT, "cascade", "rank_search", "beam"))
ENGINES = {
    REFERENCE: "exactly rigid bricks",
    "auto": "automatic choice of engine",
    "frame 1e7": "stiff-bar frame",
    "discrete": "discrete elements",
}
DONE: dict[str, Any] = {"marker": "o", "color": inks.BLUE, "ms": 8, "ls": "none"}
WITHOUT = {
    "marker": "D",
    "color": inks.VERMILION,
    "mfc": "white",
    "ms": 6,
    "mew": 1.4,
    "ls": "none",
}
SOLID, HATCHED = {"color": inks.BLUE}, {"fc": "white", "ec": inks.VERMILION, "hatch": "////"}
LABEL: dict[str, Any] = {"va": "center", "in_layout": False}


@styled
def headline(runs: pd.DataFrame) -> Figure:
    table = runs[(runs["scene"] == "arch25") & (runs["criterion"] == "equations-2-3")]
    figure, (ways, engines) = subplots(4.9, 2, 1, height_ratios=[7, 5])
    _ways(ways, table[table["engine"] == REFERENCE].set_index("formulation"))
    _engines(engines, table)
    for panel in (ways, engines):
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(axis="y", length=0)
    name_panels(ways, engines)
    return figure


def _ways(axes: Axes, table: pd.DataFrame) -> None:
    order = [name for name in (*SEARCHES, *EXACT) if name in table.index]
    least = float(table["total"].get(NO_PROOF, np.nan))
    for row, name in enumerate(order):
        time, gap = float(table["total"][name]), float(table["gap"][name])
        exact = name in EXACT
        style = (
            {"color": inks.BLUE}
            if exact
            else {"fc": "white", "ec": inks.VERMILION, "hatch": "////"}
        )
        axes.barh(row, time, height=0.62, **style)
        worth = "the best plan, proven" if exact else "the best plan, but not proven"
        if gap > EXACT_GAP:
            worth = f"a plan {100 * gap:.2g} % above the best"
        if name == "overlap_dp":
            worth += f": {100 * (time / least - 1):.0f} % more time than without proof"
        note(axes, f"{time:.3f} s, {worth}", (time, row), (5, 0), **LABEL)
    axes.set_yticks(range(len(order)), [(SEARCHES | EXACT)[name] for name in order])
    axes.set(ylim=(len(order) - 0.4, -0.6), xlim=(0, 2.4 * float(table["total"][order].max())))
    title = "Ways to choose the grips of the reference arch, with exactly rigid bricks"
    axes.set(xlabel="time from scene to plan [s]", title=title)
    kinds = [Patch(**SOLID, label="exact"), Patch(**HATCHED, label="heuristic")]
    axes.legend(handles=kinds, loc="upper right")


def _engines(axes: Axes, table: pd.DataFrame) -> None:
    times = table.pivot_table(index="engine", columns="formulation", values="total")
    ended = table[table["status"] == "time limit"]["engine"].unique()
    error = table.groupby("engine")["error"].max()
    names = [name for name in ENGINES if name in times.index]
    base = float(times["overlap_dp"].get(REFERENCE, np.nan))
    for row, name in enumerate(names):
        exact, search = float(times["overlap_dp"][name]), float(times[NO_PROOF][name])
        if name in ended:
            axes.plot(exact, row, ">", color=inks.BLUE, mfc="white", ms=8)
            note(axes, f"stopped after {exact:.0f} s", (exact, row), (8, 0), **LABEL)
            continue
        axes.plot([search, exact], [row, row], color=inks.GRAY, lw=1.2, zorder=1)
        axes.plot(search, row, **WITHOUT)
        axes.plot(exact, row, **DONE)
        text = f"{two(exact)} s"
        if name != REFERENCE:
            text += f", {two(exact / base)} times as long"
        if error[name] > 0:
            text += f"; responses off by {error[name]:.0e}".replace("e-0", "e-")
        note(axes, text, (exact, row), (9, 0), **LABEL)
        note(axes, f"{two(search)} s", (search, row), (-8, 0), ha="right", **LABEL)
    axes.set_yticks(range(len(names)), [ENGINES[name] for name in names])
    axes.set(ylim=(len(names) - 0.4, -0.6), xscale="log", xlim=(0.01, 2e5))
    axes.set(xlabel="time from scene to plan [s], logarithmic")
    axes.set_title("Engines that compute the responses")
    ticks([0.01, 0.1, 1, 10, 100], axes.xaxis)
    words = {"exact: dynamic programming": DONE, "heuristic: without proof": WITHOUT}
    kinds = [Line2D([], [], label=text, **mark) for text, mark in words.items()]
    axes.legend(handles=kinds, loc="upper right")


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
