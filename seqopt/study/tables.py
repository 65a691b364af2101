"""The tables that Bruun et al. printed, as data."""

from __future__ import annotations

from importlib import resources

import pandas as pd

SOURCE = "Bruun et al., Three Cooperative Robotic Fabrication Methods, arXiv 2104.04856"
STEP_TABLES = {
    "sequential": "table_A1_sequential",
    "cantilever": "table_A2_cantilever",
    "published": "table_B1_three_robot",
}


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
    """Return Table A.1, A.2 or B.1, a row per step, with the brick count that A.2 leaves blank.

    The shipped arch was identified from A.1 and A.2; B.1 took no part and serves to validate it.

    Parameters
    ----------
    method : str
        ``sequential`` (A.1), ``cantilever`` (A.2) or ``published`` (B.1, the three-robot plan).

    Returns
    -------
    pandas.DataFrame
        As printed; the names of the columns say the units.

    Raises
    ------
    KeyError
        If the method is none of these.
    """
    if method not in STEP_TABLES:
        raise KeyError(f"printed table of {method!r} does not exist; give {', '.join(STEP_TABLES)}")
    table = printed(STEP_TABLES[method])
    if method == "cantilever":
        table.loc[table["step"] == 9, "bricks"] = 5
    return table
