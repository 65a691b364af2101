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
(`experiments.placement.parts.worst_ratios`). README's chart is what `seqopt compare --speed` draws,
for the reference arch, a barrel vault and a wall, a minute for each engine and formulation, in
processor time (`experiments.placement.parts.speed_points`). There is no randomness.

Inputs: `arch25`, and arches of its shape with 7 to 49 bricks. Command: ``python -m
experiments speed_accuracy [--quick] [--fresh]``.
"""

import platform
import subprocess
from importlib.metadata import version
from itertools import product
from pathlib import Path

import pandas as pd

from experiments.harness.claim import Claim, Finding, Option, Options
from experiments.harness.results import RESULTS, apart, drawn
from experiments.harness.runs import NO_PROOF, REFERENCE, contenders
from experiments.placement.parts import speed_charts as charts
from experiments.placement.parts.speed_points import REFERENCE as REFERENCE_ENGINE
from experiments.placement.parts.speed_points import SCENES, speed_tables
from experiments.placement.parts.worst_ratios import WAYS
from seqopt.report._speed._table import SpeedTable
from seqopt.study.published import CLOSEST, EQUATIONS, WEIGHTED, WORST_RATIO

STORE = RESULTS / "runs.csv"
RATIOS = RESULTS / "worst_ratios.csv"
POINTS = RESULTS / "speed_points.csv"
QUICK_SCENES, POINT_LIMIT = ("wall:columns=3,courses=2",), 60.0
QUICK_WAYS = ("loop, worst ratio", "free, 3 robots")
LIMIT = 100.0  # seconds per process; what fails is charged as much
SHIFT = 0.01  # s, of geometric means
COMPARED = tuple(c.name for c in (EQUATIONS, CLOSEST, WEIGHTED, WORST_RATIO))
KEY = ["scene", "engine", "criterion", "version"]
Spec = tuple[str, str, str, int]  # scene, engine, criterion, repeats


def specs(*, quick: bool) -> list[Spec]:
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
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    model = next((line.split(": ")[1] for line in lines if line.startswith("model name")), "")
    return f"{model or platform.processor()}, Python {platform.python_version()}"


def measure(spec: Spec, limit: float = LIMIT) -> list[dict[str, object]]:
    scene, engine, criterion, repeats = spec
    try:
        rows = apart("experiments.harness.runs", *spec, limit=limit)
    except subprocess.SubprocessError as error:
        status = "time limit" if isinstance(error, subprocess.TimeoutExpired) else "failed"
        base = {"scene": scene, "engine": engine, "criterion": criterion}
        base |= {"status": status, "total": limit, "gap": 1.0}
        rows = [base | {"formulation": n, "aim": aim.value} for n, aim in contenders().items()]
    packages = {name: version(name) for name in ("numpy", "cvxpy", "clarabel", "highspy")}
    about = {"version": version("seqopt"), "machine": machine(), "repeats": repeats} | packages
    return [row | about for row in rows]


def free_pays(ratios: pd.DataFrame) -> dict[str, bool]:
    table = ratios.set_index("way")
    free, loop = table.loc["free, 3 robots"], table.loc["loop, worst ratio"]
    soon = bool(free["seconds"] <= 20 * loop["seconds"])
    better = bool(free["worst_ratio"] <= 0.75 * loop["worst_ratio"])
    return {
        "the free schedule takes at most twenty times as long as the loop": soon,
        "its worst step lies at least a quarter below the loop's": better,
    }


def collect(wanted: list[Spec], stored: pd.DataFrame, store: Path | None = None) -> pd.DataFrame:
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
        optimal = int((table["status"] == "optimal").sum())
        choose = table[["compile", "solve"]].sum(axis=1)
        row = {"formulation": name, "runs": len(table), "optimal": optimal}
        row |= {"total_s": charts.shifted_mean(table["total"].to_numpy(), SHIFT)}
        row |= {"choose_s": charts.shifted_mean(choose.to_numpy(), SHIFT)}
        row |= {"models": charts.shifted_mean(table["models"].to_numpy(), 1.0)}
        row |= {"mean_gap_pct": 100 * table["gap"].mean()}
        rows.append(row | {"largest_gap_pct": 100 * table["gap"].max()})
    return pd.DataFrame(rows)


def holds(runs: pd.DataFrame) -> dict[str, bool]:
    keys = ["scene", "criterion"]
    sums = runs[runs["aim"] == "sum"].set_index(["engine", "formulation", *keys]).sort_index()
    proven = sums[sums.index.get_level_values("formulation") != NO_PROOF]["total"]
    soonest = proven[REFERENCE].groupby(level=keys).min()
    anywhere = proven.groupby(level=keys).min()
    ways = product((REFERENCE, "frame 1e7"), ("overlap_dp", NO_PROOF))
    corner, unproven, frame, frame_unproven = (sums.loc[way, "total"] for way in ways)
    parts = {
        "dynamic programming has no gap": (
            sums.loc[(REFERENCE, "overlap_dp"), "gap"] <= 1e-9
        ).all(),
        "nothing proves its plan sooner by more than a tenth": (corner <= 1.1 * soonest).all(),
        "no other engine does by more than a fifth": (corner <= 1.2 * anywhere).all(),
        "the frame takes at least five times as long everywhere": (
            (frame / corner).dropna() >= 5
        ).all(),
    }
    if "arch25" in soonest.index:
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


def _arch25(ratios: pd.Series) -> float:
    """Return the ratio on the reference arch under equations 2 and 3."""
    return float(ratios["arch25", "equations-2-3"])


def experiment(options: Options) -> Finding:
    load = STORE.exists() and not options.quick and not options.fresh
    stored = pd.read_csv(STORE) if load else pd.DataFrame()
    runs = collect(specs(quick=options.quick), stored, STORE if options.store else None)
    table = summarize(runs)
    print(table.to_string(index=False, float_format="%.4g"))
    points = _points(quick=options.quick, load=load)
    ratios = pd.read_csv(RATIOS) if load and RATIOS.exists() else pd.DataFrame()
    if not len(ratios) or set(ratios["version"]) != {version("seqopt")}:
        module = "experiments.placement.parts.worst_ratios"
        ways = QUICK_WAYS if options.quick else WAYS
        ratios = pd.DataFrame(apart(module, way, limit=LIMIT) for way in ways)
        ratios = ratios.assign(version=version("seqopt"))
    print(ratios.to_string(index=False, float_format="%.4g"))
    good = holds(runs) | free_pays(ratios) | corner_reached(points)
    found = {"speed_accuracy": table, "worst_ratios": ratios, "speed_points": points}
    return Finding(good, tables=found)


def _points(*, quick: bool, load: bool) -> pd.DataFrame:
    """Return the points of README's chart, as they are stored for this version or measured."""
    stored = pd.read_csv(POINTS) if load and POINTS.exists() else pd.DataFrame()
    if len(stored) and set(stored["version"]) == {version("seqopt")}:
        return stored
    module = "experiments.placement.parts.speed_points"
    scenes, seconds = (QUICK_SCENES, 5.0) if quick else (SCENES, POINT_LIMIT)
    rows = [row for scene in scenes for row in apart(module, scene, seconds)]
    return pd.DataFrame(rows).assign(version=version("seqopt"), machine=machine())


def corner_reached(points: pd.DataFrame) -> dict[str, bool]:
    """Return whether the way to take is as good as any, and the stiff-bar frame out of the race."""
    tables = speed_tables(points)
    took = [table.take for table in tables]
    frame = [table.table[table.table["engine"] == "frame"] for table in tables]
    return {
        "what README says to take proves its plan, and loses nothing": all(
            each["exact"] and each["gap"] == each["error"] == 0 for each in took
        ),
        "another engine with a proof is sooner in none of its scenes by more than half": all(
            _soonest(table) >= _soonest(table, REFERENCE_ENGINE) / 2 for table in tables
        ),
        "the frame takes at least five times as long wherever it answers": all(
            own["seconds"].dropna().ge(5 * each["seconds"]).all()
            for own, each in zip(frame, took, strict=True)
        )
        and any(own["gap"].notna().any() for own in frame),
    }


def _soonest(table: SpeedTable, engine: str = "") -> float:
    """Return the least time of what proves its plan, by one engine or by any."""
    own = table.table[table.table["exact"] & (table.table["gap"] == 0)]
    return float(own["seconds"][own["engine"].str.startswith(engine)].min())


CLAIM = Claim(
    experiment,
    digits={"speed_accuracy": 4, "worst_ratios": 6, "speed_points": 4},
    quick="one small arch",
    timed=True,
    pictures={
        "speed_accuracy.png": drawn(charts.headline, "speed_points"),
        "worst_step.png": drawn(charts.worst_step_chart, "runs", "worst_ratios"),
        "profiles.png": drawn(charts.profile_charts, "runs"),
    },
    options=(Option("--fresh", "repeat runs that are stored"),),
)
