"""Claim: files of other programs lead to a proven plan, or one line says what they lack.

Method: every file of a list that the project did not make, 21 that ship with compas_cra and 20 of
public repositories, is put through the command line: ``seqopt import`` with a unit, a density
and supports where the file has none; ``seqopt optimize``, the loop of three robots with
`overlap_dp`, or the free schedule where there are fewer than four blocks; ``seqopt export`` in
every format. Steps of the plan, up to 12 spread over the build and the last, are put to the
certificate of stability with mortar on the true faces. Of more than 120 blocks, nodes at most 6
joints from the newest are candidates, of more than 300 those at most 3 away. Of five files every
plan lies outside the linear range: the limit is lifted for them, and their plans say so.

The claim holds if every file ends in a plan whose choice is proven optimal among its candidates and
that goes out in every format, or in one line; at least eight have such a plan; no verdict on a step
is left open; and no step falls of those with faces.

Inputs: the samples in the wheel of compas_cra, and with ``--files DIR`` clones of the repositories
named in `COMMITS`; rows of files that are not there stay as they are stored. Command: ``python -m
experiments outside_assemblies [--quick] [--files DIR]``.
"""

import contextlib
import hashlib
import io
import json
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.charts import subplots
from experiments.harness.claim import Claim, Extra, Finding, Option, Options
from experiments.harness.results import stored
from experiments.harness.scenes import read_folder
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt import EPOXY, Scene, Step, build_network, load_scene
from seqopt._cli.main import main
from seqopt.contact.assembly import step_assembly
from seqopt.errors import SceneWarning
from seqopt.exchange._content import Given
from seqopt.exchange._formats import sniffed, writable
from seqopt.exchange.imports import import_scene
from seqopt.report._style import styled
from seqopt.report.draw import View, draw_bricks
from seqopt.stability.assessment import _verdict_of, bonded
from seqopt.stability.limit_analysis import Prover
from seqopt.stability.verdict import Verdict

Read = TypeVar("Read")
WHEEL = "compas_cra 0.8.0"
COMMITS = {"compas_assembly": "53f8969d", "compas_dem": "559107e"}


@dataclass(frozen=True)
class Outside:
    """A file of others, and the words that ``seqopt import`` needs beside it."""

    source: str
    path: str
    words: tuple[str, ...] = ("--unit", "m", "--density", "2400")
    asked: tuple[str, ...] = ()  # of ``seqopt optimize``


LIFTED = ("--limit", "linear_range=any")  # blocks move farther than it, whatever is chosen
OVERLAP = "--accept-overlaps"  # blocks that were curved run into each other by up to 92 mm


def _sample(name: str, supports: str = "", *words: str) -> Outside:
    given = ("--supports", supports) if supports else ()
    plain = ("--unit", "m", "--density", "2400")
    return Outside(WHEEL, f"{name}.json", (*plain, *given, *words))


SAMPLES = (
    *(_sample(name, "0,1") for name in ("A", "H", "bridge")),
    *(_sample(f"type-{kind}", "0,1") for kind in "abcd"),
    *(_sample(f"shelf{part}", "0") for part in ("", "-s1", "-s2", "-s3", "-stable")),
    *(_sample(kind, "0") for kind in ("concave-short", "concave-long", "curve-3-blocks")),
    *(_sample(kind, "0") for kind in ("cube-curve-short", "cube-curve-tall", "cubes")),
    _sample("snake", "0", "--gap", "0.01"),
    _sample("armadillo", "", OVERLAP),  # it marks no supports, and nothing in it stands level
    replace(_sample("armadillo_cra", "", OVERLAP), asked=LIFTED),  # it marks them
)


def _assembly(path: str, *words: str) -> Outside:
    return Outside("compas_assembly", f"{path}.json", ("--unit", "m", "--density", "2400", *words))


def _example(name: str, asked: tuple[str, ...] = ()) -> Outside:
    return replace(_assembly(f"docs/examples/{name}_assembly"), asked=asked)


LARGE = ("--unit", "m")  # with a density of its own
BARREL = "scripts/DEM_Analysis_References/Barrel_Vault"
ELSEWHERE = (
    *(_example("arch", LIFTED), _example("stack"), _example("wall")),
    _example("crossvault", LIFTED),
    _assembly("docs/examples/dome_assembly", "--gap", "0.01", OVERLAP),
    _assembly("docs/examples/two-blocks_assembly"),
    *(_assembly(f"data/__temp/{name}") for name in ("wall_courses", "wall_interfaces")),
    *(_assembly(f"data/__temp/{name}", OVERLAP) for name in ("dome", "curvedwall")),
    *(_assembly(f"data/__temp/{name}") for name in ("stack", "ursula")),
    _assembly("data/__temp/amiens_internet"),
    Outside("compas_dem", "data/dem_crossvault.json"),
    *(
        Outside("compas_dem", f"{BARREL}/DEM_{name}.json", LARGE, LIFTED)
        for name in ("model", "problem")
    ),
    *(Outside("compas_dem", f"data/{name}.obj") for name in ("wall", "dome", "ursula")),
    Outside("compas_dem", "data/pavillionvault/blocks.json"),
)


def find(outside: Outside, folder: str) -> Path | None:
    """Return where a file is, if it is: in the wheel, or below a folder of repositories."""
    home = Path(folder, outside.source)
    if outside.source == WHEEL:
        home = Path(import_module("compas_cra").SAMPLE)
    path = home / outside.path
    return path if path.is_file() and (folder or outside.source == WHEEL) else None


SHOWN = (("bridge", "0,1", 14), ("shelf", "0", 10), ("snake", "0", 3), ("armadillo_cra", "", 270))


@styled
def chart() -> Figure:
    folder = Path(import_module("compas_cra").SAMPLE)
    figure, panels = subplots(4.6, 2, 2)
    for panel, (name, supports, bricks) in zip(panels.ravel(), SHOWN, strict=True):
        keys = supports.split(",") if supports else None
        gap = 0.01 if name == "snake" else None
        given = Given(unit="m", density=2400.0, supports=keys, gap=gap, accept_overlaps=True)
        scene = silently(partial(import_scene, given=given), folder / f"{name}.json")
        draw_bricks(panel, build_network(scene), bricks, View(azimuth=35, elevation=25))
        panel.set_title(f"{name.removesuffix('_cra')}: {bricks} of {len(scene.bricks)} blocks")
    return figure


PLAN, LACKS = "plan", "lacks"
TRIED = 12  # steps of a plan that are put to the certificate, beside the last
NEAR = ((120, 0), (300, 6))  # bricks up to which candidates are all, or so many joints away
LEAST = 8  # plans
QUICK = ("bridge.json", "A.json")


def run(*words: str) -> tuple[int, str]:
    """Run a command; return its status and the last line that it says."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = main(words)
    return status, (said.getvalue().strip().splitlines() or [""])[-1]


def row_of(outside: Outside, path: Path, folder: Path) -> dict[str, object]:
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
    row: dict[str, object] = {"source": outside.source, "file": outside.path, "sha256": digest}
    scene_file, plan = folder / "scene.json", folder / "plan"
    status, said = run("import", str(path), *outside.words, "--out", str(scene_file))
    if status:
        said = said.replace(str(path), path.name)
        return row | {"outcome": LACKS if not scene_file.exists() else "half", "said": said}
    scene = silently(load_scene, scene_file)
    kind, springs = path.suffix[1:], (*scene.joints, *scene.grounds)
    kind = sniffed(json.loads(path.read_text("utf-8")), path.name) if kind == "json" else kind
    row |= {"format": kind, "bricks": len(scene.bricks)}
    row |= {"faces": sum(spring.face is not None for spring in springs)}
    how = (*_how(scene), *outside.asked, "--out", str(plan))
    status, said = run("optimize", str(scene_file), *how)
    if status:
        return row | {"outcome": "no plan", "said": said}
    summary = json.loads((plan / "summary.json").read_text(encoding="utf-8"))
    again, steps = silently(read_folder, plan)
    outs = {
        form: ("--format", form, "--out", str(folder / form))
        for form in writable()
        if form != "compas_assembly"
    }
    exported = [run("export", str(plan), *words)[0] for words in outs.values()]
    row |= {"outcome": PLAN if not any(exported) else "not exported", "said": summary["status"]}
    return row | {"steps": len(steps), **verdicts(again, steps)}


def silently(read: Callable[[Path], Read], path: Path) -> Read:
    """Return what is read; what seems odd in a scene has been said when it was imported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        return read(path)


def _how(scene: Scene) -> tuple[str, ...]:
    if len(scene.bricks) < 4:
        return ("--schedule", "free")
    near = next((joints for most, joints in NEAR if len(scene.bricks) <= most), 3)
    few = ("--candidates", f"near:{near}") if near else ()
    return ("--formulation", "overlap_dp", *few)


def verdicts(scene: Scene, steps: Sequence[Step]) -> dict[str, int]:
    """Return how many steps of a plan stand, fall and stay open."""
    network = build_network(scene)
    places = np.unique(np.linspace(0, len(steps) - 1, TRIED + 1).round().astype(int))
    count: Counter[Verdict] = Counter()
    for place in places.tolist():
        assembly = step_assembly(network, steps[place].bricks, steps[place].grips)
        count[_verdict_of(Prover(assembly, compile_equilibrium)(bonded(assembly, EPOXY)))] += 1
    return dict(zip(("stands", "falls", "open"), (count[kind] for kind in Verdict), strict=True))


def holds(table: pd.DataFrame, least: int = LEAST) -> bool:
    plans = table[table["outcome"] == PLAN]
    lines = table["said"].fillna("").str.strip()
    return bool(
        table["outcome"].isin([PLAN, LACKS]).all()
        and (lines != "").all()
        and not lines.str.contains("\n").any()
        and plans["said"].str.startswith("optimal").all()
        and len(plans) >= least
        and not plans[["falls", "open"]].to_numpy().any()
    )


def beside_stored(table: pd.DataFrame) -> pd.DataFrame:
    """Return rows of files that were read beside stored ones of others, in the list's order."""
    both = pd.concat([table, stored("outside_assemblies")], ignore_index=True)
    table = both.drop_duplicates(["source", "file"])  # the new row comes first
    listed = [(one.source, one.path) for one in (*SAMPLES, *ELSEWHERE)]
    places = [listed.index(pair) for pair in zip(table["source"], table["file"], strict=True)]
    return table.iloc[np.argsort(places)]


def experiment(options: Options) -> Finding:
    listed = [one for one in (*SAMPLES, *ELSEWHERE) if not options.quick or one.path in QUICK]
    rows = []
    for outside in listed:
        path = find(outside, options.files)
        if path is None:
            continue
        with tempfile.TemporaryDirectory() as folder:
            rows.append(row_of(outside, path, Path(folder)))
        print(f"{outside.path:60} {rows[-1]['outcome']}: {rows[-1]['said']}", flush=True)
    table = pd.DataFrame(rows) if options.quick else beside_stored(pd.DataFrame(rows))
    plans = int((table["outcome"] == PLAN).sum())
    good, note = holds(table, 1 if options.quick else LEAST), f": {plans} of {len(table)} plans"
    return Finding(good, note, {"outside_assemblies": table})


CLAIM = Claim(
    experiment,
    digits=6,
    quick="two samples",
    options=(Option("--files", "folder of clones of the repositories named", ""),),
    needs=(Extra("compas_cra", "pip install 'seqopt[witness]'"),),
    pictures={"outside_assemblies.png": chart},
)
