"""Responses along the build, a chart each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from seqopt.report.style import SMALL, dress, looks

MARKS = 12  # along a line, so that lines are told apart without their color


def draw_responses(
    axes: Sequence[Axes], tables: Mapping[str, pd.DataFrame], columns: Mapping[str, str]
) -> None:
    """Draw responses along the build, one column of the tables on each axes.

    A step stands at the share of the build that it ends, so that methods of different length align.

    Parameters
    ----------
    axes : sequence of matplotlib.axes.Axes
        One for every column.
    tables : mapping of str to pandas.DataFrame
        By method, as `seqopt.analyze` makes them.
    columns : mapping of str to str
        Label of every column, with its unit.
    """
    styles = looks(tables)
    for axis, (column, label) in zip(axes, columns.items(), strict=True):
        for number, (name, table) in enumerate(tables.items()):
            every = max(1, len(table) // MARKS)
            axis.plot(
                ended(table),
                table[column],
                label=name,
                lw=1.2,
                ms=4.5,
                mfc="white",
                markevery=(number % every, every),
                **styles[name].line(),
            )
        axis.set_ylabel(label)
        dress(axis)
    axes[-1].set_xlabel("bricks placed")
    axes[0].legend(frameon=False, ncols=min(len(tables), 4), fontsize=SMALL)


def ended(table: pd.DataFrame) -> pd.Series[float]:
    """Return where every step stands along the build: at the bricks placed when it ends.

    Parameters
    ----------
    table : pandas.DataFrame
        From `seqopt.analyze`.
    """
    count = table.groupby("bricks")["step"].transform("count")
    rank = table.groupby("bricks").cumcount()
    return table["bricks"] - 1 + (rank + 1) / count


def worst_steps(table: pd.DataFrame) -> pd.DataFrame:
    """Return the largest responses while each number of bricks stands.

    Parameters
    ----------
    table : pandas.DataFrame
        From `seqopt.analyze`.

    Returns
    -------
    pandas.DataFrame
        A row per number of bricks, numbers only.
    """
    return table.select_dtypes("number").groupby("bricks").max().reset_index()


def merged(tables: Mapping[str, pd.DataFrame]) -> dict[str, tuple[str, ...]]:
    """Return the names of tables by the first one with the same numbers.

    Returns
    -------
    dict of str to tuple of str
        In the order of the tables; a line drawn over another one hides it.
    """
    out: dict[str, tuple[str, ...]] = {}
    for name, table in tables.items():
        twin = next((first for first in out if _same(tables[first], table)), name)
        out[twin] = (*out.get(twin, ()), name)
    return out


def _same(one: pd.DataFrame, other: pd.DataFrame) -> bool:
    numbers = [table.select_dtypes("number") for table in (one, other)]
    return numbers[0].shape == numbers[1].shape and bool(
        np.allclose(numbers[0], numbers[1], equal_nan=True)
    )
