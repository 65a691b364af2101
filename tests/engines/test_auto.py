"""The cheapest level that is enough is taken, and counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.harness.scenes import running_bond
from seqopt.contact._elastic_limits import find_elastic_limits
from seqopt.contact.mortar import DRY, EPOXY, Mortar
from seqopt.engines.interface import Want
from seqopt.engines.registry import REASONS, AutoEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene_file import load_scene
from tests.builders import largest_difference


def test_the_cheapest_level_is_taken_and_counted():
    net = build_network(arch_scene(ArchShape(pitch=[1.2, 0.8, 0.4, 0.0], pattern="V")))
    engine, sets = AutoEngine(net), np.array([[7], [1]])
    for moved in (None, np.full((2, 1, 3), 1e-6)):
        found = engine.solve(4, sets, Want.EDGES, moved)
        assert found.joint_wrench.shape == (2, 0, 6)
        exact = ComplianceEngine(net).solve(4, sets, Want.EDGES, moved)
        assert largest_difference(found, exact, net) <= 1e-9
    assert engine.tally == {"compliance": 4}


@pytest.mark.parametrize("share", [0.999, 1.001])
def test_contact_is_modeled_where_a_joint_would_leave_its_limits(share):
    net = build_network(load_scene("arch25"))
    weak = Mortar(friction=EPOXY.friction, tensile_strength=0.0, cohesion=1e9)
    wrench = ComplianceEngine(net).solve(6, [[11]], Want.JOINTS).joint_wrench
    tension = float(find_elastic_limits(net, weak).excess(wrench).max())
    assert tension > 0
    engine = AutoEngine(net, replace(weak, tensile_strength=share * tension))
    engine.solve(6, [[11]])
    assert [*engine.tally] == ["discrete" if share < 1 else "compliance"]
    assert engine.tally.keys() <= REASONS.keys()


@pytest.mark.parametrize("mortar", [EPOXY, DRY], ids=["epoxy", "dry"])
def test_levels_join_where_a_joint_has_no_stiffness(mortar):
    """Rigid bricks then answer with more than was asked for."""
    wall = running_bond(2, 2)
    loose = replace(wall.grounds[1], translational_stiffness=(1e8, 0.0, 0.0))
    net = build_network(replace(wall, grounds=(wall.grounds[0], loose)))
    engine = AutoEngine(net, mortar)
    found = engine.solve(2, np.array([[2, 4], [4, 2], [3, 5]]), Want.RESPONSES)
    assert found.brick_twist.shape == (3, 0, 6)
    exact = ComplianceEngine(net).solve(2, np.array([[2, 4], [4, 2], [3, 5]]), Want.RESPONSES)
    assert found.displacement.shape == exact.displacement.shape
    assert np.isfinite(found.displacement).all()
