"""Discrete elements on beds of springs of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.contact.mortar import DRY, EPOXY, BedStiffness, Mortar
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, SceneError
from seqopt.network.build import build_network
from seqopt.responses.table import step_fields
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import sequential
from seqopt.study.published import STUDY_BED
from tests.builders import largest_difference


def test_beds_alone_are_other_joints():
    net = build_network(load_scene("arch25"))
    own, study = DiscreteEngine(net), DiscreteEngine(net, bed=STUDY_BED)
    first, second = (e.solve(10, [[19]], Want.ALL) for e in (own, study))
    assert largest_difference(first, second, net) > 0.5
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


@pytest.mark.parametrize(
    ("words", "number"), [("arch:span=1,rise=0.4,pattern=VLR", 2), ("wall:columns=3,courses=3", 15)]
)
def test_bricks_that_fly_off_are_a_mechanism(words, number):
    """They came to rest 1,119 km and 443 m away, where rounding hid that nothing holds them."""
    network = build_network(load_scene(words))
    step = sequential(network)[number - 1]
    with pytest.raises(MechanismError, match=r"joints open or slip and brick \d becomes"):
        step_fields(DiscreteEngine(network, DRY), step)
    bonded = step_fields(DiscreteEngine(network, EPOXY), step, Want.BRICKS)
    assert np.abs(bonded.brick_twist).max() < 0.01


def test_soft_joints_that_hold_are_no_mechanism_however_far_they_give():
    """Bonds that do not break resist; that is a displacement, of more than a brick's length."""
    scene = load_scene("arch:span=1,rise=0.4")
    soft = {"translational_stiffness": (1e2,) * 3, "rotational_stiffness": (1e1,) * 3}
    joints = tuple(replace(joint, **soft) for joint in scene.joints)
    grounds = tuple(replace(ground, **soft) for ground in scene.grounds)
    network = build_network(replace(scene, joints=joints, grounds=grounds))
    strong = Mortar(friction=1.0, tensile_strength=1e9, cohesion=1e9)
    found = DiscreteEngine(network, strong).solve(4, [[7]], Want.ALL)
    exact = ComplianceEngine(network).solve(4, [[7]], Want.ALL)
    assert np.abs(found.displacement).max() > scene.bricks[0].dimensions[0]
    assert largest_difference(found, exact, network) <= 1e-6
