"""What the study printed: its tables as data, and what does not add up in them."""

from __future__ import annotations

from importlib import resources

import pandas as pd

SOURCE = "Bruun et al., Three Cooperative Robotic Fabrication Methods, arXiv 2104.04856"

IRREGULARITIES = (
    "Table A.2 leaves the brick count of step 9 blank (it is 5) and F_sup of step 49 "
    "(472.3 N, the state of A.1 step 49).",
    "The payload is 40 kg (392.4 N); step 47 exceeds it in both two-robot methods.",
    "The text counts 23 optimizations; the printed three-robot plan contains 22.",
    "The printed D_max of the three-robot plan, 21.9e-3 mm, is that of step 88; the grips printed "
    "for step 86 move more.",
    "The three-robot plan moves more than the cantilever method (21.9 against 15.9e-3 mm), "
    "though it is called an improvement in all responses.",
    "Averages 'over the full sequence' (D_max 7.3e-3 mm, M_sup 6.8 N m) leave out the eight "
    "twisting steps; over all 49 steps of A.1 the mean D_max is 21.9e-3 mm.",
    "The average T_max of the sequential method is printed as 38.0 N; all 49 rows give 36.7 N. "
    "Those of the cantilever method leave out steps 1 to 4.",
)


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
