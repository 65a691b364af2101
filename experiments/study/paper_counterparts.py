"""Claim: all figures and tables of the paper with numbers have a counterpart; three disagree.

These three are the secant stiffness of a vault test, the calibrated stiffness of all eight, and the
errors against discrete elements. The others agree at least in part: half or more of their values
are within 5 % of print beyond rounding (`experiments.harness.yardstick`).

Method: `parts.counterpart_items` lists the paper's figures and tables in order with what has no
numbers; `parts.counterpart_rows` computes every printed value anew.
Which three disagree was seen in the first run; the claim fails if a fourth does, if one of the
three agrees, or if an item has no values.

Inputs: the shipped scene, plan and tables. Command: ``python -m
experiments paper_counterparts [--quick]``; it writes ``docs/counterparts.md`` too.
"""

import textwrap
from functools import cache, partial

import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import FIGURES, save_table, stored
from experiments.study.parts.counterpart_charts import drawn
from experiments.study.parts.counterpart_items import (
    AGREES,
    DISAGREES,
    ITEMS,
    PARTLY,
    TITLES,
    Item,
    stated,
    statement,
    verdict,
)
from experiments.study.parts.counterpart_rows import Ours, ours, tabulate

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


KNOWN = {"fig:secant_stiff", "table:model_results", "table:validation_results"}
QUICK = {"fig:arch_vault", "table:model_results", "table:2robot_tension", "table:optimization2"}


def faults(items: list[Item], table: pd.DataFrame) -> list[str]:
    out = []
    for item in items:
        rows = table[table["id"] == item.label]
        if rows.empty:
            out.append(f"{item.label} has no counterpart")
        elif (verdict(rows) == DISAGREES) != (item.label in KNOWN):
            out.append(statement(item, rows))
    return out


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    items = [item for item in ITEMS if item.has_numbers and (not quick or item.label in QUICK)]
    own = ours()
    table = pd.concat([tabulate(item.label, own) for item in items], ignore_index=True)
    for item in items:
        print(statement(item, table[table["id"] == item.label]))
    if options.store:
        save_table(table, "paper_counterparts", CLAIM.digits)
        table = stored("paper_counterparts")  # captions tell what is stored
        (FIGURES.parent / "counterparts.md").write_text(page(table), encoding="utf-8")
    return Finding(dict.fromkeys(faults(items, table), False), tables={"paper_counterparts": table})


@cache
def model() -> Ours:
    return ours()


def picture(name: str) -> Figure:
    return drawn(name, stored("paper_counterparts"), model())


CLAIM = Claim(
    experiment,
    digits=6,
    quick="a few items",
    pictures={f"counterpart_{name}.png": partial(picture, name) for name in TITLES},
)
