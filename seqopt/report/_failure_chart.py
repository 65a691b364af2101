"""A map of failure, and the tilt that a step survives, as pictures (extra ``plot``)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from seqopt.report._failures import AXIS_WORDS
from seqopt.report._style import BLUE, GRAY, SKY, SMALL, VERMILION, new_figure, new_picture, styled
from seqopt.stability.assessment import Stability, Verdict
from seqopt.stability.failure_map import FailureMap

_ROW = 0.27  # inches of a build
_COLORS = {
    "not a step": "#ffffff",
    Verdict.STANDS.value: SKY,
    Verdict.UNDECIDED.value: GRAY,
    Verdict.FALLS.value: VERMILION,
}  # of a step


@styled
def failure_figure(found: FailureMap) -> Figure:
    """Return which share of steps falls in every case, and where along the builds they do."""
    names = [f"{build}, {holds}" for build, holds in _rows(found.cases)]
    figure = new_figure(1.1 + 2 * _ROW * len(names))
    over, along = figure.subplots(2, 1)
    axis = AXIS_WORDS[str(found.cases["axis"].iloc[0])]
    _shares(over, found, names)
    over.set(title="steps that fall, of all steps", xlabel=axis)
    value = found.usual
    _along(along, found.steps[found.steps["value"] == value], names)
    along.set(title=f"along the build, {axis} {value:.3g}", xlabel="bricks placed")
    return figure


def _rows(table: pd.DataFrame) -> list[tuple[str, str]]:
    """Return every build with what holds it, in order."""
    return [*dict.fromkeys(zip(table["build"], table["holds"], strict=True))]


def _shares(axes: Axes, found: FailureMap, names: list[str]) -> None:
    """Draw how many steps of how many fall, a row for every build."""
    cases, values = found.cases, sorted(found.cases["value"].unique())
    share = np.full((len(names), len(values)), np.nan)  # where a build is not possible
    for case in cases.to_dict(orient="records"):
        i, k = names.index(f"{case['build']}, {case['holds']}"), values.index(case["value"])
        share[i, k] = case["fall"] / case["steps"]
        color = "white" if share[i, k] > 0.6 else "black"
        said = f"{case['fall']} of {case['steps']}"
        axes.text(k + 0.5, i + 0.5, said, ha="center", va="center", fontsize=SMALL, color=color)
    axes.pcolormesh(share, cmap="OrRd", vmin=0.0, vmax=1.0, edgecolors="white", linewidth=1.0)
    axes.set_xticks(np.arange(len(values)) + 0.5, [f"{value:.3g}" for value in values])
    _name(axes, names)


def _along(axes: Axes, steps: pd.DataFrame, names: list[str]) -> None:
    """Draw the worst verdict at every number of bricks, a row for every build."""
    order: dict[Any, int] = {verdict: i for i, verdict in enumerate(_COLORS)}
    rank = steps["verdict"].map(order)
    most = int(steps["bricks"].max())
    picture = np.zeros((len(names), most))
    for i, (build, holds) in enumerate(_rows(steps)):
        mine = (steps["build"] == build) & (steps["holds"] == holds)
        worst = rank[mine].groupby(steps["bricks"][mine]).max()
        picture[i, worst.index.to_numpy() - 1] = worst.to_numpy()
    edges = np.arange(most + 1) + 0.5
    colors = ListedColormap([*_COLORS.values()])
    axes.pcolormesh(
        edges, np.arange(len(names) + 1), picture, cmap=colors, vmin=-0.5, vmax=3.5,
        edgecolors="white", linewidth=0.5,
    )  # fmt: skip
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    words = {"every step stands": Verdict.STANDS, "some step falls": Verdict.FALLS}
    if (steps["verdict"] == Verdict.UNDECIDED.value).any():
        words["some step is undecided"] = Verdict.UNDECIDED
    marks = [Patch(color=_COLORS[verdict.value], label=word) for word, verdict in words.items()]
    axes.legend(handles=marks, loc="upper right", bbox_to_anchor=(1.0, 1.25), ncols=len(marks))
    _name(axes, names)


def _name(axes: Axes, names: list[str]) -> None:
    axes.set_yticks(np.arange(len(names)) + 0.5, names)
    axes.tick_params(length=0)
    axes.invert_yaxis()
    axes.spines[:].set_visible(False)


@styled
def tilt_picture(value: Stability) -> Figure:
    """Return the tilt that a step which stands survives in every direction."""
    figure = new_picture(3.0, 3.0)
    axes = figure.add_subplot(projection="polar")
    angles = 2 * np.pi * np.arange(len(value.pull) + 1) / len(value.pull)
    tilts = np.degrees(np.arctan(value.pull))
    axes.plot(angles, [*tilts, tilts[0]], "o-", color=BLUE, ms=4)
    axes.fill(angles, [*tilts, tilts[0]], color=BLUE, alpha=0.15)
    axes.set_title("tilt survived, degrees", loc="center")
    axes.set_yticks([float(f"{np.nanmax(tilts) / 2:.2g}"), float(f"{np.nanmax(tilts):.2g}")])
    return figure
