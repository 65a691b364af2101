"""Laws of the ground ends: with the grips they carry the weight, whichever comes first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from tests.builders import HERE, from_both_sides, moved
from tests.strategies import arches, both_sided, states, walls

any_scene = st.one_of(arches(), walls(), both_sided())
MIRRORS = [(-1.0, 1.0, 1.0), (1.0, -1.0, 1.0)]


def left_over(net, bricks, grips, fields):
    """Force and moment about the origin, (6,), of weight, grips and ground ends summed."""
    places = [net.index_of_node[int(node)] for node in grips[0]]
    points = np.vstack(
        [net.centroid[:bricks], net.node_position[places], net.springs.anchor[net.springs.support]]
    )
    reaction = fields.support[0]
    forces = np.vstack([net.weight[:bricks], fields.grip_force[0], reaction[:, :3]])
    moment = np.cross(points, forces).sum(axis=0) + reaction[:, 3:].sum(axis=0)
    return np.concatenate([forces.sum(axis=0), moment])


def size(net, fields):
    return np.abs(net.weight).max() + np.abs(fields.joint_wrench).max()


@pytest.mark.parametrize(("engine", "tolerance"), [(ComplianceEngine, 1e-9), (FrameEngine, 1e-4)])
@settings(max_examples=6)
@given(state=states(any_scene))
def test_ground_ends_and_grips_balance_the_weight(engine, tolerance, state):
    scene, bricks, grips = state
    net = build_network(scene)
    fields = engine(net).solve(bricks, grips, Want.ALL)
    rest = np.abs(left_over(net, bricks, grips, fields)).max()
    assert rest <= tolerance * size(net, fields) * max(1.0, np.ptp(net.node_position, axis=0).max())


@pytest.mark.parametrize("engine", [ComplianceEngine, FrameEngine, DiscreteEngine])
@pytest.mark.parametrize("bricks", [2, 7])
def test_the_first_end_alone_does_not(engine, bricks):
    """Negative control, and the fault: of an arch built from both sides one end was read."""
    net = build_network(from_both_sides(7))
    fields = engine(net).solve(bricks, [[3]] if bricks > 2 else HERE, Want.ALL)
    grips = np.array([[3]] if bricks > 2 else HERE)
    assert np.abs(left_over(net, bricks, grips, fields)).max() <= 1e-4 * size(net, fields)
    first = fields.support.copy()
    first[:, 1] = 0.0
    alone = replace(fields, support=first)
    assert np.abs(left_over(net, bricks, grips, alone)[:3]).max() > 0.1 * np.abs(net.weight).max()


@pytest.mark.parametrize("mirror", MIRRORS)
@settings(max_examples=6)
@given(state=states(any_scene))
def test_a_mirrored_scene_has_mirrored_ends(mirror, state):
    scene, bricks, grips = state
    other = moved(scene, lambda p: p * np.array(mirror))
    one, two = (
        ComplianceEngine(build_network(s)).solve(bricks, grips, Want.ALL) for s in (scene, other)
    )
    turned = one.support * np.array([*mirror, *(-x for x in mirror)])  # moments are axial
    assert np.abs(two.support - turned).max() <= 1e-8 * size(build_network(scene), one)
