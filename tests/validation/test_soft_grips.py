"""The reference arch held softly, as a separate dense computation of springs at the grips gave it.

Forces of grips in N, displacements of the bricks' nodes in 1e-3 mm, to the digits of that table.
"""

from __future__ import annotations

import numpy as np
import pytest

from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.responses.table import _grips_of
from seqopt.sequence.methods import METHODS
from tests.builders import block

TABLE = {  # stiffness: largest force and displacement, sequential and cantilever
    None: ((406, 306), (409, 15.7)),
    1e7: ((401, 311), (405, 66)),
    1e6: ((363, 488), (371, 379)),
    3e5: ((301, 1069), (311, 1076)),
}


def largest(network, method):
    """The largest force of a grip and displacement of a brick's node over the steps of a method."""
    engine, most = ComplianceEngine(network), np.zeros(2)
    for step in METHODS[method](network):
        found = engine.solve(step.bricks, _grips_of(network.scene, step), Want.DISPLACEMENTS)
        moved = found.displacement[0, network.inner[: step.bricks].ravel()]
        force = np.linalg.norm(found.grip_force[0], axis=1).max(initial=0.0)
        most = np.maximum(most, [force, 1e6 * np.linalg.norm(moved, axis=1).max()])
    return most


@pytest.mark.parametrize("stiffness", TABLE)
def test_sequences_of_the_arch_held_softly(arch25, stiffness):
    network = build_network(arch25.with_grips(stiffness))
    for method, (force, moved) in zip(("sequential", "cantilever"), TABLE[stiffness], strict=True):
        found = largest(network, method)
        assert found[0] == pytest.approx(force, abs=0.5)
        assert found[1] == pytest.approx(moved, abs=0.05 if moved < 20 else 0.5)


def test_a_brick_held_by_springs():
    """Closed form: on ground of stiffness K and held by k in all, it moves by W / (K + k)."""
    scene = block(translational_stiffness=(2e6, 2e6, 2e6), rotational_stiffness=(1e9, 1e9, 1e9))
    network = build_network(scene.with_grips(5e5))
    weight = float(np.linalg.norm(network.weight[0]))
    found = ComplianceEngine(network).solve(1, [[1, 2]], Want.ALL)  # at both ends: level
    assert found.displacement[0, network.inner[0], 2] == pytest.approx(-weight / 3e6, rel=1e-9)
    assert found.grip_force[0, :, 2].sum() == pytest.approx(weight / 3, rel=1e-9)
    assert found.support[0, 0, 2] == pytest.approx(2 * weight / 3, rel=1e-9)
