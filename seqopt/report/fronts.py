"""A Pareto set as a chart, with the methods that have no choice beside it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import pandas as pd

from seqopt.report.front_numbers import shown, worst_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from seqopt.placement.front import Front

__all__ = ["front_figure", "shown_table", "worst_of"]


def front_figure(
    front: Front,
    methods: Mapping[str, pd.DataFrame],
    beside: Mapping[str, pd.DataFrame] | None = None,
) -> Figure:
    """Return the chart of a Pareto set: its first number against each of the others.

    Parameters
    ----------
    front : Front
    methods : mapping of str to pandas.DataFrame
        Tables of methods to mark, by name; see `seqopt.analyze`.
    beside : mapping of str to pandas.DataFrame, optional
        Tables of other Pareto sets, by name: hollow circles.
    """
    from seqopt.report.front_chart import drawn  # noqa: PLC0415  # matplotlib is an extra

    return drawn(front.table, methods, beside or {})


def shown_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table of a Pareto set with the tilt that is survived, in degrees.

    Parameters
    ----------
    table : pandas.DataFrame
        Of `seqopt.placement.front.Front`, where a tilt is how far it is from a right angle, rad.

    Returns
    -------
    pandas.DataFrame
        ``tilt_survived_deg`` in the place of ``tilt``.
    """
    if "tilt" not in table:
        return table.copy()
    out = table.assign(tilt=shown(table["tilt"], "tilt"))
    return out.rename(columns={"tilt": "tilt_survived_deg"})
