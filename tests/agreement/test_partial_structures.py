"""Partial structures of all kinds: the engine agrees with an independent dense solver to 1e-9.

Every scene that ships, scenes that a few words describe, and the armadillo of compas_cra, built by
the sequential and by the cantilever method; of the first, the step that places every brick is
taken, of the second every tenth. Compared with one dense matrix of rigid bodies on springs
(`tests.dense_bodies`) are edge forces, displacements, grip forces, what supports carry, wrenches of
springs and twists of bricks: the largest difference over the largest entry of each kind.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from seqopt.engines.interface import Fields, Want, grip_columns
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SceneWarning
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import ABOUT, load_scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.steps import Step
from tests.dense_bodies import dense_fields

LARGEST = 1e-9  # difference over the largest entry of its kind
EVERY = {"sequential": 1, "cantilever": 10}
ARMADILLO = "armadillo_cra"
WORDS = (
    "arch:span=2,rise=0.8",
    "arch:span=3,rise=1.2,curve=catenary",
    "arch:span=2,rise=1.2,curve=pointed",
    "vault:span=2,rise=0.8,columns=3",
    "wall:columns=6,courses=5",
    "wall:columns=5,courses=4,corbel=0.02",
)
ALL = (*ABOUT, *WORDS, ARMADILLO)


def scene_of(name: str) -> Scene:
    """Return a scene by name or words; the armadillo is imported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        if name != ARMADILLO:
            return load_scene(name)
        pytest.importorskip("compas_cra")
        folder = Path(import_module("compas_cra").SAMPLE)
        given = Given(unit="m", density=2400.0, accept_overlaps=True)
        return import_scene(folder / f"{name}.json", given=given)


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


def marks(name: str) -> list[pytest.MarkDecorator]:
    """Return whether a scene is for every day, or for a release."""
    if name == WORDS[0]:
        return []
    large = name in ("vault338", "dome163", ARMADILLO)
    return [pytest.mark.slow, *[pytest.mark.long] * large]


@pytest.mark.parametrize("name", [pytest.param(name, marks=marks(name)) for name in ALL])
def test_the_engine_agrees_with_a_dense_solver(name):
    network = build_network(scene_of(name))
    engine = ComplianceEngine(network)
    for method in EVERY:
        met = states(network, method)
        assert method != "sequential" or len(met) > len(network.scene.bricks)
        for step in met:
            held = np.array([step.held], dtype=np.int64).reshape(1, -1)
            columns = grip_columns(network, step.bricks, held)
            wanted = dense_fields(network, step.bricks, columns[0])
            gap = difference(engine.solve(step.bricks, held, Want.ALL), wanted)
            assert gap <= LARGEST, (method, step.number)


def test_a_field_that_is_off_is_seen(engine25):
    fields = dense_fields(engine25.network, 5, np.array([8]))
    wrong = replace(fields, displacement=fields.displacement * (1 + 2 * LARGEST))
    assert difference(fields, fields) == 0
    assert difference(wrong, fields) > LARGEST
