"""Claim: on partial structures of all kinds the engine agrees with an independent dense solver.

Method: every scene that ships, scenes that a few words describe (arches, all tested barrel vaults,
walls, domes), and the armadillo of compas_cra, whose blocks and faces are from a file. Each is
built by the sequential and by the cantilever method; of the first, the step that places every
brick is taken, of the second every tenth. Each state is solved by the engine, and by one dense
matrix of rigid bodies on springs, assembled apart from the engines, whose residuals are summed in
extended precision (`experiments.engines.parts.dense_bodies`). Compared are edge forces,
displacements, grip forces, what supports carry, wrenches of springs and twists of bricks: the
largest difference over the largest entry of each kind in its state. The claim fails where one is
above 1e-9.

Inputs: the scenes; extra ``witness`` for the armadillo. Command: ``python -m
experiments.engines.partial_structures [--quick]``. Writes
``experiments/results/partial_structures.csv``.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.engines.parts.dense_bodies import dense_fields
from experiments.harness.claim import Claim, Extra, Finding, Options
from experiments.harness.plotting import RESULTS
from seqopt.engines.interface import Fields, Want, grip_columns
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SceneWarning
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.imports.content import Given
from seqopt.scene.imports.formats import import_scene
from seqopt.scene.library.by_words import ABOUT
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.steps import Step
from seqopt.sequence.two_robots import METHODS

STORE = RESULTS / "partial_structures.csv"
LARGEST = 1e-9  # difference over the largest entry of its kind
EVERY = {"sequential": 1, "cantilever": 10}
ARMADILLO = "armadillo_cra"
WORDS = (
    "arch:span=2,rise=0.8",
    "arch:span=3,rise=1.2,curve=catenary",
    "arch:span=2,rise=1.2,curve=pointed",
    *(f"barrel:test={number}" for number in range(1, 9)),
    "wall:columns=6,courses=5",
    "wall:columns=5,courses=4,corbel=0.02",
    "dome:courses=6,around=20,bond=herringbone",
)
ALL = (*ABOUT, *WORDS, ARMADILLO)
QUICK = ("arch25", WORDS[0], "wall:columns=6,courses=5")


def scenes(names: tuple[str, ...]) -> Iterator[tuple[str, Scene]]:
    """Yield scenes by name or words; the armadillo is imported."""
    for name in names:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            yield name, _armadillo() if name == ARMADILLO else load_scene(name)


def _armadillo() -> Scene:
    folder = Path(import_module("compas_cra").SAMPLE)
    return import_scene(folder / f"{ARMADILLO}.json", given=Given(unit="m", density=2400.0))


def states(network: Network, method: str) -> list[Step]:
    """Return a method's first step at every brick count, or at so many of them, and its last."""
    make: Callable[[Network], list[Step]] = METHODS[method]
    steps = make(network)
    first = {step.bricks: step for step in reversed(steps)}
    return [first[bricks] for bricks in sorted(first)[:: EVERY[method]]] + [steps[-1]]


def difference(first: Fields, second: Fields) -> float:
    """Return the largest difference over the largest entry of its kind; zero beside all zeros."""
    worst = 0.0
    for kind in first.__dataclass_fields__:
        a, b = getattr(first, kind), getattr(second, kind)
        gap = np.abs(a - b).max(initial=0.0)
        worst = max(worst, gap / np.abs(b).max(initial=0.0) if gap else 0.0)
    return worst


def row_of(name: str, network: Network, method: str) -> dict[str, object]:
    """Return how far engine and dense solver are apart over the states of a method."""
    engine, worst = ComplianceEngine(network), (0.0, 0)
    met = states(network, method)
    for step in met:
        held = np.array([step.held], dtype=np.int64).reshape(1, -1)
        columns = grip_columns(network, step.bricks, held)
        wanted = dense_fields(network, step.bricks, columns[0])
        gap = difference(engine.solve(step.bricks, held, Want.ALL), wanted)
        worst = max(worst, (gap, step.bricks))
    bricks = len(network.scene.bricks)
    row: dict[str, object] = {"scene": name, "bricks": bricks, "method": method}
    return row | {"states": len(met), "difference": worst[0], "worst_at": worst[1]}


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    names = QUICK if quick else ALL
    found = []
    for name, scene in scenes(names):
        network = build_network(scene)
        for method in EVERY:
            found.append(row_of(name, network, method))
            print(", ".join(f"{key} {value}" for key, value in found[-1].items()), flush=True)
    table = pd.DataFrame(found)
    if not quick:
        RESULTS.mkdir(exist_ok=True)
        table.to_csv(STORE, index=False, float_format="%.3g")
    return Finding(holds(table))


def holds(table: pd.DataFrame) -> bool:
    """Return whether every state answers as the dense solver does, none being left out."""
    whole = table[table["method"] == "sequential"]
    return bool(
        (table["difference"] <= LARGEST).all()
        and (whole["states"] > whole["bricks"]).all()
        and set(QUICK if len(whole) == len(QUICK) else ALL) == set(whole["scene"])
    )


CLAIM = Claim(
    experiment,
    quick="three small scenes, nothing written",
    needs=(Extra("compas_cra", "pip install 'seqopt[witness]'"),),
)

if __name__ == "__main__":
    CLAIM.main()
