"""The page of the documentation that lists the counterparts.

Every number comes from the rows of `experiments.study.paper_counterparts`; a test compares them.
"""

import textwrap

import pandas as pd

from experiments.study.parts.counterpart_items import (
    AGREES,
    DISAGREES,
    ITEMS,
    PARTLY,
    TITLES,
    Item,
    stated,
    verdict,
)

INTRODUCTION = """\
## Every figure and table

`python -m experiments paper_counterparts` computes every figure and table that has numbers,
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
