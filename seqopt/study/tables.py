"""What the study printed: its tables as data, and what does not add up in them."""

from __future__ import annotations

from importlib import resources

import pandas as pd

SOURCE = "Bruun et al., Three Cooperative Robotic Fabrication Methods, arXiv 2104.04856"


def printed(name: str) -> pd.DataFrame:
    """Return a table of the study by its file name in ``data/paper``, without the suffix."""
    source = resources.files("seqopt").joinpath(f"data/paper/{name}.csv")
    with source.open(encoding="utf-8") as stream:
        return pd.read_csv(stream)


def printed_steps(method: str) -> pd.DataFrame:
    """Return Table A.1 (``sequential``) or A.2 (``cantilever``), blank cells filled."""
    table = printed(
        {"sequential": "table_A1_sequential", "cantilever": "table_A2_cantilever"}[method]
    )
    if method == "cantilever":
        table.loc[table["step"] == 9, "bricks"] = 5
    return table
