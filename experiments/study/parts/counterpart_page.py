"""Captions of the counterparts, and the page of the documentation that lists them.

Every number comes from the rows of `experiments.study.paper_counterparts`; a test compares them.
"""

import textwrap

import pandas as pd

from experiments.study.parts.paper_items import ITEMS, STEPS, Item

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
INTRODUCTION = """\
## Every figure and table

`python -m experiments.study.paper_counterparts` computes every figure and table that has numbers,
draws them beside the printed ones, and writes this part of the page; all values are in
`experiments/results/paper_counterparts.csv`. The error is the difference beyond rounding, relative
to the printed value or to 1. An item *agrees* if every value is within 5 % of print, *agrees in
part* if at least half of the values are, and *disagrees* otherwise.

"""
CONVENTIONS = """\
In the CSV file a grip is given by its node; -1 means no grip, and 1003 means the optimized grip O3.
Forces of robots and of the support (the first ground end) are compared by magnitude, and `T_pct` to
within two edges. Figures and tables are numbered in the order of the paper's source.

"""


def verdict(rows: pd.DataFrame) -> str:
    share = float((rows["error_pct"] <= NEAR).mean())
    return AGREES if share == 1 else PARTLY if share >= 0.5 else DISAGREES


def short(value: float) -> str:
    """Return a number to four digits, without an exponent."""
    return f"{float(f'{value:.4g}'):.10g}"


def beside(row: pd.Series) -> str:
    pair = f"printed {short(row['printed'])}, here {short(row['ours'])}"
    return f"{row['quantity']}, {row['at']}: {pair}"


def statement(item: Item, rows: pd.DataFrame) -> str:
    """Return in one sentence how an item agrees."""
    word, error = verdict(rows), rows["error_pct"]
    count = f"{item.number} {word}: {int((error <= NEAR).sum())} of {len(rows)} {item.counted}"
    if error.max() == 0:
        return f"{count} within rounding."
    median = f", median error {float(f'{error.median():.2g}'):.10g} %" if len(rows) > 2 else ""
    text = f"{count} within 5 %{median}; largest error in {beside(rows.loc[error.idxmax()])}"
    if item.counted == STEPS:
        text += f"; of the responses alone {yardstick(rows)}"
    if item.key:
        text += f"; {beside(rows[rows['quantity'] == item.key].iloc[0])}"
    return f"{text}."


def stated(item: Item, table: pd.DataFrame) -> str:
    return statement(item, table[table["id"] == item.label])


def yardstick(rows: pd.DataFrame) -> str:
    """Return median, 90th and 95th percentile of the errors of responses, shares of edges aside."""
    error = rows["error_pct"][rows["quantity"].str.match("F_|M_sup|T_max|D_")]
    shares = error.quantile([0.5, 0.9, 0.95])
    return "median {:.2f} %, 90th percentile {:.2f} %, 95th {:.2f} %".format(*shares)


def caption(picture: str, table: pd.DataFrame) -> str:
    return " ".join(stated(item, table) for item in ITEMS if item.picture == picture)


def line(item: Item, table: pd.DataFrame) -> str:
    """Return the row of the page's table for an item."""
    head = f"| {item.number}, section {item.section}: `{item.label}` | {item.shows} |"
    if not item.has_numbers:
        return f"{head} no: {item.why} | – | – | – |"
    named = ", ".join(f"`{name}`" for name in ("study.paper_counterparts", item.also) if name)
    text = stated(item, table).removeprefix(f"{item.number} ")
    return f"{head} yes | {named} | [picture](#pictures) | {text} |"


def page(table: pd.DataFrame) -> str:
    words = [verdict(table[table["id"] == item.label]) for item in ITEMS if item.has_numbers]
    total = (
        f"{len(words)} of {len(ITEMS)} have numbers: {words.count(AGREES)} agree, "
        f"{words.count(PARTLY)} agree in part, {words.count(DISAGREES)} disagree.\n"
    )
    head = (
        "| in the paper | shows | numbers | command (`python -m experiments.`) | picture "
        "| agreement |\n|---|---|---|---|---|---|"
    )
    lines = [line(item, table) for item in ITEMS]
    parts = [INTRODUCTION + total, "\n".join([head, *lines]) + "\n", CONVENTIONS + "### Pictures\n"]
    return "\n".join([*parts, *map(section, TITLES)])


def section(picture: str) -> str:
    """Return a picture with its title and the reasons for what disagrees."""
    text = " ".join(f"{i.number}: {i.why}" for i in ITEMS if i.picture == picture and i.why)
    image = f"![{TITLES[picture]}](figures/counterpart_{picture}.png)"
    body = textwrap.fill(f"*{TITLES[picture]}.* {text}", 120, break_on_hyphens=False)
    return f"{image}\n\n{body}\n"
