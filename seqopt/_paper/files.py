"""The files of ``seqopt paper``: the paper's tables and figures beside the printed ones."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

import pandas as pd

from seqopt._files import csv_text
from seqopt._paper.items import ITEMS, TITLES, Item, stated, verdict
from seqopt._paper.rows import Ours, ours, tabulate
from seqopt.study.published import SOURCE
from seqopt.work.progress import Tell, with_progress

NUMBERED = tuple(item for item in ITEMS if item.has_numbers)
PAGE = "paper.md"
HEAD = f"""\
# The paper's tables and figures beside ours

{SOURCE}. An item agrees if every value is within 5 % of print beyond rounding, agrees in part if
half of them are, and disagrees otherwise. `counterparts.csv` has all values, and the file of an
item those of it: what is printed, what seqopt computes, and how far that is off.

"""


def counterparts(tell: Tell) -> tuple[Ours, pd.DataFrame]:
    """Return our models, and every printed value beside the one that is computed anew."""
    tell("computing the responses of all methods")
    own = ours()
    labels = [item.label for item in NUMBERED]
    tables = [tabulate(label, own) for label in with_progress("setting beside print", labels, tell)]
    return own, pd.concat(tables, ignore_index=True)


def agreement_lines(table: pd.DataFrame) -> list[str]:
    """Return in a line how each item agrees."""
    return [stated(item, table) for item in NUMBERED]


def agreement_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row for every item: what it is, what becomes of it, and why."""
    rows = []
    for item in ITEMS:
        own = table[table["id"] == item.label]
        word = verdict(own) if len(own) else "no numbers"
        rows.append({"item": item.number, "shows": item.shows, "agreement": word, "why": item.why})
    return pd.DataFrame(rows)


def paper_files(own: Ours, table: pd.DataFrame, tell: Tell) -> dict[str, bytes | str]:
    """Return tables, figures where they can be drawn, and a page that lists them, by name."""
    files: dict[str, bytes | str] = {"counterparts.csv": csv_text(table)}
    for item in NUMBERED:
        files[_name(item)] = csv_text(table[table["id"] == item.label].drop(columns="id"))
    pictures = dict(_pictures(own, table, tell))
    page = HEAD + "\n".join(_entry(item, table, drawn=bool(pictures)) for item in ITEMS)
    return files | pictures | {PAGE: page}


def _name(item: Item) -> str:
    kind, _, number = item.number.partition(" ")
    return f"{kind.lower()}_{number.replace('.', '')}.csv"


def _pictures(own: Ours, table: pd.DataFrame, tell: Tell) -> Iterator[tuple[str, bytes | str]]:
    """Yield figures by file name; none where matplotlib, an extra, is not installed."""
    if find_spec("matplotlib") is None:
        return
    from seqopt._paper.charts import drawn  # noqa: PLC0415
    from seqopt.report._style import picture_files  # noqa: PLC0415

    for name in with_progress("drawing figures", [*TITLES], tell):
        yield from picture_files(name, drawn(name, table, own)).items()


def _entry(item: Item, table: pd.DataFrame, *, drawn: bool) -> str:
    """Return what the page says of an item."""
    head = f"## {item.number}, section {item.section}: {item.shows}\n"
    if not item.has_numbers:
        return f"{head}\nNo numbers: {item.why}.\n"
    where = f"Values: `{_name(item)}`." + f" Picture: `{item.picture}.png`." * drawn
    why = item.why.partition("[")[0].strip()  # the rest is a link to a page of the site
    return "\n".join([head, " ".join(filter(None, (stated(item, table), why, where))), ""])
