"""Claim: no method proves its plan much sooner than rigid bricks with dynamic programming.

With rigid bricks no other formulation does by more than a tenth, with another engine by more than a
fifth (`auto`, which takes rigid bricks too), and nothing is closer to the optimum, on any scene and
criterion that was run. On the reference arch under equations 2 and 3 a stiff-bar frame takes at
least fifty times as long; it is less on smaller arches, and has to be 5 everywhere. There too,
leaving the proof out, as the search of Bruun et al. does, saves at most half of the time with rigid
bricks and at least two thirds with the frame. A schedule that is free takes at most twenty times as
long as the loop, and its plan, proven too, has a worst step at least a quarter below the loop's.

Method: scenes × engines × formulations × criteria, a row each (`experiments.harness.runs`), every
scene, engine and criterion in a process of its own on one core; what is repeated, after one run
that does not count. Runs that are stored for this version are not repeated. A run that reaches its
limit is charged the limit and a gap of one. The free schedule makes other sums least and has other
steps than the loop; beside it every way is judged by its worst step over the best published maxima
(`experiments.placement.parts.worst_ratios`). There is no randomness.

Inputs: `arch25`, and arches of its shape with 7 to 49 bricks. Command: ``python -m
experiments.placement.speed_accuracy [--quick] [--fresh]``. Writes ``experiments/results/runs.csv``,
``worst_ratios.csv``, ``speed_accuracy.csv``, and in ``docs/figures`` ``speed_accuracy.png``,
``worst_step.png`` and ``profiles.png``.
"""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Iterable
from importlib.metadata import version
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Finding, Option, Options, Times, on_this_run, told
from experiments.harness.results import RESULTS, apart, drawn
from experiments.harness.runs import NO_PROOF, REFERENCE, contenders
from experiments.placement.parts.speed_charts import (
    headline,
    profile_charts,
    shifted_mean,
    worst_step_chart,
)
from experiments.placement.parts.worst_ratios import WAYS
from seqopt.study.published import CLOSEST, EQUATIONS, WEIGHTED, WORST_RATIO

STORE = RESULTS / "runs.csv"
RATIOS = RESULTS / "worst_ratios.csv"
QUICK_WAYS = ("loop, worst ratio", "free, 3 robots")
LIMIT = 100.0  # seconds per process; what fails is charged as much
SHIFT = 0.01  # s, of geometric means
COMPARED = tuple(c.name for c in (EQUATIONS, CLOSEST, WEIGHTED, WORST_RATIO))
KEY = ["scene", "engine", "criterion", "version"]
Spec = tuple[str, str, str, int]  # scene, engine, criterion, repeats


def specs(*, quick: bool) -> list[Spec]:
    """Return what is run."""
    if quick:
        return [("chain7", engine, "weighted-published", 1) for engine in (REFERENCE, "frame 1e7")]
    small, large = ("chain7", "chain13", "chain19", "arch25"), ("chain37", "chain49")
    frames = ("frame 1e7", "frame 1e3")
    out = [(scene, REFERENCE, c, 5) for c, scene in product(COMPARED, small)]
    out += [(scene, REFERENCE, c, 2) for c, scene in product(COMPARED, large)]
    out += [(scene, e, c, 2) for c, e, scene in product(COMPARED, frames, small[:2])]
    late = (("chain19", frames[0]), ("chain37", frames[0]), *(("arch25", e) for e in frames))
    out += [(scene, e, "equations-2-3", 1) for scene, e in late]
    out += [(scene, "auto", "equations-2-3", 5) for scene in small]
    return out + [(scene, "discrete", "equations-2-3", 1) for scene in ("chain7", "arch25")]


def machine() -> str:
    """Return what the times were measured on."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    model = next((line.split(": ")[1] for line in lines if line.startswith("model name")), "")
    return f"{model or platform.processor()}, Python {platform.python_version()}"


def measure(spec: Spec, limit: float = LIMIT) -> list[dict[str, object]]:
    """Return the rows of one process, or rows that are charged its limit."""
    scene, engine, criterion, repeats = spec
    try:
        rows = apart("experiments.harness.runs", *spec, limit=limit)
    except subprocess.SubprocessError as error:
        status = "time limit" if isinstance(error, subprocess.TimeoutExpired) else "failed"
        charged = {"status": status, "total": limit, "gap": 1.0}
        base = {"scene": scene, "engine": engine, "criterion": criterion}
        rows = [
            base | charged | {"formulation": name, "aim": aim.value}
            for name, aim in contenders().items()
        ]
    packages = {name: version(name) for name in ("numpy", "cvxpy", "clarabel", "highspy")}
    about = {"version": version("seqopt"), "machine": machine(), "repeats": repeats} | packages
    return [row | about for row in rows]


def ratios_of(ways: Iterable[str]) -> pd.DataFrame:
    """Return a row for every way to a plan of the reference arch, loop and free schedule."""
    module = "experiments.placement.parts.worst_ratios"
    rows = [apart(module, way, limit=LIMIT) for way in ways]
    return pd.DataFrame(rows).assign(version=version("seqopt"))


def free_pays(ratios: pd.DataFrame) -> dict[str, bool]:
    """Return what is claimed of the free schedule, and whether the rows bear it out."""
    table = ratios.set_index("way")
    free, loop = table.loc["free, 3 robots"], table.loc["loop, worst ratio"]
    return {
        "the free schedule takes at most twenty times as long as the loop": bool(
            free["seconds"] <= 20 * loop["seconds"]
        ),
        "its worst step lies at least a quarter below the loop's": bool(
            free["worst_ratio"] <= 0.75 * loop["worst_ratio"]
        ),
    }


def collect(wanted: list[Spec], stored: pd.DataFrame, store: Path | None = None) -> pd.DataFrame:
    """Return the stored rows with those of the runs that are missing, stored as they come."""
    have = {tuple(key) for key in stored[KEY].to_numpy()} if len(stored) else set()
    for spec in wanted:
        if (*spec[:3], version("seqopt")) in have:
            continue
        rows = pd.DataFrame(measure(spec))
        print(f"{spec[0]:8} {spec[1]:13} {spec[2]:16} {rows['status'].iloc[0]}", flush=True)
        stored = pd.concat([stored, rows], ignore_index=True) if len(stored) else rows
        if store is not None:
            stored.to_csv(store, index=False, float_format="%.6g", lineterminator="\n")
    return stored


def summarize(runs: pd.DataFrame) -> pd.DataFrame:
    """Return a row per formulation with exactly rigid bricks: means over scenes and criteria."""
    own = runs[runs["engine"] == REFERENCE]
    rows = []
    for name, table in own.groupby("formulation", sort=False):
        choose = table[["compile", "solve"]].sum(axis=1)
        rows.append(
            {
                "formulation": name,
                "runs": len(table),
                "optimal": int((table["status"] == "optimal").sum()),
                "total_s": shifted_mean(table["total"].to_numpy(), SHIFT),
                "choose_s": shifted_mean(choose.to_numpy(), SHIFT),
                "models": shifted_mean(table["models"].to_numpy(), 1.0),
                "mean_gap_pct": 100 * table["gap"].mean(),
                "largest_gap_pct": 100 * table["gap"].max(),
            }
        )
    return pd.DataFrame(rows)


def holds(runs: pd.DataFrame) -> dict[str, bool]:
    """Return the parts of the claim and whether the rows bear them out."""
    sums = runs[runs["aim"] == "sum"]
    keys = ["scene", "criterion"]
    proven = sums[(sums["engine"] == REFERENCE) & (sums["formulation"] != NO_PROOF)]
    soonest = proven.groupby(keys)["total"].min()
    anywhere = sums[sums["formulation"] != NO_PROOF].groupby(keys)["total"].min()
    gap = _of(sums, REFERENCE, "overlap_dp", "gap")
    corner, unproven = (_of(sums, REFERENCE, name) for name in ("overlap_dp", NO_PROOF))
    frame, frame_unproven = (_of(sums, "frame 1e7", name) for name in ("overlap_dp", NO_PROOF))
    parts = {
        "dynamic programming has no gap": (gap <= 1e-9).all(),
        "nothing proves its plan sooner by more than a tenth": (corner <= 1.1 * soonest).all(),
        "no other engine does by more than a fifth": (corner <= 1.2 * anywhere).all(),
        "the frame takes at least five times as long everywhere": (
            (frame / corner).dropna() >= 5
        ).all(),
    }
    if (sums["scene"] == "arch25").any():
        parts |= {
            "the frame takes at least fifty times as long": _arch25(frame / corner) >= 50,
            "rigid bricks spend half of their time or less on the proof": (
                _arch25(unproven / corner) >= 1 / 2
            ),
            "the frame spends two thirds of its time or more on the proof": (
                _arch25(frame_unproven / frame) <= 1 / 3
            ),
        }
    return {text: bool(true) for text, true in parts.items()}


def _of(sums: pd.DataFrame, engine: str, name: str, column: str = "total") -> pd.Series:
    """Return a column of an engine with a formulation, by scene and criterion."""
    own = sums[(sums["engine"] == engine) & (sums["formulation"] == name)]
    return own.set_index(["scene", "criterion"])[column].sort_index()


def _arch25(ratios: pd.Series) -> float:
    """Return the ratio on the reference arch under equations 2 and 3."""
    return float(ratios["arch25", "equations-2-3"])


def experiment(options: Options) -> Finding:
    load = STORE.exists() and not options.quick and not options.fresh
    wanted = specs(quick=options.quick)
    RESULTS.mkdir(exist_ok=True)
    stored = pd.read_csv(STORE) if load else pd.DataFrame()
    runs = collect(wanted, stored, None if options.quick else STORE)
    table = summarize(runs)
    print(table.to_string(index=False, float_format="%.4g"))
    ratios = pd.read_csv(RATIOS) if load and RATIOS.exists() else pd.DataFrame()
    if not len(ratios) or set(ratios["version"]) != {version("seqopt")}:
        ratios = ratios_of(QUICK_WAYS if options.quick else WAYS)
    print(ratios.to_string(index=False, float_format="%.4g"))
    parts = holds(runs) | free_pays(ratios)
    return on_this_run(holds=told(parts), speed_accuracy=table, worst_ratios=ratios)


CLAIM = Claim(
    experiment,
    digits={"speed_accuracy": 4, "worst_ratios": 6},
    quick="one small arch, nothing written",
    times=Times.JUDGED,
    pictures={
        "speed_accuracy.png": drawn(headline, "runs"),
        "worst_step.png": drawn(worst_step_chart, "runs", "worst_ratios"),
        "profiles.png": drawn(profile_charts, "runs"),
    },
    options=(Option("--fresh", "repeat runs that are stored"),),
)

if __name__ == "__main__":
    np.seterr(all="raise", under="ignore")
    CLAIM.main()
