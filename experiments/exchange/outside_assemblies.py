"""Claim: files of other programs lead to a proven plan, or one line says what they lack.

Method: every file of a list that the project did not make, 21 that ship with compas_cra and 30 of
public repositories, is put through the command line: ``seqopt import`` with a unit, a density
and supports where the file has none; ``seqopt optimize``, the loop of three robots with
`overlap_dp`, or the free schedule where there are fewer than four blocks; ``seqopt export`` in
every format. Steps of the plan, up to 12 spread over the build and the last, are put to the
certificate of stability with mortar on the true faces. Where a file has faces, they are found once
more from the shapes, and the areas compared. Of more than 120 blocks, nodes at most 6 joints from
the newest are candidates, of more than 300 those at most 3 away.

The claim holds if every file ends in a plan whose choice is proven optimal among its candidates and
that goes out in every format, or in one line; at least eight have such a plan; no verdict on a step
is left open; and no step falls of those with faces.

Inputs: the samples in the wheel of compas_cra, and with ``--files DIR`` clones of the repositories
named in `experiments.exchange.parts.outside_files`; rows of files that are not there stay as they
are stored. Command: ``python -m experiments.exchange.outside_assemblies [--quick] [--files DIR]``.
Writes ``experiments/results/outside_assemblies.csv`` and ``docs/figures/outside_assemblies.png``.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.exchange.parts.outside_chart import chart
from experiments.exchange.parts.outside_files import ELSEWHERE, SAMPLES, Outside, find
from experiments.harness.claim import Claim, Extra, Finding, Option, Options
from experiments.harness.plotting import RESULTS, save_all
from formulations.limit_analysis import compile_equilibrium
from seqopt.cli.main import main
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import EPOXY
from seqopt.errors import SceneWarning
from seqopt.network.build import build_network
from seqopt.scene.imports.formats import read_content, sniffed
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.exports.formats import EXPORTS, read_folder
from seqopt.sequence.steps import Step
from seqopt.stability.assessment import Verdict, bonded, verdict_of
from seqopt.stability.prover import Prover

STORE = RESULTS / "outside_assemblies.csv"
PLAN, LACKS = "plan", "lacks"
TRIED = 12  # steps of a plan that are put to the certificate, beside the last
NEAR = ((120, 0), (300, 6))  # bricks up to which candidates are all, or so many joints away
LEAST = 8  # plans
QUICK = ("bridge.json", "A.json", "armadillo.json")


def run(*words: str) -> tuple[int, str]:
    """Run a command; return its status and the last line that it says."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = main(words)
    return status, (said.getvalue().strip().splitlines() or [""])[-1]


def row_of(outside: Outside, path: Path, folder: Path) -> dict[str, object]:
    """Return what becomes of a file."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
    row: dict[str, object] = {"source": outside.source, "file": outside.path, "sha256": digest}
    scene_file, plan = folder / "scene.json", folder / "plan"
    status, said = run("import", str(path), *outside.words, "--out", str(scene_file))
    if status:
        said = said.replace(str(path), path.name)
        return row | {"outcome": LACKS if not scene_file.exists() else "half", "said": said}
    scene = _loaded(scene_file)
    row |= {
        "format": _format(path),
        "bricks": len(scene.bricks),
        "faces": sum(spring.face is not None for spring in (*scene.joints, *scene.grounds)),
        "found": found_again(outside, path, scene, folder),
    }
    status, said = run("optimize", str(scene_file), *_how(scene), "--out", str(plan))
    if status:
        return row | {"outcome": "no plan", "said": said}
    summary = json.loads((plan / "summary.json").read_text(encoding="utf-8"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        again, steps = read_folder(plan)
    exported = [
        run("export", str(plan), "--format", form, "--out", str(folder / form))[0]
        for form in EXPORTS
    ]
    return row | {
        "outcome": PLAN if not any(exported) else "not exported",
        "said": summary["status"],
        "steps": len(steps),
        **verdicts(again, steps),
    }


def _loaded(path: Path) -> Scene:
    """Return a scene; what seems odd in it has been said when it was imported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        return load_scene(path)


def _format(path: Path) -> str:
    if path.suffix != ".json":
        return path.suffix[1:]
    return sniffed(json.loads(path.read_text(encoding="utf-8")), path.name)


def _how(scene: Scene) -> tuple[str, ...]:
    if len(scene.bricks) < 4:
        return ("--schedule", "free")
    near = next((joints for most, joints in NEAR if len(scene.bricks) <= most), 3)
    few = ("--candidates", f"near:{near}") if near else ()
    return ("--formulation", "overlap_dp", *few)


def found_again(outside: Outside, path: Path, scene: Scene, folder: Path) -> float:
    """Return the area of faces that are found from shapes over that of the file; NaN if none."""
    if not read_content(path).faces:
        return np.nan
    other = folder / "found.json"
    status, _ = run("import", str(path), *outside.words, "--detect", "--out", str(other))
    if status:
        return 0.0
    stiff = [
        sum(spring.translational_stiffness[0] for spring in (*held.joints, *held.grounds))
        for held in (_loaded(other), scene)
    ]
    return stiff[0] / stiff[1]


def verdicts(scene: Scene, steps: Sequence[Step]) -> dict[str, int]:
    """Return how many steps of a plan stand, fall and stay open; none where a face is missing."""
    network = build_network(scene)
    if any(spring.face is None for spring in (*scene.joints, *scene.grounds)):
        return dict.fromkeys(("stands", "falls", "open"), 0)
    places = np.unique(np.linspace(0, len(steps) - 1, TRIED + 1).round().astype(int))
    count: Counter[Verdict] = Counter()
    for place in places.tolist():
        assembly = step_assembly(network, steps[place].bricks, steps[place].grips)
        count[verdict_of(Prover(assembly, compile_equilibrium)(bonded(assembly, EPOXY)))] += 1
    kinds = (Verdict.STANDS, Verdict.FALLS, Verdict.UNDECIDED)
    return dict(zip(("stands", "falls", "open"), (count[kind] for kind in kinds), strict=True))


def holds(table: pd.DataFrame, least: int = LEAST) -> bool:
    """Return whether every file ends in a proven plan or in one line, and enough in a plan."""
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


def store(table: pd.DataFrame) -> None:
    """Store rows of files that were read beside those of the others, in the order of the list."""
    if STORE.exists():
        before = pd.read_csv(STORE)
        new = set(zip(table["source"], table["file"], strict=True))
        kept = [pair not in new for pair in zip(before["source"], before["file"], strict=True)]
        table = pd.concat([table, before[kept]], ignore_index=True)
    listed = [(one.source, one.path) for one in (*SAMPLES, *ELSEWHERE)]
    places = [listed.index(pair) for pair in zip(table["source"], table["file"], strict=True)]
    table = table.iloc[np.argsort(places)]
    table.to_csv(STORE, index=False, float_format="%.6g", lineterminator="\n")


def experiment(options: Options) -> Finding:
    """Put files through the command line; store what becomes of each."""
    listed = [one for one in (*SAMPLES, *ELSEWHERE) if not options.quick or one.path in QUICK]
    rows = []
    for outside in listed:
        path = find(outside, options.files)
        if path is None:
            continue
        with tempfile.TemporaryDirectory() as folder:
            rows.append(row_of(outside, path, Path(folder)))
        print(f"{outside.name:60} {rows[-1]['outcome']}: {rows[-1]['said']}", flush=True)
        if not options.quick:
            store(pd.DataFrame(rows))  # file by file: a run that ends early keeps what it found
    if not options.quick:
        save_all(PICTURES)
    table = pd.DataFrame(rows) if options.quick else pd.read_csv(STORE)
    plans = int((table["outcome"] == PLAN).sum())
    return Finding(holds(table, 1 if options.quick else LEAST), f": {plans} of {len(table)} plans")


PICTURES: dict[str, Callable[[], Figure]] = {
    "outside_assemblies.png": chart,
}
CLAIM = Claim(
    experiment,
    quick="three samples, nothing written",
    options=(Option("--files", "folder of clones of the repositories named", ""),),
    needs=(Extra("compas_cra", "pip install 'seqopt[witness]'"),),
    pictures=PICTURES,
)

if __name__ == "__main__":
    CLAIM.main()
