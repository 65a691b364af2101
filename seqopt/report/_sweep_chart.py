"""The chart of a sweep: the first goal over one or two parameters (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from seqopt.arrays import Floats
from seqopt.report._style import GRAY, dress, look, new_figure, styled
from seqopt.report.charts import LABELS

MOST_LINES = 6
BOUND = "_bound"


@styled
def draw_sweep(table: pd.DataFrame, names: Sequence[str]) -> Figure:
    """Draw the first goal over the first name, a line for every value of a second one.

    Where these are more than six, a map of both. Problems without a plan are crosses. ``table``: of
    `seqopt.sweep.sweep`; ``names``: its columns of what differs.
    """
    several = [name for name in names if len(table[name].unique()) > 1] or [*names[:1]]
    first, second = several[0], several[1] if len(several) > 1 else ""
    goal = next(c.removesuffix(BOUND) for c in table.columns if c.endswith(BOUND))
    figure = new_figure(3.4)
    axes = figure.subplots()
    if second and table[second].nunique() > MOST_LINES:
        _draw_map(axes, table, (first, second), goal)
        return figure
    for number, value in enumerate(table[second].unique() if second else [""]):
        own = table[table[second] == value] if second else table
        place, values = _places(table, first, own), own[goal].to_numpy(float)
        axes.plot(place, values, label=f"{second} {value}", **look(number).line())
    lacking = table[table[goal].isna()]
    if len(lacking):
        foot, low = axes.get_xaxis_transform(), np.full(len(lacking), 0.03)
        place = _places(table, first, lacking)
        axes.plot(place, low, "x", color=GRAY, transform=foot, label="no plan")
    _name_places(axes, table, first)
    axes.set_ylabel(LABELS.get(goal, goal))
    if second or len(lacking):
        axes.legend()
    dress(axes)
    return figure


def _draw_map(axes: Axes, table: pd.DataFrame, names: tuple[str, str], goal: str) -> None:
    grid = table.pivot_table(index=names[1], columns=names[0], values=goal, sort=False)
    image = axes.imshow(grid.to_numpy(float), origin="lower", aspect="auto", cmap="cividis")
    axes.figure.colorbar(image, label=LABELS.get(goal, goal))
    axes.set_facecolor(GRAY)
    axes.set_xticks(range(grid.shape[1]), grid.columns)
    axes.set_yticks(range(grid.shape[0]), grid.index)
    axes.set_xlabel(names[0])
    axes.set_ylabel(names[1])


def _numbers(table: pd.DataFrame, name: str) -> pd.Series[float]:
    return pd.to_numeric(table[name], errors="coerce")


def _places(table: pd.DataFrame, name: str, own: pd.DataFrame) -> Floats:
    """Return where rows stand: at their numbers, or one beside the other."""
    numbers = _numbers(table, name)
    if numbers.notna().all():
        return np.asarray(numbers[own.index], dtype=np.float64)
    order = {value: place for place, value in enumerate(table[name].unique())}
    return np.array([order[value] for value in own[name]], dtype=float)


def _name_places(axes: Axes, table: pd.DataFrame, name: str) -> None:
    numbers = _numbers(table, name)
    axes.set_xlabel(name)
    if numbers.isna().any():
        axes.set_xticks(range(table[name].nunique()), table[name].unique())
    elif numbers.min() > 0 and numbers.max() >= 100 * numbers.min():
        axes.set_xscale("log")
