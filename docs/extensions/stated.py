"""Figures that the documentation states, from the rows that experiments have stored.

The site is built with them: ``{{ name }}`` in a page stands for the entry of that name. A test
holds the README, which is read as it is, to the same rows.
"""

import numpy as np
import pandas as pd

from experiments.harness.results import markdown, stored, two
from experiments.instances.instance_contest import instance_tables
from experiments.placement.formulations import CUT, QUESTIONS, ratios
from experiments.placement.speed_accuracy import tables
from seqopt.report._regret._measure import RIGID_GRIPS
from seqopt.report._regret._table import percent

INSTANCES = ("instance_library", "instance_contest", "instance_large")


def stated() -> dict[str, str]:
    """Return every figure and table by the name that stands for it."""
    every = stored("formulations")
    return (
        {"questions_table": _questions(every), "refused_table": _refused(every)}
        | _taken(stored("regret"))
        | _digits(stored("digits"))
        | _heuristics(stored("heuristic_gaps"))
        | _outside(stored("outside_assemblies"))
        | {"vault_loads_table": _vault_loads(stored("vault_loads"))}
        | {"classical_table": _classical(stored("classical"))}
        | {"makespan_table": _makespans(stored("makespan"), stored("makespan_large"))}
        | instance_tables(*map(stored, INSTANCES))
        | _failing(stored("where_numbers_fail"), stored("where_steps_fall"))
    )


def _failing(numbers: pd.DataFrame, steps: pd.DataFrame) -> dict[str, str]:
    """Return how many answers and verdicts were held against others, and how many decided."""
    ends = numbers[["answered", "refused", "infeasible", "failed", "mechanism"]].sum()
    told = ", ".join(f"{count:,} {name}" for name, count in ends.items())
    left, every = steps["own_open"].sum(), steps["steps"].sum()
    checked = f"Of {every:,} verdicts they decide {every - left:,} and contradict none."
    kernels = f"under {numbers['kernels'].max()} kernels {told}, {numbers['wrong'].sum()} off"
    return {"failing_counts": kernels, "failing_checked": checked}


def _questions(rows: pd.DataFrame) -> str:
    """Return a row per question: how far it is proven, by what soonest, and by integers."""
    at = 25  # bricks
    rows = rows.assign(times=ratios(rows))
    out = []
    for question in QUESTIONS:
        own = rows[(rows["question"] == question) & rows["value"].notna()]
        proven = own[own["proven"].astype(bool)]
        large = proven[proven["bricks"] == proven["bricks"].max()].sort_values("seconds")
        exact = large[large["kind"] == "exact"].iloc[0]
        program = own[(own["formulation"] == "overlap_mip") & (own["bricks"] == at)].iloc[0]
        took = f"{two(program['times'])}{'' if program['proven'] else ', stopped'}"
        cells = [str(exact["bricks"]), f"`{exact['formulation']}`", two(exact["seconds"]) + " s"]
        out.append([question, *cells, f"{exact['models']:,.0f}", str(len(large)), took])
    head = ["question", "proven up to", "soonest exact one", "time", "models", "prove it"]
    return markdown([*head, f"integer program, {at} bricks"], out)


def _refused(rows: pd.DataFrame) -> str:
    """Return a row per formulation that answers none of the questions, with its reason."""
    able = {*rows["formulation"][rows["value"].notna()], CUT}
    told = rows[~rows["formulation"].isin(able)].groupby("formulation")["said"].last()
    return markdown(
        ["formulation", "why not"],
        [
            [f"`{name}`", said.partition(": ")[2] or said.partition(";")[0]]
            for name, said in told.items()
        ],
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


def _makespans(*tables: pd.DataFrame) -> str:
    """Return a row per arch and robots: the plan, its proven bound, and seconds."""
    every = pd.concat(tables).sort_values(["bricks", "robots"], kind="stable")
    rows = [
        [
            str(row["bricks"]),
            row["robots"],
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
    head = ["bricks", "robots", "fewest steps", "makespan", "proven bound"]
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
    }


def _taken(rows: pd.DataFrame) -> dict[str, str]:
    """Return which way to take in each scene of README's chart, and what others lose."""
    names = ("arch", "soft", "dry", "vault", "wall", "staged")
    found = dict(zip(names, tables(rows), strict=True))
    soft, arch = found["soft"].table, found["arch"].table
    rigid = soft[(soft["engine"] == RIGID_GRIPS) & (soft["without"] == "")]
    took = arch.set_index(["engine", "schedule", "formulation", "without"])["seconds"]
    search = "free", "schedule_search", ""
    off = found["staged"].table["value"] / found["staged"].table["own"]
    return {f"take_{name}": table.sentence for name, table in found.items()} | {
        "rigid_grips_regret": " and ".join(percent(each) for each in sorted(rigid["regret"])),
        "ranks_regret_soft": " and ".join(
            percent(each) for each in sorted(soft.loc[soft["without"] == "ranks", "regret"])
        ),
        "rigid_proof_s": two(took["compliance", "loop", "overlap_dp", "ranks"]),
        "promised": f"{two(off.min())} to {two(off.max())}",
        "frame_times": two(took["frame", *search] / took["compliance", *search]),
    }


def _digits(rows: pd.DataFrame) -> dict[str, str]:
    """Return how many times as long searches take with all digits as where six may decide."""
    times = (rows["all_s"] / rows["six_s"]).groupby(rows["bricks"])
    least, most = times.min(), times.max()
    spans = {bricks: f"{two(least[bricks])} to {two(most[bricks])}" for bricks in least.index}
    return {"digits_small": spans[min(spans)], "digits_large": spans[max(spans)]}


def _heuristics(gaps: pd.DataFrame) -> dict[str, str]:
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
    return {"arches": str(gaps["draw"].nunique()), "gaps_table": markdown(head, rows)}
