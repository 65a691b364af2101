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

LABELS = {
    "F_largest": "largest grip force [N]",
    "M_sup": "M_sup [N m]",
    "T_max": "T_max [N]",
    "C_max": "C_max [N]",
    "D_max": "D_max [1e-3 mm]",
    "steps": "steps",
    "regrips": "regrips",
    "bond": "bond needed [kPa]",
    "friction": "friction needed",
    "tilt": "tilt survived [deg]",
}
MARKERS = "sD^vP*"
FAR = 2.5  # a method so much worse than the set makes an axis logarithmic


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
    from matplotlib.figure import Figure  # noqa: PLC0415  # an extra
    from matplotlib.ticker import LogFormatter  # noqa: PLC0415

    table = front.table
    names = [str(name) for name in table.columns if name not in ("steps", "regrips")] + ["steps"]
    first, others = names[0], names[1:] or ["regrips"]
    figure = Figure(figsize=(3.6 * len(others), 3.9), layout="constrained")
    axes = figure.subplots(1, len(others), squeeze=False)[0]
    marks = {name: worst_of(rows) | {"steps": len(rows)} for name, rows in methods.items()}
    for axis, name in zip(axes, others, strict=True):
        x, y = (_shown(table[c], c) for c in (first, name))
        for label, other in (beside or {}).items():
            ways = (_shown(other[c], c) for c in (first, name))
            axis.plot(*ways, "o", ms=3.5, mfc="none", mec="0.6", ls="none", label=label, zorder=1)
        dots = axis.scatter(x, y, c=table["steps"], cmap="viridis", s=18, zorder=2)
        for marker, (method, worst) in zip(MARKERS, marks.items(), strict=False):
            if first in worst and name in worst:
                at = (_shown(worst[first], first), _shown(worst[name], name))
                axis.plot(*at, marker, color="tab:red", ms=7, label=method, zorder=3, ls="none")
        axis.set_xlabel(LABELS.get(first, first))
        axis.set_ylabel(LABELS.get(name, name))
        if axis.get_ylim()[1] > FAR * float(pd.Series(y).max()):
            axis.set_yscale("log")
            axis.yaxis.set_major_formatter(LogFormatter())
            axis.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(2, 0.5)))
        axis.grid(visible=True, which="both", lw=0.3)
    if marks or beside:
        axes[0].legend(frameon=False, fontsize=8)
    figure.colorbar(dots, ax=list(axes), label="steps of the plan")
    return figure


def _shown(value: pd.Series[float] | float, name: str) -> pd.Series[float] | float:
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
    out = table.assign(tilt=_shown(table["tilt"], "tilt"))
    return out.rename(columns={"tilt": "tilt_survived_deg"})
