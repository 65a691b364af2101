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
    cases, value = found.cases, found.usual
    rows = [*dict.fromkeys(zip(cases["build"], cases["holds"], strict=True))]
    figure = new_figure(1.1 + 2 * _ROW * len(rows))
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
    """Draw how many steps of how many fall, a row for every build and what holds it."""
    values = sorted(cases["value"].unique())
    share = np.full((len(rows), len(values)), np.nan)  # where a build is not possible
    for case in cases.to_dict(orient="records"):
        i, k = rows.index((case["build"], case["holds"])), values.index(case["value"])
        share[i, k] = case["fall"] / case["steps"]
        color = "white" if share[i, k] > 0.6 else "black"
        said = f"{case['fall']} of {case['steps']}"
        axes.text(k + 0.5, i + 0.5, said, ha="center", va="center", fontsize=SMALL, color=color)
    axes.pcolormesh(share, cmap="OrRd", vmin=0.0, vmax=1.0, edgecolors="white", linewidth=1.0)
    axes.set_xticks(np.arange(len(values)) + 0.5, [f"{value:.3g}" for value in values])


def _draw_along(axes: Axes, steps: pd.DataFrame, rows: list[tuple[str, str]]) -> None:
    """Draw the worst verdict at every number of bricks, likewise."""
    rank = steps["verdict"].map({verdict: i for i, verdict in enumerate(_COLORS)})
    most = int(steps["bricks"].max())
    picture = np.zeros((len(rows), most))
    worst = rank.groupby([steps["build"], steps["holds"], steps["bricks"]]).max().reset_index()
    for build, holds, bricks, verdict in worst.to_numpy().tolist():
        picture[rows.index((build, holds)), bricks - 1] = verdict
    edges = np.arange(most + 1) + 0.5, np.arange(len(rows) + 1)
    how: Any = {"cmap": ListedColormap([*_COLORS.values()]), "vmin": -0.5, "vmax": 3.5}
    axes.pcolormesh(*edges, picture, **how, edgecolors="white", linewidth=0.5)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    words = {"every step stands": Verdict.STANDS, "some step falls": Verdict.FALLS}
    if (steps["verdict"] == Verdict.UNDECIDED.value).any():
        words["some step is undecided"] = Verdict.UNDECIDED
    marks = [Patch(color=_COLORS[verdict.value], label=word) for word, verdict in words.items()]
    axes.legend(handles=marks, loc="upper right", bbox_to_anchor=(1.0, 1.25), ncols=len(marks))


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
