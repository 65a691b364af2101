"""The levels of fidelity: each equals the next where its condition is met, and says where not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from seqopt.contact.mortar import DRY, Mortar
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, SceneError, SolverError
from seqopt.network.build import build_network
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import METHODS
from seqopt.stability._steps import assess_steps
from seqopt.stability.assessment import Verdict
from tests.builders import largest_difference
from tests.strategies import arches, both_sided, states, walls


@settings(max_examples=8)
@given(states(scenes=st.one_of(arches(max_bricks=5), walls(), both_sided())))
def test_within_the_elastic_limits_discrete_elements_are_rigid_bricks(state):
    scene, bricks, grips = state
    net = build_network(scene)
    strong = Mortar(friction=1.0, tensile_strength=1e12, cohesion=1e12)
    try:
        found = DiscreteEngine(net, strong).solve(bricks, grips, Want.ALL)
    except SceneError:  # bent so far that bricks interpenetrate
        reject()
    exact = ComplianceEngine(net).solve(bricks, grips, Want.ALL)
    assert largest_difference(found, exact, net) <= 1e-7


@pytest.mark.parametrize(
    "number", [3, 9, *(pytest.param(n, marks=pytest.mark.slow) for n in (7, 20, 24))]
)
def test_what_comes_to_rest_is_proven_to_stand(number):
    """Forces within the limits are there: the certificate must find some too, without bonds."""
    net = build_network(load_scene("arch25"))
    step = METHODS["sequential"](net)[number - 1]
    (result,) = assess_steps(net, [step], DRY)
    engine = DiscreteEngine(net, DRY)
    if result.verdict is Verdict.FALLS:
        assert number in (9, 20)
        with pytest.raises((MechanismError, SolverError)):
            engine.solve(step.bricks, [list(step.held)])
    else:
        fields = engine.solve(step.bricks, [list(step.held)])
        total = fields.grip_force[0].sum(axis=0) + fields.support[0, :, :3].sum(axis=0)
        weight = -net.weight[: step.bricks].sum(axis=0)
        assert total == pytest.approx(weight, abs=1e-6 * np.abs(weight).max())
