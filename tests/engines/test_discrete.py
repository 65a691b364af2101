"""Discrete elements on beds of springs of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.contact.mortar import Mortar
from seqopt.engines.discrete._bed import BedStiffness
from seqopt.engines.discrete.engine import Across, DiscreteEngine, Pinch
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.scene.scene_file import load_scene
from seqopt.study.published import STUDY_BED, STUDY_PADS
from tests.builders import largest_difference


def test_beds_alone_are_other_joints_and_pads_let_a_brick_turn():
    net = build_network(load_scene("arch25"))
    own, study = DiscreteEngine(net), DiscreteEngine(net, bed=STUDY_BED)
    first, second = (e.solve(10, [[19]], Want.ALL) for e in (own, study))
    assert largest_difference(first, second, net) > 0.5
    pinch = Pinch(Across.WIDTH, STUDY_PADS, side=0.03)
    third = DiscreteEngine(net, bed=STUDY_BED, pinch=pinch).solve(10, [[19]], Want.ALL)
    assert np.abs(third.brick_twist[0, 9]).max() > 0
    total = third.grip_force[0].sum(axis=0) + third.support[0, :, :3].sum(axis=0)
    weight = -net.weight[:10].sum(axis=0)
    assert total == pytest.approx(weight, abs=1e-6 * np.abs(weight).max())
    with pytest.raises(SceneError, match="bed: normal is 0"):
        BedStiffness(0.0, 1.0)


@pytest.mark.parametrize("stiff", [1e10, 1e12])
def test_a_hinge_far_stiffer_the_other_ways_comes_to_rest(stiff):
    """Its bed is stiffer still: what the bed deforms must not drown in how far the bricks move."""
    scene = load_scene("arch25")
    hinge = next(joint for joint in scene.joints if joint.bricks == (3, 4))
    ways = replace(hinge, rotational_stiffness=(hinge.rotational_stiffness[0], stiff, 0.0))
    joints = tuple(ways if joint is hinge else joint for joint in scene.joints)
    net = build_network(replace(scene, joints=joints))
    strong = Mortar(friction=1.0, tensile_strength=1e12, cohesion=1e12)
    found = DiscreteEngine(net, strong).solve(24, [[47]], Want.ALL)
    exact = ComplianceEngine(net).solve(24, [[47]], Want.ALL)
    assert largest_difference(found, exact, net) <= 1e-8
