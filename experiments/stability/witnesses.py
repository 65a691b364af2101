"""Claim: our verdicts agree with those of two other programs, and on a large assembly come sooner.

The verdicts wherever a program decides, but for three differences that are explained below: they
are known from earlier runs, and the claim fails if one is missing or a fourth is found. The time is
that of the first program on its largest assembly, 399 blocks that touch in 1014 faces, and ours at
most a fifth of it. That one case carries it: with a handful of blocks the other program is sooner.

Method: the samples that ship with compas_cra, some again with less friction or without a support;
leaning stacks, blocks on inclines and semicircular arches on both sides of their limits; one arch
at seven densities. Each is judged by us (the plain verdict, proven from forces or a motion) and by

- RBE of compas_cra: forces with the least tension, judged by the largest tension over the mean
  weight of a free block: up to 3e-5 it stands, from 1e-3 it falls; between the two, its own
  constraints without tension are put to a linear program (column ``no_tension``);
- LMGC90: one simulated second from rest, for convex blocks only, in a process of its own.

A witness that is undecided is counted and agrees with nobody. If we are undecided where a witness
is not, the claim fails. Times are medians of runs in turn in one process without imports; ours
includes making the assembly and the program, RBE's only its solve.

Differences, and who is right:

- A block on a slope of 30° that points into a corner of RBE's friction octagon stands for RBE with
  friction 0.555. It slides at 0.577 = tan 30°: RBE is wrong, by the octagon's 8 %.
- A and H of compas_cra are blocks that hang between two walls by friction alone. Forces that hold
  them up exist, which is all that we and RBE ask; but nothing builds them up: they fall in LMGC90.
  "Stands" means that forces exist, not that they will arise.

RBE's tension alone does not do: less is left in curve-3-blocks with friction 0.05, which lacks a
little bond, than in the shelves, which stand by RBE's own constraints.

Inputs: compas_cra, ``pip install "seqopt[witness]"``; LMGC90 (compas_lmgc90) in this or another
Python. Command: ``python -m experiments witnesses [--quick] [--lmgc90 PYTHON]``.
"""

import sys
import time
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Extra, Finding, Option, Options
from experiments.stability.parts import witness_cra
from experiments.stability.parts.blocks import ring, stack
from experiments.stability.parts.witness_cra import (
    SAMPLES,
    Scene,
    arch,
    force_only,
    incline,
    sample_scene,
    scene_of,
)
from experiments.stability.parts.witness_lmgc90 import moved_by, python_with_lmgc90
from seqopt.contact.mortar import Mortar
from seqopt.stability.assessment import _verdict_of, bonded
from seqopt.stability.limit_analysis import Prover, compile_equilibrium
from seqopt.stability.verdict import Verdict

SOONER = 5.0
LARGEST = "armadillo_cra"
OPEN = Verdict.UNDECIDED.value
TURNED = "incline, turned"
KNOWN = {
    (TURNED, "rbe"): "its octagon is wider than the cone",
    ("A", "lmgc90"): "wedged: forces exist but do not arise",
    ("H", "lmgc90"): "wedged: forces exist but do not arise",
}
ASIDE = {  # samples again, with less friction
    LARGEST: (0.2, 0.1),
    "bridge": (0.1, 0.05),
    **dict.fromkeys(("shelf", "shelf-s1", "shelf-s2", "shelf-s3", "A", "snake"), (0.4,)),
    "shelf-stable": (0.4, 0.2),
    "H": (0.0,),
    "curve-3-blocks": (0.1, 0.05),
}
AT_ONE = ("shelf-stable", "snake")  # samples again, not scaled to weigh 1
STACKS = ((0, 0), (0.25, 0.48), (0, 0.49), (0, 0.51), (0.16, 0.24, 0.49), (0.17, 0.26, 0.51))
INCLINES = (0.55, 0.57, 0.585, 0.65)
ARCHES = (0.09, 0.1, 0.105, 0.107, 0.108, 0.11, 0.13)
DENSITIES = (1e-3, 1e-2, 0.1, 1.0, 10.0, 1000.0, 2420.0)


def words(table: pd.DataFrame, witness: str) -> pd.Series:
    """Return a witness's verdicts; RBE's open ones as its constraints without tension have it."""
    if witness != "rbe":
        return table[witness].replace("", OPEN)
    return table["rbe"].where(table["rbe"] != OPEN, table["no_tension"])


def differing(table: pd.DataFrame, witness: str) -> set[tuple[str, str]]:
    """Return where a witness decides otherwise than we."""
    word = words(table, witness)
    return {(case, witness) for case in table.loc[(word != OPEN) & (word != table["ours"]), "case"]}


@dataclass(frozen=True)
class Trial:
    """One assembly to be judged; without a density, all free blocks weigh 1 together."""

    group: str
    name: str
    scene: Scene
    friction: float
    density: float | None = None


def sample_trials(names: list[str]) -> list[Trial]:
    out = []
    for name in names:
        scene, friction = sample_scene(name), SAMPLES[name].friction
        out.append(Trial("sample", name, scene, friction))
        if name in AT_ONE:
            out.append(Trial("sample", f"{name}, density 1", scene, friction, 1.0))
        for less in ASIDE.get(name, ()):
            out.append(Trial("sample", f"{name}, friction {less:g}", scene, less))
    return out


def without_a_support(name: str) -> Trial:
    """Return a sample of which one support is an ordinary block."""
    scene = sample_scene(name)
    freed = replace(scene, supports=scene.supports - {max(scene.supports)})
    return Trial("sample", f"{name}, a support freed", freed, SAMPLES[name].friction)


def built_trials() -> list[Trial]:
    out = []
    for offsets in STACKS:
        name = f"stack {', '.join(f'{x:g}' for x in offsets)}"
        out.append(Trial("stack", name, scene_of(stack([0.0, *offsets]), {0}), 0.7))
    out += [Trial("incline", f"incline, friction {f:g}", incline(), f) for f in INCLINES]
    out.append(Trial("incline", TURNED, incline(np.pi / 8), 0.555))
    return out + [Trial("arch", f"arch t/R {x:g}", arch(x), 0.8) for x in ARCHES]


def ours(trial: Trial) -> tuple[Verdict, float]:
    """Return our verdict and the bond that is lacking, over the heaviest weight per mean face."""
    assembly = trial.scene.assembly(trial.density or 1.0)
    stand = Prover(assembly, compile_equilibrium)(bonded(assembly, Mortar(friction=trial.friction)))
    return _verdict_of(stand), stand.value


def timed(trial: Trial) -> tuple[tuple[Verdict, float], float]:
    start = time.perf_counter()
    return ours(trial), time.perf_counter() - start


def row_of(trial: Trial, python: str | None) -> dict[str, object]:
    """Return what all say about a trial."""
    (verdict, lacking), seconds = timed(trial)
    word = force_only(trial.scene, trial.friction, trial.density)
    undecided = word.verdict is Verdict.UNDECIDED
    convex = trial.density is None and all(solid.convex for solid in trial.scene.solids)
    exact = witness_cra.without_tension(trial.scene, trial.friction).value if undecided else ""
    row = {"group": trial.group, "case": trial.name, "blocks": len(trial.scene.solids)}
    row |= {"contacts": len(trial.scene.touches), "friction": trial.friction}
    row |= {"density": trial.density or np.nan, "ours": verdict.value, "lacking_bond": lacking}
    row |= {"seconds": seconds, "rbe": word.verdict.value, "tension": word.tension}
    row |= {"rbe_seconds": word.seconds, "no_tension": exact}
    return row | {
        "lmgc90": moved_by(python, trial.scene, trial.friction) if python and convex else ""
    }


def race(trials: list[Trial], rounds: int) -> pd.DataFrame:
    """Return median times (s) of us and RBE, who take turns, and their ratio."""
    rows = []
    for trial in trials:
        asked = trial.scene, trial.friction
        runs = [(timed(trial)[1], force_only(*asked).seconds) for _ in range(rounds)]
        a, b = np.median(runs, axis=0)
        rows.append({"case": trial.name, "seconds": a, "rbe_seconds": b, "ratio": b / a})
    return pd.DataFrame(rows)


def faults(table: pd.DataFrame, witnesses: list[str], ratio: float | None) -> list[str]:
    """Return what speaks against the claim; without a ratio, nothing is said about times."""
    out = []
    for witness in witnesses:
        differs = differing(table, witness)
        word = words(table, witness)
        known = {(case, name) for case, name in KNOWN if name == witness}
        known &= {(case, witness) for case in table.loc[word != OPEN, "case"]}
        out += [f"{case}: {name} differs" for case, name in sorted(differs - known)]
        out += [f"{case}: {name} does not differ" for case, name in sorted(known - differs)]
        for verdict in (Verdict.STANDS.value, Verdict.FALLS.value):
            if not ((word == verdict) & (table["ours"] == verdict)).any():
                out.append(f"nothing that {verdict} is confirmed by {witness}")
    if len(set(table.loc[table["group"] == "density", "ours"])) > 1:
        out.append("our verdict depends on the density")
    if ratio is not None and ratio < SOONER:
        out.append(f"only {ratio:.2g} times sooner")
    return out


def report(table: pd.DataFrame, witnesses: list[str]) -> None:
    print(table.drop(columns="group").to_string(index=False, float_format="%.3g", na_rep=""))
    for witness in witnesses:
        agree, differs = (words(table, witness) == table["ours"]).sum(), differing(table, witness)
        asked = (table[witness] != "").sum()
        print(f"{witness}: asked {asked}, agrees {agree}, differs {len(differs)}")
        for pair in sorted(differs):
            print(f"  {pair[0]}: {KNOWN.get(pair, 'unexplained')}")


def trials(*, quick: bool) -> list[Trial]:
    samples, freed = [*SAMPLES], [without_a_support("bridge")]
    if quick:
        samples = ["bridge", "cubes", "A", "curve-3-blocks"]
        return [*sample_trials(samples), *freed, *built_trials()]
    freed += [without_a_support("A")]
    # 25 blocks of thickness 1 on a span of 10, the outer two fixed
    ends = scene_of(ring(25, 5.5, 1.0), {0, 24})
    dense = [Trial("density", f"25 at {x:g}", ends, 0.84, x) for x in DENSITIES]
    return [*sample_trials(samples), *freed, *built_trials(), *dense]


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    python = None if quick else python_with_lmgc90(options.lmgc90)
    witnesses = ["rbe", "lmgc90"] if python else ["rbe"]
    all_trials = trials(quick=quick)
    times = race([t for t in all_trials if t.name in (LARGEST, "bridge")], 1 if quick else 5)
    table = pd.DataFrame([row_of(t, python) for t in all_trials])
    report(table, witnesses)
    print(times.to_string(index=False, float_format="%.3g"))
    ratio = None if quick else times.loc[times["case"] == LARGEST, "ratio"].max()
    found = faults(table, witnesses, ratio)
    if python:  # rows of a witness are not given up because it is not there
        return Finding(dict.fromkeys(found, False), tables={"witnesses": table})
    alone = ", by one witness: LMGC90 was not asked or is not installed; nothing stored"
    return Finding(dict.fromkeys(found, False), alone)


CLAIM = Claim(
    experiment,
    digits=3,
    quick="few cases",
    options=(Option("--lmgc90", "a Python with compas_lmgc90", sys.executable),),
    needs=(Extra("compas_cra", 'pip install "seqopt[witness]"'),),
)
