"""The charts of speed against accuracy."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from experiments.plotting import new_figure, save_figure
from experiments.profiles import data_profile, pareto, performance_profile
from experiments.runs import NO_PROOF, REFERENCE

CLOSE = 0.01  # gap up to which an answer counts as close in profiles
COLORS = {
    "overlap_dp": "#2166ac",
    "beam": "#67a9cf",
    "rank_search": "#999999",
    "cascade": "#e08214",
    "overlap_lp": "#b2182b",
    "overlap_mip": "#7b3294",
}
MARKERS = {"rigid bricks": "o", "frame 1e7": "s", "frame 1e3": "^"}


def headline(runs: pd.DataFrame) -> None:
    """Draw time against gap on the reference arch, and how time grows with the brick count."""
    table = runs[
        (runs["scene"] == "arch25")
        & (runs["criterion"] == "equations-2-3")
        & runs["formulation"].isin([*COLORS, NO_PROOF])
    ]
    figure = new_figure(9, 3.9)
    axes, growth = figure.subplots(1, 2, width_ratios=[1.35, 1])
    gap = 100 * table["gap"]
    for (engine, name), row in table.assign(gap=gap).groupby(["engine", "formulation"]):
        color = COLORS.get(str(name), "white")  # open: without proof
        edge = "#555555" if name == NO_PROOF else color
        marker = MARKERS[str(engine)]
        axes.scatter(
            row["total"], row["gap"], s=46, c=color, marker=marker, edgecolors=edge, alpha=0.85
        )
    for engine, part in table.assign(gap=gap).groupby("engine"):
        _label(axes, str(engine), part)
    front = pareto(table["total"].to_numpy(), gap.to_numpy().round(9))
    best = table.assign(gap=gap)[front].sort_values("total")
    axes.plot(best["total"], best["gap"], "k-", lw=0.8, zorder=0)
    top = 1.5 * max(gap.max(), 0.1)
    axes.set(xscale="log", xlabel="time from scene to certified plan [s]", ylim=(-0.25 * top, top))
    axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick <= top])
    axes.set(ylabel="gap to the optimum [%]", title="arch25, equations 2 and 3")
    axes.set_xlim(0.6 * table["total"].min(), 3 * table["total"].max())
    for engine, marker in MARKERS.items():
        axes.scatter([], [], color="k", marker=marker, s=24, label=engine)
    axes.legend(frameon=False, fontsize=8, loc="upper center")
    _growth(growth, runs)
    for part in (axes, growth):
        part.spines[["top", "right"]].set_visible(False)
        part.grid(visible=True, lw=0.2)
        part.minorticks_off()
    save_figure(figure, "speed_accuracy.png")


def _label(axes: Axes, engine: str, table: pd.DataFrame) -> None:
    """Name the points of an engine, those that lie on each other together."""
    if engine == "frame 1e3":
        return  # beside the other frame
    clusters: list[tuple[float, float, list[str]]] = []
    for _, row in table.sort_values("total").iterrows():
        near = [c for c in clusters if abs(c[1] - row["gap"]) < 0.01 and row["total"] < 1.1 * c[0]]
        if near:
            near[0][2].append(str(row["formulation"]))
        else:
            clusters.append((row["total"], row["gap"], [str(row["formulation"])]))
    low = high = 0
    for time, gap, names in sorted(clusters):
        shift = (0, 8 + 11 * high) if gap > 0.01 else (0, -14 - 11 * low)
        low += gap <= 0.01
        high += gap > 0.01
        axes.annotate(
            ", ".join(names),
            (time, gap),
            shift,
            textcoords="offset points",
            fontsize=7,
            ha="left" if engine == REFERENCE else "right",
        )


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
    models = own["models"].where(own["gap"] <= CLOSE, np.inf)
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
