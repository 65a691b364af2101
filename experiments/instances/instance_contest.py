"""Claim: of every instance of the library a path is known that the judge of bare solutions accepts.

What is claimed by any way to solve it, ours or that of outside solvers, contradicts nothing that is
proven: no value is below a proven bound, no bound is above a value. Where costs are of layers, and
where a worst step comes first, the best is proven without a scene within a second. What is open is
what no certificate closes: sums over states within budgets, and totals over scenarios.

Method: every formulation that fits an instance, HiGHS on the MPS file and CP-SAT on its
text, one after the other with 4 s each; what is
given to outside solvers has 20,000 arcs at most. Values and bounds are of the first goal. Seconds
are of the processor, reading and writing of files included. The best paths are kept in
``known.json``, a better one that was known before stays.

Inputs: ``experiments/instances/library``. Command: ``python -m
experiments instance_contest [--quick] [--only-of NAME,NAME]``.
"""

import json
from collections.abc import Sequence

import pandas as pd

from experiments.harness.claim import Claim, Extra, Finding, Option, Options
from experiments.harness.results import drawn, stored
from experiments.instances.parts.contest_chart import chart
from experiments.instances.parts.contest_run import OUTSIDE, run, solvers
from experiments.instances.parts.library import KNOWN, MADE, instance, known
from seqopt import judge_instance

QUICK = ("chain-8", "pair-25-peak", "wall-6")
SECONDS = 4.0
SLOW = ("path_labels",)  # left out: best_first knows more
CLOSE = 1e-6
LABELS = 5000  # of a proof that is kept


def holds(table: pd.DataFrame, library: pd.DataFrame) -> bool:
    """Return whether every instance has a value, and nothing contradicts what is proven."""
    least = library.set_index("instance")["value"]
    proven = library.set_index("instance")["proven"]
    size = least.abs().clip(lower=1e-9)
    complete = bool(least.notna().all()) and bool((proven <= least + CLOSE * size).all())
    own = table.set_index("instance")
    value, bound = own["value"], own["bound"]
    below = proven.reindex(own.index) - CLOSE * size.reindex(own.index)
    none_below = bool((value.isna() | (value >= below)).all())
    above = least.reindex(own.index) + 1e-4 * size.reindex(own.index)  # as solvers promise
    none_above = bool((bound.isna() | (bound <= above)).all())
    return complete and none_below and none_above


def experiment(options: Options) -> Finding:
    asked = options.only_of.split(",") if options.only_of else [*MADE]
    names = QUICK if options.quick else asked
    if unknown := set(names) - set(MADE):
        raise SystemExit(f"--only-of: there is no instance {min(unknown)!r}; give names of MADE")
    rows, best = [], {} if options.quick else known()
    for name in names:
        for solver in solvers(instance(name)):
            if solver in SLOW or (options.quick and solver in OUTSIDE):
                continue
            row = run(name, solver, SECONDS)
            rows.append({key: row[key] for key in COLUMNS})
            print(*rows[-1].values(), flush=True)
            _keep(best, row)
    if options.store:
        KNOWN.write_text(_lines(best), "utf-8")
    listed = [_listed(name, best[name]) for name in names if name in best]
    found = {"instance_contest": pd.DataFrame(rows), "instance_library": pd.DataFrame(listed)}
    if not options.quick:
        found = {table: _joined(own, table, names) for table, own in found.items()}
    return Finding(holds(*found.values()), tables=found)


def _joined(rows: pd.DataFrame, name: str, names: Sequence[str]) -> pd.DataFrame:
    """Return rows, and those that are stored of other instances, in the library's order."""
    before = stored(name)
    others = before[before["instance"].isin(set(MADE) - set(names))]
    place = {each: k for k, each in enumerate(MADE)}
    every = pd.concat([others, rows], ignore_index=True)
    return every.sort_values("instance", key=lambda of: of.map(place), kind="stable")


def _lines(best: dict[str, dict]) -> str:
    """Return what is known as JSON, a line for every instance."""
    rows = [f"{json.dumps(name)}: {json.dumps(best[name])}" for name in MADE if name in best]
    return "{" + ",\n".join(rows) + "}\n"


COLUMNS = ("instance", "solver", "value", "bound", "proven", "end", "seconds")


def _keep(best: dict[str, dict], row: dict) -> None:
    """Keep what a run found, if it is better, or if more is proven."""
    if not row["nodes"]:
        return
    before = best.get(row["instance"])
    now = (*row["values"],)
    claims = _small(row["claims"])
    proof = judge_instance(instance(row["instance"]), {"nodes": row["nodes"]}, claims)
    found = {"values": [*now], "nodes": row["nodes"], "by": row["solver"], "claims": claims}
    found |= {"bounds": [*proof.bounds], "bound_by": row["solver"]}
    if before is None or _better(now, before["values"]):
        if before is not None and len(now) == 1 and before["bounds"][0] > found["bounds"][0]:
            found |= {key: before[key] for key in ("bounds", "bound_by", "claims")}
        best[row["instance"]] = found
    elif _same(now, before["values"]) and _better(before["bounds"], found["bounds"]):
        before |= {key: found[key] for key in ("bounds", "bound_by", "claims")}


def _small(claims: list[dict]) -> list[dict]:
    """Return claims without labels that are too many to be kept."""
    many = any(len(each.get("labels", {}).get("nodes", ())) > LABELS for each in claims)
    less = ("labels", "value")
    return [{k: v for k, v in c.items() if k not in less} for c in claims] if many else claims


def _better(first: list[float], then: list[float]) -> bool:
    """Return whether values are less, goal by goal, by more than rounding."""
    for a, b in zip(first, then, strict=False):
        if abs(a - b) > CLOSE * max(abs(a), abs(b)):
            return a < b
    return False


def _same(first: list[float], then: list[float]) -> bool:
    return not _better(first, then) and not _better(then, first)


def _listed(name: str, found: dict) -> dict[str, object]:
    """Return what is known of an instance, as the judge says it now."""
    one = instance(name)
    proof = judge_instance(one, {"nodes": found["nodes"]}, found["claims"])
    return {
        "instance": name,
        "nodes": one.nodes,
        "arcs": one.arcs,
        "asked": ", ".join(
            [g.name for g in one.goals] + [f"{c.name} <= {c.most:g}" for c in one.caps]
        ),
        "value": proof.objective,
        "proven": proof.bounds[0],
        "values": " ".join(f"{v:.9g}" for v in proof.values),  # noqa: PD011  # no frame
        "gap": proof.gap,
        "by": found["by"],
        "bound_by": found["bound_by"],
    }


CLAIM = Claim(
    experiment,
    quick="three instances, our formulations alone",
    options=(Option("--only-of", "these instances alone, as free-7,wall-6; others stay", ""),),
    needs=(Extra("ortools", "pip install 'seqopt[cp]'"),),
    pictures={"instance_contest.png": drawn(chart, "instance_contest", "instance_library")},
    digits=9,
)
