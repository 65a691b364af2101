"""The chart of the contest: how many instances each way closes in how long, and what it leaves."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import isotonic_regression

from experiments.harness.charts import note, subplots
from experiments.instances.parts.tables import with_gaps
from seqopt.arrays import Floats
from seqopt.report import _style as inks
from seqopt.report._style import dress, name_panels, plain, styled

BEST = "best of ours"
PART = 1 / 3  # of the instances: ways that fit fewer are in the best of ours alone
OUTSIDE = {"HiGHS": "-", "CP-SAT": (0, (1, 1.2))}
COLORS = (inks.BLUE, inks.GREEN, inks.PURPLE, inks.ORANGE, inks.SKY)
TIMES, GAPS = (0.02, 20.0), (1e-4, 1.0)  # s, of values: what axes show
ROOM = 5.5  # percent between two labels


@styled
def chart(contest: pd.DataFrame, library: pd.DataFrame) -> Figure:
    """Draw the share of all instances closed within a time, and within a gap after every run."""
    runs = with_gaps(contest, library)
    runs["closing"] = runs["seconds"].where(runs["closed"], np.inf)
    runs["left"] = runs["gap"].fillna(np.inf)
    count = len(library)
    figure, (times, left) = subplots(4.4, 1, 2, sharey=True)
    _profiles(times, _by_way(runs, "closing", count), TIMES, count)
    _profiles(left, _by_way(runs, "left", count), GAPS, count)
    times.set(xlabel="processor time [s]", title="closed by its own bound within a time")
    left.set(xlabel="gap to its own bound, of its value", title="not more left when its run ended")
    times.set(ylabel=f"share of all {count} instances [%]")
    dress(times, left)
    name_panels(times, left)
    return figure


def _by_way(runs: pd.DataFrame, column: str, count: int) -> dict[str, Floats]:
    """Return a value for every instance that a way fits, least first, and the best of ours."""
    ours = runs[~runs["solver"].isin(OUTSIDE)]
    found = {BEST: ours.groupby("instance")[column].min()}
    for name, own in runs.groupby("solver", sort=False):
        if len(own) >= PART * count:
            found[str(name)] = own[column]
    return {name: np.sort(values.to_numpy()) for name, values in found.items()}


def _profiles(axes: Axes, ways: dict[str, Floats], limits: tuple[float, float], count: int) -> None:
    """Draw a curve for every way, with its name where it ends and how many instances it fits."""
    low, high = limits
    ours = [name for name in ways if name not in OUTSIDE and name != BEST]
    colors = {BEST: inks.INK} | dict.fromkeys(OUTSIDE, inks.VERMILION)
    colors |= dict(zip(ours, COLORS, strict=False))
    ends = {}
    for name, values in ways.items():
        at = np.concatenate([[low], values[(values > low) & (values <= high)], [high]])
        share = 100 * np.searchsorted(values, at, side="right") / count
        look = {"color": colors[name], "ls": OUTSIDE.get(name, "-")}
        axes.step(at, share, where="post", lw=1.2 if name in ours else 2.0, **look)
        ends[name] = share[-1]
    axes.set(xscale="log", xlim=limits, ylim=(0, 103))
    plain(axes.xaxis)
    for name, height in _apart(ends).items():
        words = f"{name.replace('_', ' ')}, {len(ways[name])}"
        color, across = colors[name], axes.get_yaxis_transform()
        line = {"transform": across, "clip_on": False, "color": color, "lw": 0.6}
        axes.plot([1.0, 1.04], [ends[name], height], **line)
        note(axes, words, (1.05, height), (0, -3), xycoords=across, color=color)


def _apart(ends: dict[str, float]) -> dict[str, float]:
    """Return heights of labels as close to the ends of their curves as room for each allows."""
    names = sorted(ends, key=lambda name: ends[name])
    steps = ROOM * np.arange(len(names))
    heights = isotonic_regression(np.array([ends[name] for name in names]) - steps).x + steps
    return dict(zip(names, heights.tolist(), strict=True))
