"""The charts of speed against accuracy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from experiments.harness.profiles import data_profile, performance_profile
from experiments.harness.runs import NO_PROOF, REFERENCE
from experiments.harness.wording import two
from seqopt.report.style import (
    BLUE,
    GRAY,
    SMALL,
    VERMILION,
    dress,
    look,
    name_panels,
    new_figure,
    plain,
    styled,
)
from seqopt.report.wording import in_words

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
LOOKS = {
    name: look(number) for number, name in enumerate((*EXACT, "cascade", "rank_search", "beam"))
}
ENGINES = {
    REFERENCE: "exactly rigid bricks",
    "auto": "automatic choice of engine",
    "frame 1e7": "stiff-bar frame",
    "discrete": "discrete elements",
}
LABEL: dict[str, Any] = {
    "textcoords": "offset points",
    "va": "center",
    "fontsize": SMALL,
    "in_layout": False,
}


@styled
def headline(runs: pd.DataFrame) -> Figure:
    """Draw how long ways to a plan of the reference arch take, exact ones and others."""
    table = runs[(runs["scene"] == "arch25") & (runs["criterion"] == "equations-2-3")]
    figure = new_figure(4.9)
    ways, engines = figure.subplots(2, 1, height_ratios=[7, 5])
    _ways(ways, table[table["engine"] == REFERENCE].set_index("formulation"))
    _engines(engines, table)
    for panel in (ways, engines):
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(axis="y", length=0)
    name_panels(ways, engines)
    return figure


def _ways(axes: Axes, table: pd.DataFrame) -> None:
    """Draw a bar for every way to choose, its gap beside it."""
    order = [name for name in (*SEARCHES, *EXACT) if name in table.index]
    least = float(table["total"].get(NO_PROOF, np.nan))
    for row, name in enumerate(order):
        time, gap = float(table["total"][name]), float(table["gap"][name])
        exact = name in EXACT
        style = {"color": BLUE} if exact else {"fc": "white", "ec": VERMILION, "hatch": "////"}
        axes.barh(row, time, height=0.62, **style)
        worth = "the best plan, proven" if exact else "the best plan, but not proven"
        if gap > EXACT_GAP:
            worth = f"a plan {100 * gap:.2g} % above the best"
        if name == "overlap_dp":
            worth += f": {100 * (time / least - 1):.0f} % more time than without proof"
        axes.annotate(f"{time:.3f} s, {worth}", (time, row), (5, 0), **LABEL)
    axes.set_yticks(range(len(order)), [(SEARCHES | EXACT)[name] for name in order])
    axes.set(ylim=(len(order) - 0.4, -0.6), xlim=(0, 2.4 * float(table["total"][order].max())))
    axes.set_xlabel("time from scene to plan [s]")
    axes.set_title("Ways to choose the grips of the reference arch, with exactly rigid bricks")
    kinds = [
        Patch(color=BLUE, label="exact"),
        Patch(fc="white", ec=VERMILION, hatch="////", label="heuristic"),
    ]
    axes.legend(handles=kinds, loc="upper right")


def _engines(axes: Axes, table: pd.DataFrame) -> None:
    """Draw the times of every engine, with the exact choice and without proof."""
    times = table.pivot_table(index="engine", columns="formulation", values="total")
    ended = table[table["status"] == "time limit"]["engine"].unique()
    error = table.groupby("engine")["error"].max()
    names = [name for name in ENGINES if name in times.index]
    base = float(times["overlap_dp"].get(REFERENCE, np.nan))
    for row, name in enumerate(names):
        exact, search = float(times["overlap_dp"][name]), float(times[NO_PROOF][name])
        if name in ended:
            axes.plot(exact, row, ">", color=BLUE, mfc="white", ms=8)
            axes.annotate(f"stopped after {exact:.0f} s", (exact, row), (8, 0), **LABEL)
            continue
        axes.plot([search, exact], [row, row], color=GRAY, lw=1.2, zorder=1)
        axes.plot(search, row, "D", color=VERMILION, mfc="white", ms=6, mew=1.4)
        axes.plot(exact, row, "o", color=BLUE, ms=8)
        text = f"{two(exact)} s"
        if name != REFERENCE:
            text += f", {two(exact / base)} times as long"
        if error[name] > 0:
            text += f"; responses off by {error[name]:.0e}".replace("e-0", "e-")
        axes.annotate(text, (exact, row), (9, 0), **LABEL)
        axes.annotate(f"{two(search)} s", (search, row), (-8, 0), ha="right", **LABEL)
    axes.set_yticks(range(len(names)), [ENGINES[name] for name in names])
    axes.set(ylim=(len(names) - 0.4, -0.6), xscale="log", xlim=(0.01, 2e5))
    axes.set_xlabel("time from scene to plan [s], logarithmic")
    axes.set_title("Engines that compute the responses")
    axes.set_xticks([0.01, 0.1, 1, 10, 100], ["0.01", "0.1", "1", "10", "100"])
    axes.minorticks_off()
    kinds = [
        Line2D([], [], marker="o", color=BLUE, ms=8, ls="none", label="exact: dynamic programming"),
        Line2D([], [], marker="D", color=VERMILION, mfc="white", ms=6, mew=1.4, ls="none",
               label="heuristic: without proof"),
    ]  # fmt: skip
    axes.legend(handles=kinds, loc="upper right")


@styled
def profile_charts(runs: pd.DataFrame) -> Figure:
    """Draw performance profiles of the choice and data profiles in model evaluations."""
    own = runs[(runs["engine"] == REFERENCE) & runs["formulation"].isin(LOOKS)]
    own = own.assign(instance=own["scene"] + own["criterion"], choose=own["compile"] + own["solve"])
    figure = new_figure(3.7)
    parts = figure.subplots(1, 3, sharey=True)
    ratios = np.logspace(0, 4, 81)
    for axes, tolerance, text in ((parts[0], 1e-6, "optimal"), (parts[1], CLOSE, "within 1 %")):
        done = own["choose"].where(own["gap"] <= tolerance, np.inf)
        costs = own.assign(cost=done).pivot_table(
            values="cost", index="instance", columns="formulation"
        )
        _steps(axes, performance_profile(costs, ratios))
        axes.set(xlabel="time to choose\nover the shortest", title=f"plans {text}, by time")
    parts[0].set(ylabel="share of the scenes and criteria [%]")
    models = own["models"].astype(float).where(own["gap"] <= CLOSE, np.inf)
    counts = own.assign(cost=models / own["moves"]).pivot_table(
        values="cost", index="instance", columns="formulation"
    )
    _steps(parts[2], data_profile(counts, np.logspace(1, 4, 81)))
    parts[2].set(xlabel="structures analyzed\nper repositioning", title="within 1 %, by analyses")
    name_panels(*parts)
    handles, labels = parts[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


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
