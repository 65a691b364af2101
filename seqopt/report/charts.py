"""Charts of comparisons, plans, Pareto sets, sweeps and maps of failure (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogFormatter, MaxNLocator, ScalarFormatter

from seqopt.plan.front import Front
from seqopt.report._failures import AXIS_WORDS
from seqopt.report._style import GRAY, SKY, SMALL, VERMILION, dress, looks, new_figure, styled
from seqopt.report.comparison import _in_shown_unit, largest
from seqopt.stability.failure_map import FailureMap
from seqopt.stability.verdict import Verdict

CASE = 0.27  # inches: of a row of a map of failure
MARKS = 12  # along a line, so that lines are told apart without their color
LABELS = {
    "F_largest": "largest grip force [N]",
    "M_sup": "support moment M_sup [N m]",
    "T_max": "tension T_max [N]",
    "C_max": "compression C_max [N]",
    "D_max": "displacement D_max [µm]",
    "steps": "steps of the plan",
    "bond": "bond needed [kPa]",
    "friction": "friction needed",
    "tilt": "tilt survived [deg]",
    "tolerance": "tolerance of grips [mm]",
}
MARKERS = "sD^vP*"
IN_A_ROW = 2  # charts
LEAST = 0.01  # share of its numbers that an axis spans at least
FAR = 2.5  # a method so much worse than the set makes an axis logarithmic
FAR_APART = 100  # values that differ so many times make an axis logarithmic
VERDICTS = {
    "not a step": "#ffffff",
    Verdict.STANDS.value: SKY,
    Verdict.UNDECIDED.value: GRAY,
    Verdict.FALLS.value: VERMILION,
}  # colors of steps


def draw_responses(
    axes: Sequence[Axes], tables: Mapping[str, pd.DataFrame], columns: Mapping[str, str]
) -> None:
    """Draw responses along the build: one labeled column of the tables on each of the axes.

    A step stands at the share of the build that it ends, so that methods of different length align.
    """
    styles = looks(tables)
    for number, (name, table) in enumerate(tables.items()):
        steps = table.groupby("bricks")
        ended = table["bricks"] - 1 + (steps.cumcount() + 1) / steps["step"].transform("count")
        every = max(1, len(table) // MARKS)
        line = styles[name].line() | {"lw": 1.2, "ms": 4.5, "mfc": "white"}
        line |= {"markevery": (number % every, every), "label": name}
        for axis, column in zip(axes, columns, strict=True):
            axis.plot(ended, table[column], **line)
    for axis, label in zip(axes, columns.values(), strict=True):
        axis.set_ylabel(label)
        dress(axis)
    axes[-1].set_xlabel("bricks placed")
    axes[0].legend(frameon=False, ncols=min(len(tables), 4), fontsize=SMALL)


@styled
def front_figure(
    front: Front,
    methods: Mapping[str, pd.DataFrame],
    beside: Mapping[str, pd.DataFrame] | None = None,
) -> Figure:
    """Return the chart of a Pareto set: its first number against each of the others.

    The tables of methods (see `seqopt.analyze`) are marked by name, those of other Pareto sets
    beside it by hollow circles.
    """
    table = front.table
    names = [str(name) for name in table.columns if name not in ("steps", "regrips")] + ["steps"]
    first, others = names[0], names[1:] or ["regrips"]
    across = min(len(others), IN_A_ROW)
    down = -(-len(others) // across)
    figure = new_figure(0.8 + 2.5 * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    scene, marks = front.engines[0].network.scene, dict[str, dict[str, float]]()
    low, high = table["steps"].min(), table["steps"].max()
    shades = {"vmin": low, "vmax": max(high, low + 1)}  # one scale, also where all are alike
    for name, rows in methods.items():
        worst = largest(scene, rows)
        marks[name] = {**worst, "F_largest": worst["F_rob"], "steps": len(rows)}
    for axes, name in zip(panels, others, strict=False):
        for label, other in (beside or {}).items():
            ways = (_in_shown_unit(other[c], c) for c in (first, name))
            axes.plot(*ways, "o", ms=4, mfc="none", mec=GRAY, mew=0.8, label=f"{label}, its set")
        x, y = (_in_shown_unit(table[c], c) for c in (first, name))
        dots = axes.scatter(x, y, c=table["steps"], cmap="viridis", s=18, zorder=2, **shades)
        mark: dict[str, Any] = {"color": VERMILION, "mfc": "none", "ms": 8, "ls": "none", "mew": 2}
        mark["zorder"] = 3
        for marker, (method, worst) in zip(MARKERS, marks.items(), strict=False):
            if first in worst and name in worst:
                words = method.replace("_", " ")
                axes.plot(worst[first], worst[name], marker, label=words, **mark)
        axes.set(xlabel=LABELS.get(first, first), ylabel=LABELS.get(name, name))
        _scale(axes, FAR * float(pd.Series(y).max()))
        dress(axes)
    for axes in panels[len(others) :]:
        axes.set_axis_off()
    bar = figure.colorbar(dots, ax=list(panels), shrink=0.7, ticks=MaxNLocator(integer=True))
    bar.set_label("points of the set: steps of the plan")
    handles, labels = panels[0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def draw_sweep(table: pd.DataFrame, names: Sequence[str]) -> Figure:
    """Draw the first goal over the first name; a scene stands for its words that differ."""
    goal = next(c.removesuffix("_bound") for c in table.columns if c.endswith("_bound"))
    if "scene" in names and len(table["scene"].str.partition(":")[0].unique()) == 1:
        pairs = table["scene"].str.findall(r"([^:,=]+)=([^,]*)").map(dict)
        own = pd.DataFrame([*pairs], table.index).fillna("")
        table = own.join(table.drop(columns=own.columns, errors="ignore"))
        names = [*own.columns[own.ne(own.iloc[0]).any()], *(n for n in names if n != "scene")]
    first, *others = names
    axes = (figure := new_figure(3.4)).subplots()
    numbers = pd.to_numeric(table[first], errors="coerce")
    named = numbers.isna().any()  # then values stand one beside the other
    place = pd.Series(pd.factorize(table[first])[0] if named else numbers, table.index, float)
    values = [", ".join(f"{n} {row[n]}" for n in others) for row in table.to_dict("records")]
    for label, look in looks(values).items():
        own = table[np.array(values) == label]
        axes.plot(place[own.index], own[goal].astype(float), label=label, **look.line())
    lacking = table[table[goal].isna()].index
    if len(lacking):
        foot, low = axes.get_xaxis_transform(), np.full(len(lacking), 0.03)
        axes.plot(place[lacking], low, "x", color=GRAY, transform=foot, label="no plan")
    far = not named and 0 < FAR_APART * numbers.min() < numbers.max()
    axes.set(xlabel=first, ylabel=LABELS.get(goal, goal), xscale="log" if far else "linear")
    if named:
        axes.set_xticks(range(table[first].nunique()), table[first].unique(), rotation=90)
    if others or len(lacking):
        axes.legend()
    dress(axes)
    return figure


def _scale(axes: Axes, far: float) -> None:
    """Make the axis up logarithmic if it goes far, and keep rounding from looking like a trade-off.

    Linear axes span a hundredth of what they show.
    """
    if axes.get_ylim()[1] > far:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(LogFormatter())
        axes.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(2, 0.5)))
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "linear":
            low, high = axis.get_view_interval()
            middle, least = (low + high) / 2, LEAST * max(abs(low), abs(high))
            if high - low < least:
                axis.set_view_interval(middle - least / 2, middle + least / 2, ignore=True)
            axis.set_major_formatter(ScalarFormatter(useOffset=False))


@styled
def failure_figure(found: FailureMap) -> Figure:
    """Return which share of steps falls in every case, and where along the builds they do."""
    cases, value = found.cases, found.usual
    rows = [*dict.fromkeys(zip(cases["build"], cases["holds"], strict=True))]
    figure = new_figure(1.1 + 2 * CASE * len(rows))
    over, along = figure.subplots(2, 1)
    axis = AXIS_WORDS[str(cases["axis"].iloc[0])]
    _draw_shares(over, cases, rows)
    over.set(title="steps that fall, of all steps", xlabel=axis)
    _draw_along(along, found.steps[found.steps["value"] == value], rows)
    along.set(title=f"along the build, {axis} {value:.3g}", xlabel="bricks placed")
    for axes in (over, along):
        axes.set_yticks(np.arange(len(rows)) + 0.5, [", ".join(row) for row in rows])
        axes.tick_params(length=0)
        axes.invert_yaxis()
        axes.spines[:].set_visible(False)
    return figure


def _draw_shares(axes: Axes, cases: pd.DataFrame, rows: list[tuple[str, str]]) -> None:
    """Draw how many steps of how many fall, a row for every build and mortar."""
    values = sorted(cases["value"].unique())
    share = np.full((len(rows), len(values)), np.nan)  # where a build is not possible
    for case in cases.to_dict(orient="records"):
        i, k = rows.index((case["build"], case["holds"])), values.index(case["value"])
        share[i, k] = case["fall"] / case["steps"]
        color = "white" if share[i, k] > 0.6 else "black"
        text = f"{case['fall']} of {case['steps']}"
        axes.text(k + 0.5, i + 0.5, text, ha="center", va="center", fontsize=SMALL, color=color)
    axes.pcolormesh(share, cmap="OrRd", vmin=0.0, vmax=1.0, edgecolors="white", linewidth=1.0)
    axes.set_xticks(np.arange(len(values)) + 0.5, [f"{value:.3g}" for value in values])


def _draw_along(axes: Axes, steps: pd.DataFrame, rows: list[tuple[str, str]]) -> None:
    """Draw the worst verdict at every number of bricks, likewise."""
    rank = steps["verdict"].map({verdict: i for i, verdict in enumerate(VERDICTS)})
    most = int(steps["bricks"].max())
    picture = np.zeros((len(rows), most))
    worst = rank.groupby([steps["build"], steps["holds"], steps["bricks"]]).max().reset_index()
    for build, holds, bricks, verdict in worst.to_numpy().tolist():
        picture[rows.index((build, holds)), bricks - 1] = verdict
    edges = np.arange(most + 1) + 0.5, np.arange(len(rows) + 1)
    how: Any = {"cmap": ListedColormap([*VERDICTS.values()]), "vmin": -0.5, "vmax": 3.5}
    axes.pcolormesh(*edges, picture, **how, edgecolors="white", linewidth=0.5)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    words = {"every step stands": Verdict.STANDS, "some step falls": Verdict.FALLS}
    if (steps["verdict"] == Verdict.UNDECIDED.value).any():
        words["some step is undecided"] = Verdict.UNDECIDED
    marks = [Patch(color=VERDICTS[verdict.value], label=word) for word, verdict in words.items()]
    axes.legend(handles=marks, loc="upper right", bbox_to_anchor=(1.0, 1.25), ncols=len(marks))
