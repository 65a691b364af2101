"""The page of the documentation that lists the counterparts.

Every number comes from the rows of `experiments.study.paper_counterparts`; a test compares them.
"""

import textwrap

import pandas as pd

from seqopt.report._paper.agreement import AGREES, DISAGREES, PARTLY, TITLES, stated, verdict
from seqopt.report._paper.items import ITEMS, Item

INTRODUCTION = """\
# Counterparts of the paper's figures and tables

This page lists every figure and table of the [paper](paper.md), and compares those that have
numbers with what seqopt computes. Photographs, sketches and definitions have no numbers.
`python -m experiments.study.paper_counterparts` computes everything again in a few seconds, draws
the pictures and writes this page; `seqopt paper --out DIR` writes tables and figures from an
installation. All values are in `experiments/results/paper_counterparts.csv`.
Where another experiment goes into more detail, the table names it too.

The error is the difference from the printed value beyond its rounding, relative to the printed
value or to 1. An item *agrees* if every value is within 5 % of print, *agrees in part* if at
least half of the values are, and *disagrees* otherwise.

"""
CONVENTIONS = """\
In the CSV file a grip is given by its node; -1 means no grip, and 1003 means the optimized grip O3.
Forces of robots and of the support (the first ground end) are compared by magnitude, and `T_pct` to
within two edges. Figures and tables are numbered in the order of the paper's source.

"""


def line(item: Item, table: pd.DataFrame) -> str:
    """Return the row of the page's table for an item."""
    head = f"| {item.number}, section {item.section}: `{item.label}` | {item.shows} |"
    if not item.has_numbers:
        return f"{head} no: {item.why} | – | – | – |"
    named = ", ".join(f"`{name}`" for name in ("study.paper_counterparts", item.also) if name)
    picture = f"[picture](figures/counterpart_{item.picture}.png)"
    text = stated(item, table).removeprefix(f"{item.number} ")
    return f"{head} yes | {named} | {picture} | {text} |"


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
    parts = [INTRODUCTION + total, "\n".join([head, *lines]) + "\n", CONVENTIONS + "## Pictures\n"]
    return "\n".join([*parts, *(section(picture, table) for picture in TITLES)])


def section(picture: str, table: pd.DataFrame) -> str:
    """Return a picture with its caption and the reasons for what disagrees."""
    items = [item for item in ITEMS if item.picture == picture]
    text = " ".join(f"{stated(item, table)} {item.why}".strip() for item in items)
    image = f"![{TITLES[picture]}](figures/counterpart_{picture}.png)"
    body = textwrap.fill(f"*{TITLES[picture]}.* {text}", 120, break_on_hyphens=False)
    return f"{image}\n\n{body}\n"
