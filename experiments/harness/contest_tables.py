"""Which formulation to use when, with what the stored contest measured of each, as tables."""

from __future__ import annotations

import pandas as pd

from experiments.harness.wording import markdown, two
from seqopt.placement.formulation import formulations

FREE = {
    "overlap_dp": "the least sum (the default)",
    "minimax": "the least worst step",
    "cascade": "the paper's scheme; without the proof it needs few models",
    "rank_search": "comparison: looking at the next moves",
    "beam": "comparison: keeping several choices",
    "lagrangian": "not needed without budgets",
    "labels": "not needed without budgets",
    "overlap_lp": "not needed without budgets",
    "overlap_mip": "not needed without budgets",
}
CAPPED = {
    "labels": "the best choice, proven (the default with budgets)",
    "lagrangian": "bound, prices and a good choice if there are too many labels",
    "overlap_lp": "to check the prices; its choice need not keep the budgets",
    "overlap_mip": "to check `labels` by a program that shares nothing with it",
}


def free_table(table: pd.DataFrame) -> str:
    """Return a row per formulation on problems without budgets."""
    return _table(table[table["budgets"] == 0], FREE)


def budget_table(table: pd.DataFrame) -> str:
    """Return a row per formulation on problems with budgets."""
    return _table(table[table["budgets"] > 0], CAPPED)


def shapes_table(table: pd.DataFrame) -> str:
    """Return a row per integer program: its size, what it proves relaxed, and how it ended."""
    head = ["program", "rows", "columns", "nonzeros", "binaries", "relaxation", "optimum"]
    rows = []
    for row in table.to_dict("records"):
        end = f"{two(row['seconds'])} s"
        if not row["proven"]:
            end += f", between {row['bound']:.1f} and {row['value']:.1f}"
        digits = ".1f" if row["aim"] == "sum" else ".3f"
        values = (f"{abs(round(row[name], 3)):{digits}}" for name in ("relaxed", "optimum"))
        sizes = (f"{row[name]:,}" for name in head[1:5])
        rows.append([f"`{row['formulation']}`", *sizes, *values, f"{row['nodes']:,}", end])
    return markdown([*head, "nodes", "time"], rows)


def _table(table: pd.DataFrame, when: dict[str, str]) -> str:
    kinds = {name: formulation.kind.value for name, formulation in formulations().items()}
    counts = sorted(table["bricks"].unique())
    head = ["formulation", "use it for", "kind", "largest gap"]
    head += [*(f"{n} bricks" for n in counts), "memory"]
    rows = []
    for name, use in when.items():
        own = table[table["formulation"] == name]
        by = [own[own["bricks"] == count] for count in counts]
        cells = [f"[`{name}`]({name}.md)", use, kinds[name], _gap(own)]
        rows.append([*cells, *map(_seconds, by), f"{two(own['memory_MB'].max())} MB"])
    return markdown(head, rows)


def _gap(own: pd.DataFrame) -> str:
    """Return the largest gap of a choice, as the certificate proves it."""
    most = 100 * own["proven_gap"].max()
    return "none" if most < 1e-4 else f"{two(most)} %"


def _seconds(own: pd.DataFrame) -> str:
    """Return the median time to choose, and in how many problems no end was reached."""
    if own.empty:
        return "–"
    notes = {
        "stopped": int((own["end"] == "stopped").sum()),
        "without a choice": int(own["end"].isin(["no choice", "died"]).sum()),
    }
    said = [f"{count} of {len(own)} {what}" for what, count in notes.items() if count]
    return f"{two(own['solve'].median())} s" + (f" ({', '.join(said)})" if said else "")
