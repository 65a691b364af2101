"""Claim: of every instance of the library a path is known that the judge of bare solutions accepts.

What is claimed by any way to solve it, ours or that of outside solvers, contradicts nothing that is
proven: no value is below a proven bound, no bound is above a value. Where costs are of layers, and
where a worst step comes first, the best is proven without a scene within a second. What is open is
what no certificate closes: sums over states within budgets, and totals over scenarios.

Method: every formulation that fits an instance, HiGHS on the MPS file and CP-SAT on the same
program, one after the other with 4 s each; what is given to outside solvers has 20,000 arcs at
most. Values and bounds are of the first goal. Seconds are of the processor, reading and writing of
files included: limits are of the clock, and a way that reaches its limit runs again with a longer
one if others had the processor meanwhile. The best paths are kept in ``known.json``, a better one
that was known before stays.

Inputs: ``experiments/instances/library``. Command: ``python -m
experiments instance_contest [--quick] [--only-of NAME,NAME]``.
"""

import json
import math
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import isotonic_regression

from experiments.harness.charts import name_panels, note, subplots
from experiments.harness.claim import Claim, Extra, Finding, Option, Options
from experiments.harness.results import drawn, markdown, stored, two
from experiments.instances.parts.cp_sat import as_cp_sat
from experiments.instances.parts.library import KNOWN, MADE, command, instance, known
from formulations.solvers import _solve_file
from seqopt import judge_instance, save_instance, solve
from seqopt.arrays import Floats
from seqopt.errors import SeqoptError
from seqopt.graph.formulation import find_formulation
from seqopt.graph.graph import fewest_moves, reached
from seqopt.instances._solve import _claims
from seqopt.instances.model import Instance
from seqopt.report import _style as inks
from seqopt.report._style import dress, plain, styled

OUTSIDE = ("HiGHS", "CP-SAT")
MOST_ARCS = 20_000  # of what outside solvers are given
TRIES, ENOUGH = 3, 0.8  # with longer limits, until so much of the seconds is of the processor


def solvers(one: Instance) -> tuple[str, ...]:
    """Return the ways to solve an instance: formulations that fit, then outside solvers."""
    fits = one.arcs <= MOST_ARCS and not one.asks_time
    return (*one.fitting, *(OUTSIDE if fits else ()))


def run(name: str, solver: str, seconds: float) -> dict[str, object]:
    """Return a row: values and bounds of the first goal, and the path."""
    one, limit = instance(name), seconds
    row = {"instance": name, "solver": solver, "value": math.nan, "bound": math.nan}
    for _ in range(TRIES):
        start, clock = time.process_time(), time.perf_counter()
        try:
            found = (_outside if solver in OUTSIDE else _own)(one, solver, limit)
        except SeqoptError as error:
            found = {"end": str(error)[:60]}
        took, passed = time.process_time() - start, time.perf_counter() - clock
        if passed < limit or took > ENOUGH * seconds:
            break
        limit *= seconds / took
    empty = {"proven": math.nan, "end": "", "nodes": [], "claims": []}
    return row | empty | found | {"seconds": took}


def _own(one: Instance, solver: str, seconds: float) -> dict[str, object]:
    formulation = find_formulation(solver)
    timed = formulation.watched or "seconds" in formulation.options
    plan = solve(one, formulation, time_limit=seconds if timed else math.inf)
    proof = plan.certificate
    return {
        "value": proof.objective,
        "values": [*proof.values],  # noqa: PD011  # no frame
        "bound": max(plan.selection.bound[0], proof.bounds[0]),
        "proven": proof.bounds[0],
        "bounds": [*proof.bounds],
        "end": str(plan.status),
        "nodes": [*plan.nodes],
        "claims": [_plain(claim) for claim in _claims(one, plan.selection)],
    }


def _plain(claim) -> dict[str, object]:
    """Return a claim as JSON holds it."""
    out: dict[str, object] = {"prices": dict(claim.prices)} if claim.prices else {}
    if claim.value is not None and math.isfinite(claim.value):
        out["value"] = claim.value
    for name in ("weights", "shares"):
        if getattr(claim, name) is not None:
            out[name] = getattr(claim, name).tolist()
    if claim.labels is not None:
        nodes, values = claim.labels
        out["labels"] = {"nodes": nodes.tolist(), "values": values.tolist()}
    return out


def _outside(one: Instance, solver: str, seconds: float) -> dict[str, object]:
    """Return what a solver finds that reads a file."""
    with TemporaryDirectory() as folder:
        end, bound, taken = WAYS[solver](one, Path(folder), seconds)
    if taken is None:
        return {"end": end, "bound": bound}
    arcs = np.asarray(taken) > 0.5
    part = one.graph.only(arcs)
    if not part.ends[reached(part)].any():
        return {"end": f"{end}, no path", "bound": bound}
    nodes = fewest_moves(part)
    proof = judge_instance(one, nodes)
    found = {"value": proof.objective, "proven": proof.bounds[0]}
    found |= {"values": [*proof.values]}  # noqa: PD011  # no frame
    return {**found, "bound": bound, "end": end, "nodes": [*map(int, nodes)]}


def _highs(one: Instance, folder: Path, seconds: float):
    save_instance(one, folder / "x.mps")
    end, value, bound, found = _solve_file(str(folder / "x.mps"), seconds)
    known = math.isfinite(value) and len(found) > 0 and abs(value) < 1e30
    return end.removeprefix("k"), bound, found[: one.arcs] if known else None


def _cp_sat(one: Instance, _: Path, seconds: float):
    from google.protobuf import text_format  # noqa: PLC0415  # comes with OR-tools, an extra
    from ortools.sat.python import cp_model  # noqa: PLC0415

    model, solver = cp_model.CpModel(), cp_model.CpSolver()
    text_format.Parse(as_cp_sat(one), model.Proto())
    solver.parameters.max_time_in_seconds = seconds
    solver.parameters.num_workers = 1
    status = solver.solve(model)
    known = status in (cp_model.OPTIMAL, cp_model.FEASIBLE)
    found = [*solver.response_proto.solution][: one.arcs] if known else None
    return solver.status_name(status).capitalize(), solver.best_objective_bound, found


WAYS = {"HiGHS": _highs, "CP-SAT": _cp_sat}

BEST = "best of ours"
DASHES = {"HiGHS": "-", "CP-SAT": (0, (1, 1.2))}
COLORS = (inks.BLUE, inks.GREEN, inks.PURPLE, inks.ORANGE, inks.SKY)
TIMES, GAPS = (0.02, 20.0), (1e-4, 1.0)  # s, of values: what axes show
ROOM = 5.5  # percent between two labels


@styled
def chart(contest: pd.DataFrame, library: pd.DataFrame) -> Figure:
    """Draw the share of all instances closed within a time, and within a gap after every run."""
    runs = with_gaps(contest, library)
    runs["closing"] = runs["seconds"].where(runs["closed"], np.inf)
    runs["left"] = runs["gap"].fillna(np.inf)
    count = len(library)
    figure, (times, left) = subplots(4.4, 1, 2, sharey=True)
    for axes, column, limits in ((times, "closing", TIMES), (left, "left", GAPS)):
        _profiles(axes, _by_way(runs, column), limits, count)
    times.set(xlabel="processor time [s]", title="closed by its own bound within a time")
    left.set(xlabel="gap to its own bound, of its value", title="not more left at the end")
    times.set(ylabel=f"share of all {count} instances [%]")
    dress(times, left)
    name_panels(times, left)
    return figure


def _by_way(runs: pd.DataFrame, column: str) -> dict[str, Floats]:
    """Return the sorted values of the best of ours, of ways that close most, and outside ones."""
    own = runs[~runs["solver"].isin(OUTSIDE)]
    by = {BEST: own.groupby("instance")[column].min()} | dict([*runs.groupby("solver")[column]])
    first = own.groupby("solver")["closed"].sum().nlargest(len(COLORS)).index
    return {name: np.sort(by[name].to_numpy()) for name in (BEST, *first, *OUTSIDE)}


def _profiles(axes: Axes, ways: dict[str, Floats], limits: tuple[float, float], count: int) -> None:
    """Draw a curve for every way, with its name where it ends and how many instances it fits."""
    low, high = limits
    ours = [name for name in ways if name not in OUTSIDE and name != BEST]
    colors = {BEST: inks.INK} | dict.fromkeys(OUTSIDE, inks.VERMILION)
    colors |= dict(zip(ours, COLORS, strict=False))
    ends = {}
    for name, values in ways.items():
        at = np.concatenate([[low], values[(values > low) & (values <= high)], [high]])
        share = 100 * np.searchsorted(values, at, side="right") / count
        look = {"color": colors[name], "ls": DASHES.get(name, "-")}
        axes.step(at, share, where="post", lw=1.2 if name in ours else 2.0, **look)
        ends[name] = share[-1]
    axes.set(xscale="log", xlim=limits, ylim=(0, 103))
    plain(axes.xaxis)
    for name, height in _apart(ends).items():
        words = f"{name.replace('_', ' ')}, {len(ways[name])}"
        color, across = colors[name], axes.get_yaxis_transform()
        line = {"transform": across, "clip_on": False, "color": color, "lw": 0.6}
        axes.plot([1.0, 1.04], [ends[name], height], **line)
        note(axes, words, (1.05, height), (0, -3), xycoords=across, color=color)


def _apart(ends: dict[str, float]) -> dict[str, float]:
    """Return heights of labels as close to the ends of their curves as room for each allows."""
    names = sorted(ends, key=lambda name: ends[name])
    steps = ROOM * np.arange(len(names))
    heights = isotonic_regression(np.array([ends[name] for name in names]) - steps).x + steps
    return dict(zip(names, heights.tolist(), strict=True))


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
    rows.sort(key=lambda row: (row[0] in tuple(f"`{name}`" for name in OUTSIDE), row[0]))
    head = ["way", "instances", "path found", "best known", "closed by itself", "largest gap"]
    return markdown([*head, "median time", "longest"], rows)


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
        lines = [f"{json.dumps(n)}: {json.dumps(best[n])}" for n in MADE if n in best]
        KNOWN.write_text("{" + ",\n".join(lines) + "}\n", "utf-8")
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


COLUMNS = ("instance", "solver", "value", "bound", "proven", "end", "seconds")


def _keep(best: dict[str, dict], row: dict) -> None:
    """Keep what a run found, if it is better, or if more is proven."""
    if not row["nodes"]:
        return
    before = best.get(row["instance"])
    now = (*row["values"],)
    claims = row["claims"]
    if any(len(each.get("labels", {}).get("nodes", ())) > LABELS for each in claims):  # too many
        claims = [{k: v for k, v in c.items() if k not in ("labels", "value")} for c in claims]
    proof = judge_instance(instance(row["instance"]), {"nodes": row["nodes"]}, claims)
    found = {"values": [*now], "nodes": row["nodes"], "by": row["solver"], "claims": claims}
    found |= {"bounds": [*proof.bounds], "bound_by": row["solver"]}
    if before is None or _better(now, before["values"]):
        if before is not None and len(now) == 1 and before["bounds"][0] > found["bounds"][0]:
            found |= {key: before[key] for key in ("bounds", "bound_by", "claims")}
        best[row["instance"]] = found
    elif not _better(before["values"], now) and _better(before["bounds"], found["bounds"]):
        before |= {key: found[key] for key in ("bounds", "bound_by", "claims")}


def _better(first: list[float], then: list[float]) -> bool:
    """Return whether values are less, goal by goal, by more than rounding."""
    for a, b in zip(first, then, strict=False):
        if abs(a - b) > CLOSE * max(abs(a), abs(b)):
            return a < b
    return False


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
