"""Tables of the page on the library of instances, from the rows that its contest has stored."""

import numpy as np
import pandas as pd

from experiments.harness.results import markdown, two
from experiments.instances.parts.library import command

CLOSED = 1e-6  # of a value: a gap that is none


def instance_tables(
    library: pd.DataFrame, contest: pd.DataFrame, large: pd.DataFrame
) -> dict[str, str]:
    """Return the tables by the names under which pages have them."""
    still = library[library["gap"] > CLOSED]
    named = [
        f"- `{row.instance}`: {100 * row.gap:.2g} % ({row.asked})" for row in still.itertuples()
    ]
    return {
        "instance_count": str(len(library)),
        "instance_library": _library(library),
        "instance_open": "\n".join(
            [
                f"Of {len(library)} instances {len(library) - len(still)} are closed. What is left "
                "between the best path and what is proven:",
                "",
                *named,
            ]
        ),
        "instance_ways": _ways(contest, library),
        "instance_large": _large(large),
    }


def _large(large: pd.DataFrame) -> str:
    """Return a row per instance that is made by its command alone: its size, and the command."""
    rows = []
    for row in large.itertuples():
        size = f"{row.nodes:,} / {row.arcs:,}"
        rows.append(
            [f"`{row.instance}`", size, f"{row.size_MB:.1f} MB", f"`{command(row.instance)}`"]
        )
    return markdown(["instance", "nodes / arcs", "file", "command"], rows)


def with_gaps(contest: pd.DataFrame, library: pd.DataFrame) -> pd.DataFrame:
    """Return runs with their gaps, whether the best known was found, and closed by the run."""
    best = contest["instance"].map(library.set_index("instance")["value"])
    off = (contest["value"] - best).abs() <= 1e-5 * best.abs()
    size = contest["value"].abs().replace(0.0, 1.0)
    gap = ((contest["value"] - contest["bound"]) / size).clip(lower=0.0)
    return contest.assign(best=off, gap=gap, closed=off & (gap <= 1e-4))


def _library(library: pd.DataFrame) -> str:
    rows = []
    for row in library.itertuples():
        gap = "none" if row.gap <= CLOSED else f"{100 * row.gap:.2g} %"
        values = " ".join(f"{float(value):.6g}" for value in str(row.values).split())
        size = f"{row.nodes:,} / {row.arcs:,}"
        proven = f"{row.proven:.6g}"
        rows.append([f"`{row.instance}`", size, row.asked, values, proven, gap, f"`{row.by}`"])
    head = ["instance", "nodes / arcs", "asked", "best known", "proven", "gap", "found by"]
    return markdown(head, rows)


def _ways(contest: pd.DataFrame, library: pd.DataFrame) -> str:
    """Return a row per way to solve: what it was given, found and closed, its times and gaps."""
    table = with_gaps(contest, library)
    rows = []
    for name, own in table.groupby("solver", sort=False):
        left = own["gap"].replace(np.inf, np.nan).dropna()
        middle = f"{100 * left.max():.2g} %" if len(left) else "–"
        counts = (len(own), own["value"].notna().sum(), own["best"].sum(), own["closed"].sum())
        times = [f"{two(own['seconds'].median())} s", f"{two(own['seconds'].max())} s"]
        rows.append([f"`{name}`", *map(str, counts), middle, *times])
    rows.sort(key=lambda row: (row[0] in ("`HiGHS`", "`CP-SAT`"), row[0]))
    head = ["way", "instances", "path found", "best known", "closed by itself", "largest gap"]
    return markdown([*head, "median time", "longest"], rows)
