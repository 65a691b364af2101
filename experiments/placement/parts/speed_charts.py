"""The charts of speed against accuracy."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from experiments.harness.plotting import new_figure, save_figure
from experiments.harness.profiles import data_profile, pareto, performance_profile
from experiments.harness.runs import NO_PROOF, REFERENCE

CLOSE = 0.01  # gap up to which an answer counts as close in profiles
COLORS = {
    "overlap_dp": "#2166ac",
    "beam": "#67a9cf",
    "rank_search": "#999999",
    "cascade": "#e08214",
    "overlap_lp": "#b2182b",
    "overlap_mip": "#7b3294",
}
MARKERS = {"rigid bricks": "o", "auto": "P", "frame 1e7": "s", "frame 1e3": "^", "discrete": "D"}
FREE_COLOR = "#1b7837"
ASIDE = {  # points: where words stand
    "free, 3 robots": (-7, -10),
    "free, fewest steps": (7, 4),
    "loop, sum of ratios": (7, -11),
    "loop, ranks": (7, 2),
    "loop, worst ratio": (7, 3),
    "sequential": (2, -12),
}
TOP = 2.0  # worst ratio up to which points are drawn
OPEN = "#555555"  # edge of what has no proof
EXACT = 1e-13  # errors below are drawn there


def headline(runs: pd.DataFrame, ratios: pd.DataFrame) -> None:
    """Draw time against gap, error, worst ratio on the reference arch, and growth with bricks."""
    table = runs[(runs["scene"] == "arch25") & (runs["criterion"] == "equations-2-3")]
    table = table.assign(gap=100 * table["gap"])
    figure = new_figure(10.5, 8.4)
    (gaps, errors), (worst, growth) = figure.subplots(2, 2)
    _gaps(gaps, table)
    _errors(errors, table[table["formulation"] == "overlap_dp"])
    _ratios(worst, ratios)
    _growth(growth, runs)
    for part in (gaps, errors, worst, growth):
        part.spines[["top", "right"]].set_visible(False)
        part.grid(visible=True, lw=0.2)
        part.minorticks_off()
    words = [Line2D([], [], color="k", marker=m, ls="", label=e) for e, m in MARKERS.items()]
    words += [Patch(color=color, label=name) for name, color in COLORS.items()]
    words.append(Patch(facecolor="white", edgecolor=OPEN, label=NO_PROOF))
    figure.legend(handles=words, loc="outside lower center", ncols=6, fontsize=8, frameon=False)
    save_figure(figure, "speed_accuracy.png")


def _gaps(axes: Axes, table: pd.DataFrame) -> None:
    """Draw time against gap [%] of every engine and formulation, those that coincide as rings."""
    sizes = {name: (4.5 + 2 * place) ** 2 for place, name in enumerate(COLORS)} | {NO_PROOF: 40.0}
    shown = table[table["formulation"].isin(sizes)]
    order = shown["formulation"].map(sizes).sort_values(ascending=False, kind="stable").index
    for _, row in shown.loc[order].iterrows():
        name = row["formulation"]
        axes.scatter(
            row["total"],
            row["gap"],
            s=sizes[name],
            c=COLORS.get(name, "white"),
            edgecolors=OPEN if name == NO_PROOF else "white",
            linewidths=0.8 if name == NO_PROOF else 0.3,
            marker=MARKERS[row["engine"]],
        )
    _front(axes, shown, "gap")
    top = 1.25 * max(shown["gap"].max(), 0.1)
    axes.set(xscale="log", xlabel="time from scene to plan [s]", ylim=(-0.1 * top, top))
    axes.set(ylabel="gap to the optimum [%]", title="arch25, equations 2 and 3")


def _errors(axes: Axes, table: pd.DataFrame) -> None:
    """Draw time against error of every engine, with the exact formulation."""
    shown = table.assign(error=table["error"].clip(lower=EXACT))
    for _, row in shown.iterrows():
        axes.scatter(row["total"], row["error"], s=46, color="k", marker=MARKERS[row["engine"]])
    for _, row in shown[shown["engine"] == REFERENCE].iterrows():
        axes.annotate(
            "the reference", (row["total"], EXACT), (-4, 8), textcoords="offset points", fontsize=8
        )
    _front(axes, shown, "error")
    axes.set(xscale="log", yscale="log", xlabel="time from scene to plan [s]")
    axes.set(ylabel="largest error of a response", title="engines, with overlap_dp")
    axes.set(ylim=(EXACT / 10, 1))


def _ratios(axes: Axes, ratios: pd.DataFrame) -> None:
    """Draw time against the worst ratio of ways with and without a schedule that is given."""
    table = ratios.assign(total=ratios["seconds"])
    fixed = table["proven"].fillna("") == ""
    for rows, color, label in (
        (table[fixed], "white", "fixed sequence"),
        (table[~fixed & table["way"].str.startswith("loop")], COLORS["overlap_dp"], "loop"),
        (table[table["way"].str.startswith("free")], FREE_COLOR, "free schedule"),
    ):
        axes.scatter(
            rows["total"], rows["worst_ratio"], s=46, c=color, edgecolors=OPEN, lw=0.8, label=label
        )
    for _, row in table.iterrows():
        at, shift = (row["total"], min(row["worst_ratio"], TOP)), ASIDE.get(row["way"], (7, -3))
        words = row["way"].removeprefix("free, ").removeprefix("loop, ")
        words += f": {row['worst_ratio']:.3g}, above" if row["worst_ratio"] > TOP else ""
        side = "left" if shift[0] > 0 else "right"
        axes.annotate(words, at, shift, textcoords="offset points", fontsize=7, ha=side)
    _front(axes, table[~fixed], "worst_ratio")
    axes.axhline(1, color=OPEN, lw=0.8, ls=":")
    axes.set(xscale="log", xlabel="time from scene to plan [s]", xlim=(None, 120), ylim=(0.6, TOP))
    axes.set(ylabel="worst ratio to the best published maxima", title="arch25, all four responses")
    axes.legend(frameon=False, fontsize=8)


def _front(axes: Axes, table: pd.DataFrame, column: str) -> None:
    """Draw the Pareto front: what nothing else beats in time and in a column at once."""
    loss = table[column].to_numpy()
    best = table[pareto(table["total"].to_numpy(), loss.round(15))].sort_values("total")
    axes.step(best["total"], best[column], "k-", lw=0.8, where="post", zorder=0)


def _growth(axes: Axes, runs: pd.DataFrame) -> None:
    """Draw how the exact choice costs more with more bricks, by stage."""
    for engine in ("rigid bricks", "frame 1e7"):
        table = runs[
            (runs["engine"] == engine)
            & (runs["criterion"] == "equations-2-3")
            & (runs["formulation"] == "overlap_dp")
            & (runs["status"] == "optimal")
        ].sort_values("bricks")
        axes.loglog(
            table["bricks"], table["total"], "k", marker=MARKERS[engine], ms=4, lw=1, label=engine
        )
    own = runs[(runs["engine"] == REFERENCE) & (runs["criterion"] == "equations-2-3")]
    for name in ("overlap_dp", "overlap_lp", "overlap_mip"):
        table = own[own["formulation"] == name].sort_values("bricks")
        choose = table[["compile", "solve"]].sum(axis=1)
        axes.loglog(
            table["bricks"], choose, color=COLORS[name], marker=".", lw=1, label=f"choose: {name}"
        )
    table = own[own["formulation"] == NO_PROOF].sort_values("bricks")
    axes.loglog(table["bricks"], table["total"], "--", color=OPEN, lw=1, label="no proof")
    axes.set(xlabel="bricks", ylabel="time [s]")
    axes.set_xticks([7, 13, 25, 49], ["7", "13", "25", "49"])
    axes.legend(frameon=False, fontsize=7, loc="upper left")
    axes.set_ylim(top=1e3)


def profile_charts(runs: pd.DataFrame) -> None:
    """Draw performance profiles of the choice and data profiles in model evaluations."""
    own = runs[(runs["engine"] == REFERENCE) & runs["formulation"].isin(COLORS)]
    own = own.assign(instance=own["scene"] + own["criterion"], choose=own["compile"] + own["solve"])
    figure = new_figure(9, 3.5)
    parts = figure.subplots(1, 3)
    ratios = np.logspace(0, 4, 81)
    for axes, tolerance, text in ((parts[0], 1e-6, "optimal"), (parts[1], CLOSE, "within 1 %")):
        done = own["choose"].where(own["gap"] <= tolerance, np.inf)
        costs = own.assign(cost=done).pivot_table(
            values="cost", index="instance", columns="formulation"
        )
        _steps(axes, performance_profile(costs, ratios))
        axes.set(xlabel="time to choose over the shortest", title=f"{text}")
    parts[0].set(ylabel="share of instances")
    models = own["models"].astype(float).where(own["gap"] <= CLOSE, np.inf)
    counts = own.assign(cost=models / own["moves"]).pivot_table(
        values="cost", index="instance", columns="formulation"
    )
    budgets = np.logspace(1, 4, 81)
    _steps(parts[2], data_profile(counts, budgets))
    parts[2].set(xlabel="models evaluated per move", title="within 1 %")
    figure.legend(*parts[0].get_legend_handles_labels(), loc="outside lower center", ncols=6)
    save_figure(figure, "profiles.png")


def _steps(axes: Axes, profile: pd.DataFrame) -> None:
    for name, color in COLORS.items():
        if name in profile:
            style = "--" if name in ("rank_search", "overlap_lp") else "-"  # often under another
            axes.step(profile.index, profile[name], where="post", color=color, ls=style, label=name)
    axes.set(xscale="log", ylim=(-0.03, 1.03))
    axes.grid(visible=True, lw=0.2)
    axes.spines[["top", "right"]].set_visible(False)
