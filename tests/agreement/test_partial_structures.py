"""Partial structures of all kinds: the engine agrees with an independent dense solver to 1e-9.

Every scene that ships, scenes that a few words describe, and the armadillo of compas_cra, built by
the sequential and by the cantilever method; of the first, the step that places every brick is
taken, of the second every tenth, and of large structures fewer. Compared with one stiffness matrix
of rigid bodies on springs (`tests.direct_solve`) are all fields: the largest difference over the
largest entry of each kind.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene
from seqopt.network.build import build_network
from seqopt.scene.scene_file import ABOUT, load_scene
from seqopt.sequence.methods import METHODS
from tests.builders import apart
from tests.direct_solve import solve_dense

LARGEST = 1e-9  # difference over the largest entry of its kind
EVERY = {"sequential": 1, "cantilever": 10}
ARMADILLO = "armadillo_cra"
LARGE = ("vault338", "dome163", ARMADILLO)
WORDS = (
    "arch:span=2,rise=0.8",
    "arch:span=3,rise=1.2,curve=catenary",
    "vault:span=2,rise=0.8,columns=3",
    "wall:columns=6,courses=5",
    "wall:columns=5,courses=4,corbel=0.02",
)


def scene_of(name):
    """A scene by name or words; the armadillo is imported."""
    if name != ARMADILLO:
        return load_scene(name)
    pytest.importorskip("compas_cra")
    folder = Path(import_module("compas_cra").SAMPLE)
    given = Given(unit="m", density=2400.0, accept_overlaps=True)
    return import_scene(folder / f"{name}.json", given=given)


def marks(name):
    """Quick, slow or for a release."""
    slow = [] if name == WORDS[0] else [pytest.mark.slow]
    return [*slow, *[pytest.mark.long] * (name in LARGE)]


@pytest.mark.filterwarnings("ignore::seqopt.errors.SceneWarning")  # of the armadillo
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=marks(n)) for n in (*ABOUT, *WORDS, ARMADILLO)]
)
def test_the_engine_agrees_with_a_dense_solver(name):
    network = build_network(scene_of(name))
    engine = ComplianceEngine(network)
    for method, every in EVERY.items():
        steps = METHODS[method](network)
        first = {step.bricks: step for step in reversed(steps)}
        few = 60 if name in LARGE else every
        for step in [first[bricks] for bricks in sorted(first)[::few]] + [steps[-1]]:
            held = np.array([step.held], dtype=np.int64).reshape(1, -1)
            wanted = solve_dense(network, step.bricks, grip_columns(network, step.bricks, held))
            gap = apart(engine.solve(step.bricks, held, Want.ALL), wanted)
            assert gap <= LARGEST, (method, step.number)


def test_a_field_that_is_off_is_seen(engine25):
    fields = solve_dense(engine25.network, 5, np.array([[8]]))
    wrong = replace(fields, displacement=fields.displacement * (1 + 2 * LARGEST))
    assert apart(fields, fields) == 0
    assert apart(wrong, fields) > LARGEST
