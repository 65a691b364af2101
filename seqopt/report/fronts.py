"""A Pareto set as a chart, with the methods that have no choice beside it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from seqopt.responses.quantities import CHOSEN_BY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from seqopt.placement.front import Front


def worst_of(table: pd.DataFrame) -> dict[str, float]:
    """Return the worst responses of any step of a table, SI units.

    Parameters
    ----------
    table : pandas.DataFrame
        From `seqopt.analyze`.

    Returns
    -------
    dict of str to float
        ``F_largest``, ``M_sup``, ``T_max``, ``D_max``.
    """
    nodes = [str(c).removesuffix("_node") for c in table.columns if str(c).endswith("_node")]
    columns = [c for c in table.columns if any(c in (f"F_{n}_N", f"F_[{n}]_N") for n in nodes)]
    out = {"F_largest": float(table[columns].abs().max().max())}
    for name in ("M_sup", "T_max", "D_max"):
        out[name] = float(table[CHOSEN_BY[name].column].max()) / CHOSEN_BY[name].scale
    return out


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

    Returns
    -------
    matplotlib.figure.Figure
    """
    from seqopt.report.front_chart import drawn  # noqa: PLC0415  # matplotlib is an extra

    return drawn(front.table, methods, beside or {})


def shown(value: pd.Series[float] | float, name: str) -> pd.Series[float] | float:
    """Return a number of a Pareto set in the unit in which it is shown.

    Parameters
    ----------
    value : float or pandas.Series
        SI units.
    name : str
        Of the number.

    Returns
    -------
    float or pandas.Series
    """
    if name == "tilt":
        return value * (-180.0 / np.pi) + 90.0
    if name == "bond":
        return value / 1e3
    return value * CHOSEN_BY[name].scale if name in CHOSEN_BY else value


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
