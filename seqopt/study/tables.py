"""The tables that Bruun et al. printed, as data."""

from __future__ import annotations

from importlib import resources

import pandas as pd

SOURCE = "Bruun et al., Three Cooperative Robotic Fabrication Methods, arXiv 2104.04856"


def printed(name: str) -> pd.DataFrame:
    """Return a printed table.

    Parameters
    ----------
    name : str
        Of its file in ``seqopt/data/paper``, without the suffix.

    Returns
    -------
    pandas.DataFrame
        As printed; the names of the columns say the units.

    Raises
    ------
    FileNotFoundError
        If there is none of that name.
    """
    source = resources.files("seqopt").joinpath(f"data/paper/{name}.csv")
    with source.open(encoding="utf-8") as stream:
        return pd.read_csv(stream)


def printed_steps(method: str) -> pd.DataFrame:
    """Return Table A.1 or A.2, a row per step, with the brick count that A.2 leaves blank.

    Parameters
    ----------
    method : str
        ``sequential`` (A.1) or ``cantilever`` (A.2).

    Returns
    -------
    pandas.DataFrame
        As printed; the names of the columns say the units.

    Raises
    ------
    KeyError
        If the method is neither.
    """
    table = printed(
        {"sequential": "table_A1_sequential", "cantilever": "table_A2_cantilever"}[method]
    )
    if method == "cantilever":
        table.loc[table["step"] == 9, "bricks"] = 5
    return table
