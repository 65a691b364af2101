"""The numbers of a Pareto set: of methods beside it, and in the units in which they are shown."""

from __future__ import annotations

import numpy as np
import pandas as pd

from seqopt.responses.quantities import CHOSEN_BY


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


def shown(value: pd.Series[float] | float, name: str) -> pd.Series[float] | float:
    """Return a number of a Pareto set in the unit in which it is shown.

    Parameters
    ----------
    value : float or pandas.Series
        SI units.
    name : str
        Of the number.
    """
    if name == "tilt":
        return value * (-180.0 / np.pi) + 90.0
    if name == "bond":
        return value / 1e3
    return value * CHOSEN_BY[name].scale if name in CHOSEN_BY else value
