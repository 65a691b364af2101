"""The chart of a sweep: the first goal over one or two parameters (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

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
    axes.set_xlabel(first)
    if second and table[second].nunique() > MOST_LINES:
        grid = table.pivot_table(index=second, columns=first, values=goal, sort=False)
        image = axes.imshow(grid.to_numpy(float), origin="lower", aspect="auto", cmap="cividis")
        figure.colorbar(image, label=LABELS.get(goal, goal))
        axes.set_facecolor(GRAY)
        axes.set_xticks(range(grid.shape[1]), grid.columns)
        axes.set_yticks(range(grid.shape[0]), grid.index)
        axes.set_ylabel(second)
        return figure
    numbers = pd.to_numeric(table[first], errors="coerce")
    named = numbers.isna().any()  # then values stand one beside the other
    place = pd.Series(pd.factorize(table[first])[0] if named else numbers, table.index, float)
    for number, value in enumerate(table[second].unique() if second else [""]):
        own = table[table[second] == value] if second else table
        about = look(number).line()
        axes.plot(place[own.index], own[goal].astype(float), label=f"{second} {value}", **about)
    lacking = table[table[goal].isna()]
    if len(lacking):
        foot, low = axes.get_xaxis_transform(), np.full(len(lacking), 0.03)
        axes.plot(place[lacking.index], low, "x", color=GRAY, transform=foot, label="no plan")
    if named:
        axes.set_xticks(range(table[first].nunique()), table[first].unique())
    elif numbers.min() > 0 and numbers.max() >= 100 * numbers.min():
        axes.set_xscale("log")
    axes.set_ylabel(LABELS.get(goal, goal))
    if second or len(lacking):
        axes.legend()
    dress(axes)
    return figure
