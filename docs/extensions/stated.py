"""Figures that the documentation states, from the rows that experiments have stored.

The site is built with them: ``{{ name }}`` in a page stands for the entry of that name. A test
holds the README, which is read as it is, to the same rows.
"""

import numpy as np
import pandas as pd

from experiments.harness.results import markdown, stored, two
from experiments.instances.parts.tables import instance_tables
from experiments.placement.parts.speed_points import speed_tables
from seqopt.graph.formulation import formulations

INSTANCES = ("instance_library", "instance_contest", "instance_large")
UNNEEDED = "not needed without budgets"
FREE = {
    "overlap_dp": "the least sum (the default)",
    "minimax": "the least worst step",
    "cascade": "the paper's scheme; without the proof it needs few models",
    "rank_search": "comparison: looking at the next moves",
    "beam": "comparison: keeping several choices",
    **dict.fromkeys(("lagrangian", "labels", "overlap_lp", "overlap_mip"), UNNEEDED),
}
CAPPED = {
    "labels": "the best choice, proven (the default with budgets)",
    "lagrangian": "bound, prices and a good choice if there are too many labels",
    "overlap_lp": "to check the prices; its choice need not keep the budgets",
    "overlap_mip": "to check `labels` by a program that shares nothing with it",
}


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


def _contest(table: pd.DataFrame, when: dict[str, str]) -> str:
    kinds = {name: each.kind.value for name, each in formulations("costs").items()}
    counts = sorted(table["bricks"].unique())
    head = ["formulation", "use it for", "kind", "largest gap"]
    head += [*(f"{n} bricks" for n in counts), "memory"]
    rows = []
    for name, use in when.items():
        own = table[table["formulation"] == name]
        by = [own[own["bricks"] == count] for count in counts]
        most = 100 * own["proven_gap"].max()  # as the certificate proves it
        gap = "none" if most < 1e-4 else f"{two(most)} %"
        cells = [f"[`{name}`](programs.md#{name})", use, kinds[name], gap]
        rows.append([*cells, *map(_choosing, by), f"{two(own['memory_MB'].max())} MB"])
    return markdown(head, rows)


def _choosing(own: pd.DataFrame) -> str:
    """Return the median time to choose, and in how many problems no end was reached."""
    if own.empty:
        return "–"
    notes = {
        "stopped": int((own["end"] == "stopped").sum()),
        "without a choice": int(own["end"].isin(["no choice", "died"]).sum()),
    }
    said = [f"{count} of {len(own)} {what}" for what, count in notes.items() if count]
    return f"{two(own['solve'].median())} s" + (f" ({', '.join(said)})" if said else "")


KEY = ["bricks", "criterion", "case"]
LARGE = 100  # bricks
PROVEN, UNPROVEN = "overlap_dp", "rank_search, no proof"


def stated() -> dict[str, str]:
    """Return every figure and table by the name that stands for it."""
    contest, runs = stored("budget_proofs"), stored("runs")
    return (
        {"free_table": _contest(contest[contest["budgets"] == 0], FREE)}
        | {"budget_table": _contest(contest[contest["budgets"] > 0], CAPPED)}
        | _solvers(contest)
        | _budgets(contest)
        | _engines(runs)
        | _taken(stored("speed_points"))
        | _heuristics(runs, stored("heuristic_gaps"))
        | _shapes(stored("program_shapes"))
        | _outside(stored("outside_assemblies"))
        | _composing(stored("composing"))
        | {"vault_loads_table": _vault_loads(stored("vault_loads"))}
        | {"free_formulations_table": _on_graphs(stored("free_formulations"))}
        | {"classical_table": _classical(stored("classical"))}
        | {"makespan_table": _makespans(stored("makespan"), stored("makespan_large"))}
        | instance_tables(*map(stored, INSTANCES))
    )


def _vault_loads(table: pd.DataFrame) -> str:
    """Return a row per tested vault: what it weighs, and the line load that it bears, kN."""
    head = ["test", "weight", "line load", "weight with fill", "line load with fill"]
    columns = ["bare_weight", "bare", "filled_weight", "filled"]
    rows = [
        [f"{row['test']:.0f}", *("falls" if np.isnan(row[c]) else f"{row[c]:.3g}" for c in columns)]
        for row in table.to_dict("records")
    ]
    return markdown(head, rows)


def _composing(table: pd.DataFrame) -> dict[str, str]:
    """Return how many pairs of schedules and other words there are, and which."""
    schedules, words = (", ".join(table[name].unique()) for name in ("schedule", "with"))
    told = {"composing_schedules": schedules, "composing_words": words}
    return {**told, "composing_cells": str(len(table))}


def _on_graphs(table: pd.DataFrame) -> str:
    """Return a row per formulation and aim: times, gaps where a minute ended, or what ended it."""
    counts = sorted(table["bricks"].unique())
    gap = (100 * table["gap"]).map(two).radd(", gap ").add(" %").where(table["gap"] >= 1e-6, "")
    gap = gap.where(np.isfinite(table["gap"]), ", no bound")
    took = table["seconds"].map(two) + " s" + gap
    table = table.assign(cell=took.where(table["value"].notna(), table["status"]))
    rows = []
    for name, own in table.groupby("formulation", sort=False):
        for aim, part in own.groupby("aim", sort=False):
            cells = part.set_index("bricks")["cell"].reindex(counts, fill_value="not asked")
            rows.append([f"`{name}`", part["kind"].iloc[0], str(aim), *cells])
    return markdown(["formulation", "kind", "aim", *(f"{n} bricks" for n in counts)], rows)


def _makespans(*tables: pd.DataFrame) -> str:
    """Return a row per arch, robots and formulation: the plan, its proven bound, and seconds."""
    every = pd.concat(tables).sort_values(["bricks", "robots", "formulation"], kind="stable")
    rows = [
        [
            str(row["bricks"]),
            row["robots"],
            f"`{row['formulation']}`",
            f"{row['planned']:.0f} s",
            f"{row['makespan']:.0f} s",
            f"{row['proven']:.0f} s",
            row["status"]
            if pd.isna(row["stopped"])
            else f"{row['status']} ({row['stopped']} ended)",
            f"{two(row['seconds'] + row['verify'])} s",
        ]
        for row in every.to_dict("records")
    ]
    head = ["bricks", "robots", "formulation", "fewest steps", "makespan", "proven bound"]
    return markdown([*head, "status", "took"], rows)


def _classical(table: pd.DataFrame) -> str:
    off = ((100 * table["off"]).round(2) + 0.0).map("{:.2f} %".format)
    off = off.where(table["known"].notna(), "–")
    numbers = [table[name].map("{:.4g}".format).replace("nan", "–") for name in ("known", "ours")]
    rows = zip(table["result"], table["source"], *numbers, off, strict=True)
    return markdown(["result", "by", "known", "ours", "difference"], [*rows])


def _outside(table: pd.DataFrame) -> dict[str, str]:
    counts = table["outcome"].value_counts()
    elsewhere = ~table["source"].str.startswith("compas_cra")
    return {
        "outside_elsewhere": str(int(elsewhere.sum())),
        "outside_plans": str(counts["plan"]),
        "outside_lacks": str(counts["lacks"]),
        "outside_found": f"{table['found'].median():.4g}",
    }


def _shapes(table: pd.DataFrame) -> dict[str, str]:
    seconds = table.set_index("formulation")["seconds"]
    return {
        "shapes_table": shapes_table(table),
        "arc_s": two(seconds["minimax_arc"]),
        "big_m_s": two(seconds["minimax_big_m"]),
    }


def _solvers(contest: pd.DataFrame) -> dict[str, str]:
    free = contest[contest["budgets"] == 0].set_index(["formulation", *KEY])["solve"].sort_index()
    out = {}
    for name in ("lp", "mip"):
        times = (free[f"overlap_{name}"] / free["overlap_dp"]).groupby(level="bricks").median()
        out |= {f"{name}_times_{n}": two(value) for n, value in times.iloc[[0, -1]].items()}
    return out


def _budgets(contest: pd.DataFrame) -> dict[str, str]:
    """Return how labels do, and how long HiGHS takes where it finishes, over them."""
    capped = contest[contest["budgets"] > 0]
    by = {name: rows.set_index(KEY) for name, rows in capped.groupby("formulation")}
    own, other, priced = (by[name] for name in ("labels", "overlap_mip", "lagrangian"))
    every = (other["solve"] / own["solve"]).dropna()  # at least, where it was stopped
    finished = other[other["end"] == "done"]
    times, large = every[finished.index], every.xs(LARGE, level="bricks")
    bound = 100 * (1 - priced["bound"] / own["objective"])
    return {
        "capped_problems": str(len(own)),
        "labels_stopped": str(int((own["end"] == "stopped").sum()) or "none"),
        "labels_left": two(100 * own["proven_gap"].max()),
        "highs_problems": str(len(other)),
        "highs_finished": str(len(finished)),
        "highs_least": two(times.min()),
        "highs_median": two(times.median()),
        "highs_most": two(times.max()),
        "highs_large": str(len(large)),
        "highs_large_finished": str(int((other.loc[LARGE, "end"] == "done").sum()) or "none"),
        "highs_large_least": two(large.min()),
        "highs_memory": two(other["memory_MB"].max() / 1024),
        "lagrangian_below": two(bound.max()),
        "lagrangian_gap": two(100 * priced["proven_gap"].max()),
    }


def _taken(points: pd.DataFrame) -> dict[str, str]:
    """Return which engine and formulation to take in each scene of README's chart."""
    names = ("arch", "vault", "wall")
    return {
        f"take_{name}": table.sentence
        for name, table in zip(names, speed_tables(points), strict=True)
    }


def _engines(runs: pd.DataFrame) -> dict[str, str]:
    every = runs.set_index(["engine", "formulation", "scene", "criterion"])["total"].sort_index()
    total = every.xs("equations-2-3", level="criterion")
    rigid, frame, auto = (total[name] for name in ("rigid bricks", "frame 1e7", "auto"))
    share = rigid[UNPROVEN] / rigid[PROVEN]
    ratios = every["frame 1e7", PROVEN] / every["rigid bricks", PROVEN]
    return {
        "frame_times": two(frame[PROVEN, "arch25"] / rigid[PROVEN, "arch25"]),
        "frame_times_least": two(ratios.min()),
        "auto_more": two(100 * (auto[PROVEN, "arch25"] / rigid[PROVEN, "arch25"] - 1)),
        "proof_share_25": two(100 * (1 - share["arch25"])),
        "proof_share_49": two(100 * (1 - share["chain49"])),
        "frame_proof_share": two(100 * (1 - frame[UNPROVEN, "arch25"] / frame[PROVEN, "arch25"])),
        "frame_proof_s": two(frame[PROVEN, "arch25"]),
        "frame_no_proof_s": two(frame[UNPROVEN, "arch25"]),
        "rigid_proof_s": two(rigid[PROVEN, "arch25"]),
        "rigid_proof_49_s": two(rigid[PROVEN, "chain49"]),
        "rigid_no_proof_49_s": two(rigid[UNPROVEN, "chain49"]),
    }


def _heuristics(runs: pd.DataFrame, gaps: pd.DataFrame) -> dict[str, str]:
    own = runs[(runs["engine"] == "rigid bricks") & (runs["formulation"] == "cascade")]
    by = (100 * gaps.set_index(["criterion", "formulation"])["gap"]).groupby(level=[0, 1])
    median, high, most = by.median(), by.quantile(0.9), by.max()
    rows = [
        [
            f"`{criterion}`",
            *(f"{of[criterion, 'cascade']:.2f} %" for of in (median, high, most)),
            *(f"{of[criterion, 'rank_search']:.2f} %" for of in (high, most)),
            f"{most[criterion, 'beam']:.2f} %",
        ]
        for criterion in gaps["criterion"].unique()
    ]
    head = ["criterion", "cascade: median", "90th percentile", "largest"]
    head += ["rank_search (two moves): 90th percentile", "largest", "beam of five: largest"]
    return {
        "chart_problems": str(len(own)),
        "cascade_mean": two(100 * own["gap"].mean()),
        "cascade_most": two(100 * own["gap"].max()),
        "arches": str(gaps["draw"].nunique()),
        "gaps_table": markdown(head, rows),
    }
