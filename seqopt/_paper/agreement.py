"""How far each figure and table agrees with print, in words."""

from __future__ import annotations

import pandas as pd

from seqopt._paper.items import ITEMS, STEPS, Item

NEAR = 5.0  # percent beyond rounding, relative to the printed size or 1
AGREES, PARTLY, DISAGREES = "agrees", "agrees in part", "disagrees"
TITLES = {
    "geometry": "The arch, with its span and height",
    "vaults": "Vault tests: outlines, secants of test 1, stiffness",
    "discrete": "Displacements of the double-cross model and of discrete elements",
    "sequences": "Grips of the methods, step by step",
    "twisting": "The twisting steps",
    "maxima": "Largest and average responses",
    "loop": "Steps 59 to 62 of the three-robot plan",
    "sequential": "Responses of the sequential method",
    "cantilever": "Responses of the cantilever method",
    "plan": "Grips and responses of the published three-robot plan",
}


def verdict(rows: pd.DataFrame) -> str:
    """Return how an item agrees, by its rows."""
    share = float((rows["error_pct"] <= NEAR).mean())
    return AGREES if share == 1 else PARTLY if share >= 0.5 else DISAGREES


def short(value: float) -> str:
    """Return a number to four digits, without an exponent."""
    return f"{float(f'{value:.4g}'):.10g}"


def beside(row: pd.Series) -> str:
    """Return a printed value and ours, in words."""
    pair = f"printed {short(row['printed'])}, here {short(row['ours'])}"
    return f"{row['quantity']}, {row['at']}: {pair}"


def statement(item: Item, rows: pd.DataFrame) -> str:
    """Return in one sentence how an item agrees."""
    word, error = verdict(rows), rows["error_pct"]
    count = f"{item.number} {word}: {int((error <= NEAR).sum())} of {len(rows)} {item.counted}"
    if error.max() == 0:
        return f"{count} within rounding."
    median = f", median error {float(f'{error.median():.2g}'):.10g} %" if len(rows) > 2 else ""
    worst = rows.iloc[int(error.to_numpy(float).argmax())]
    text = f"{count} within 5 %{median}; largest error in {beside(worst)}"
    if item.counted == STEPS:
        text += f"; of the responses alone {yardstick(rows)}"
    if item.key:
        text += f"; {beside(rows[rows['quantity'] == item.key].iloc[0])}"
    return f"{text}."


def stated(item: Item, table: pd.DataFrame) -> str:
    """Return `statement` of an item from the rows of all."""
    return statement(item, table[table["id"] == item.label])


def yardstick(rows: pd.DataFrame) -> str:
    """Return median, 90th and 95th percentile of the errors of responses, shares of edges aside."""
    error = rows["error_pct"][rows["quantity"].str.match("F_|M_sup|T_max|D_")]
    shares = error.quantile([0.5, 0.9, 0.95])
    return "median {:.2f} %, 90th percentile {:.2f} %, 95th {:.2f} %".format(*shares)


def caption(picture: str, table: pd.DataFrame) -> str:
    """Return what a picture says of its items."""
    return " ".join(stated(item, table) for item in ITEMS if item.picture == picture)
