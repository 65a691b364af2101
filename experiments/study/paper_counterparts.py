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

from functools import cache, partial

import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import FIGURES, save_table, stored
from experiments.study.parts.counterpart_charts import drawn
from experiments.study.parts.counterpart_items import (
    DISAGREES,
    ITEMS,
    TITLES,
    Item,
    statement,
    verdict,
)
from experiments.study.parts.counterpart_page import page
from experiments.study.parts.counterpart_rows import Ours, ours, tabulate

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
