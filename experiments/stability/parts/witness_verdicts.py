"""What witnesses say beside us, and its picture from stored rows."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.plotting import stored
from experiments.stability.parts.witness_chart import OPEN, chart

LARGEST = "armadillo_cra"


def words(table: pd.DataFrame, witness: str) -> pd.Series:
    """Return a witness's verdicts; RBE's open ones as its constraints without tension have it."""
    if witness != "rbe":
        return table[witness].replace("", OPEN)
    return table["rbe"].where(table["rbe"] != OPEN, table["no_tension"])


def differing(table: pd.DataFrame, witness: str) -> set[tuple[str, str]]:
    """Return where a witness decides otherwise than we."""
    word = words(table, witness)
    differs = (word != OPEN) & (word != table["ours"])
    return {(case, witness) for case in table.loc[differs, "case"]}


def picture() -> Figure:
    """Return the figure from stored rows; times are those of the run that they tell."""
    table = stored("witnesses")
    words_of = ["rbe", "no_tension", "cra", "lmgc90"]
    table[words_of] = table[words_of].fillna("")
    times = table[table["case"].isin([LARGEST, "bridge"])]
    differ = set().union(*(differing(table, witness) for witness in ("rbe", "lmgc90")))
    return chart(table, times, {case for case, _ in differ})
