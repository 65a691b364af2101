"""Laws of the ground ends: with the grips they carry the weight, whichever comes first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seqopt.arrays import skew
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.responses.quantities import responses_of
from tests.builders import HERE, from_both_sides, moved
from tests.strategies import arches, both_sided, states, walls

any_scene = st.one_of(arches(), walls(), both_sided())
MIRRORS = [(-1.0, 1.0, 1.0), (1.0, -1.0, 1.0)]


def left_over(net, bricks, grips, fields):
    """Force and moment about the origin, (6,), of weight, grips and ground ends summed."""
    places = [net.node_name.index(int(node)) for node in grips[0]]
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
@given(state=states(any_scene))
def test_ground_ends_and_grips_balance_the_weight(engine, tolerance, state):
    scene, bricks, grips = state
    net = build_network(scene)
    fields = engine(net).solve(bricks, grips, Want.ALL)
    rest = np.abs(left_over(net, bricks, grips, fields)).max()
    assert rest <= tolerance * size(net, fields) * max(1.0, np.ptp(net.node_position, axis=0).max())


@pytest.mark.parametrize("engine", [ComplianceEngine, FrameEngine, DiscreteEngine])
@pytest.mark.parametrize("bricks", [2, 5, 7])
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
@given(state=states(any_scene))
def test_a_mirrored_scene_has_mirrored_ends(mirror, state):
    scene, bricks, grips = state
    other = moved(scene, lambda p: p * np.array(mirror))
    one, two = (
        ComplianceEngine(build_network(s)).solve(bricks, grips, Want.ALL) for s in (scene, other)
    )
    turned = one.support * np.array([*mirror, *(-x for x in mirror)])  # moments are axial
    assert np.abs(two.support - turned).max() <= 1e-8 * size(build_network(scene), one)


@pytest.mark.parametrize("bricks", [2, 4, 6, 7])
def test_a_symmetric_arch_has_ends_that_mirror_each_other(bricks):
    """With no grip, and with grips that mirror each other."""
    net = build_network(from_both_sides(7))  # nodes 0 to 13 from one end to the other
    axes = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
    for grips in (HERE, [[1, 12]]):
        support = ComplianceEngine(net).solve(bricks, grips).support[0]
        assert support[1] == pytest.approx(axes * support[0], abs=1e-9 * np.abs(support).max())


@given(state=states(any_scene), data=st.data())
def test_the_order_of_the_ends_changes_the_axis_and_nothing_else(state, data):
    scene, bricks, grips = state
    order = data.draw(st.permutations(range(len(scene.grounds))))
    other = replace(scene, grounds=tuple(scene.grounds[i] for i in order))
    nets = [build_network(s) for s in (scene, other)]
    one, two = (ComplianceEngine(net).solve(bricks, grips, Want.ALL) for net in nets)
    limit = 1e-8 * size(nets[0], one)
    assert np.abs(two.support - one.support[:, order]).max() <= limit
    answers = [responses_of(*pair) for pair in zip(nets, (one, two), strict=True)]
    for name, value in answers[0].items():
        gap = np.abs(answers[1][name] - value).max(initial=0)
        assert gap <= (1e-8 * np.abs(one.displacement).max() if name[0] == "D" else limit), name


@given(state=states(any_scene))
def test_an_end_that_does_not_act_carries_nothing(state):
    """And one that does carries what its spring exerts, about its own fixed point."""
    scene, bricks, grips = state
    net = build_network(scene)
    fields = ComplianceEngine(net).solve(bricks, grips, Want.ALL)
    springs = net.springs
    for end, ground in enumerate(scene.grounds):
        spring, reaction = springs.support[end], fields.support[0, end]
        assert tuple(springs.anchor[spring]) == ground.anchor
        if springs.since[spring] > bricks:
            assert not reaction.any()
        force, moment = np.split(fields.joint_wrench[0, spring], 2)
        arm = skew(np.subtract(ground.position, ground.anchor))
        wanted = np.concatenate([force, moment + arm @ force])
        assert np.abs(reaction - wanted).max() <= 1e-12 * size(net, fields)
