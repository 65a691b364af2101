"""Grips that give way as the joints of an arm do: full compliances against a dense solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.arms import _permits
from seqopt.engines.interface import Want
from seqopt.engines.registry import engine_for, make_engine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import GripError
from seqopt.network.build import build_network
from seqopt.scene._armed import can_hold
from tests.arms.scenes import compliances, with_joints
from tests.builders import block, six_bricks
from tests.limit_scenes import softened
from tests.soft_bodies import SoftBodies

STATES = 200  # random ones, one in two with hands that are moved


def far(found, wanted):
    return np.abs(found - wanted).max() / max(np.abs(wanted).max(), 1e-300)


def inner(net, found, bricks):
    nodes = [net.index_of_node[n] for b in net.scene.placed[:bricks] for n in b.nodes]
    return found.displacement[0, nodes]


def drawn_jacobians(rng, scene, robots, joints=6):
    """How nodes move with joints about axes through random points a meter or so away."""
    nodes = len(scene.brick_of_node)
    axes = rng.normal(size=(robots, nodes, 3, joints))
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    away = rng.normal(size=(robots, nodes, 3, joints))
    return np.concatenate([np.cross(axes, away, axis=2), axes], axis=2)


def drawn_state(arch, i):
    """A random state: scene, brick count, nodes of robots in order, and how far they are moved."""
    rng = np.random.default_rng([i, 11])
    scene = softened(arch, i)
    robots = int(rng.integers(1, 5))
    stiffness = 10 ** rng.uniform(4, 8, (robots, 1)) * 10 ** rng.uniform(-1, 1, (robots, 6))
    hands = [
        (
            None if rng.random() < 0.6 else 10 ** rng.uniform(4, 8),
            None if rng.random() < 0.6 else 10 ** rng.uniform(2, 7),
        )
        for _ in range(robots)
    ]
    bricks = int(rng.integers(2, 26))
    free = [n for b in scene.placed[:bricks] for n in b.nodes if n not in scene.blocked_nodes]
    nodes = rng.permutation(free)[:robots].tolist()
    if robots > 1 and rng.random() < 0.4:  # two on one brick
        pair = scene.placed[int(rng.integers(1, bricks))].nodes
        nodes = [*pair, *(n for n in nodes if n not in pair)][:robots]
    robots = len(nodes)
    moved = 4e-4 * rng.normal(size=(robots, 3)) * (i % 2)
    jacobians = drawn_jacobians(rng, scene, robots)
    return with_joints(scene, stiffness[:robots], jacobians, hands[:robots]), bricks, nodes, moved


def agree_with_dense(arch, i):
    """The largest relative difference of a random state's forces, moments and displacements."""
    scene, bricks, nodes, moved = drawn_state(arch, i)
    borne, shifts = SoftBodies(scene, bricks).solve(nodes, compliances(scene, nodes), moved)
    net, given = build_network(scene), moved[None] if moved.any() else None
    found = ComplianceEngine(net).solve(bricks, [scene.grip_numbers(nodes)], Want.ALL, given)
    out = [far(found.grip_force[0], borne[:, :3]), far(inner(net, found, bricks), shifts)]
    turn = any(robot.rotational_stiffness for robot in scene.robots)
    return max([*out, far(found.grip_moment[0], borne[:, 3:])] if turn else out)


@pytest.mark.parametrize("i", range(0, STATES, 67))
def test_a_dense_solver_agrees(arch25, i):
    assert agree_with_dense(arch25, i) <= 1e-9


@pytest.mark.long
@pytest.mark.slow
def test_a_dense_solver_agrees_on_all_states(arch25):
    assert max(agree_with_dense(arch25, i) for i in range(STATES)) <= 1e-9


@pytest.mark.parametrize("i", [2])
def test_the_dense_solver_would_notice(arch25, i):
    """Negative control: without what joints do across the axes, or with the joints of another."""
    scene, bricks, nodes, moved = drawn_state(arch25, i)
    solver, right = SoftBodies(scene, bricks), compliances(scene, nodes)
    borne = solver.solve(nodes, right, moved)[0]
    alone = [np.diag(np.diag(each)) for each in right]
    assert far(solver.solve(nodes, alone, moved)[0], borne) > 1e-3
    assert far(solver.solve(nodes, [1.1 * each for each in right], moved)[0], borne) > 1e-4


@pytest.mark.parametrize("turn", [None, 1e5])
@pytest.mark.parametrize("grips", [(3, 8, 11), (4, 5, 9)])
def test_engines_agree(grips, turn):
    rng, scene = np.random.default_rng(3), six_bricks("V")
    stiffness = 10 ** rng.uniform(5, 7, (3, 6))
    hands = [(1e7, turn)]
    scene = with_joints(scene, stiffness, drawn_jacobians(rng, scene, 3), hands)
    net, numbers = build_network(scene), [scene.grip_numbers(grips)]
    borne, shifts = SoftBodies(scene, 6).solve(grips, compliances(scene, grips), np.zeros((3, 3)))
    most = {"compliance": 1e-10, "auto": 1e-9, "discrete": 1e-7, "frame": 1e-4}
    for name, close in most.items():
        found = make_engine(name, net).solve(6, numbers, Want.ALL)
        assert far(found.grip_force[0], borne[:, :3]) <= close
        assert far(inner(net, found, 6), shifts) <= close


@pytest.mark.parametrize("size", [1e3, 1e5])
def test_one_joint_bears_what_a_lever_on_a_spring_does(size):
    """A hinge whose axis is level, 1.5 m from the node, beside ground that sinks and does not turn.

    Where node and ground sink by the same u, W = u (g + k / L²), with g of the ground.
    """
    ground, length = 1e6, 1.5
    hinge = np.zeros((1, 2, 6, 1))
    hinge[..., 2, 0], hinge[..., 4, 0] = length, 1.0  # it turns about y, and lifts
    lever, ways = size / length**2, (("compliance", 1e13), ("frame", 1e8), ("discrete", 1e8))
    for name, turning in ways:
        scene = block(translational_stiffness=(ground,) * 3, rotational_stiffness=(turning,) * 3)
        arm, weight = with_joints(scene, [[size]], hinge), scene.bricks[0].mass * 9.81
        node, close = scene.bricks[0].nodes[0], 1e-7 if name == "compliance" else 1e-3
        found = make_engine(name, arm).solve(1, [[node]], Want.ALL).grip_force[0, 0]
        assert found[2] == pytest.approx(weight * lever / (ground + lever), abs=close * weight)


def test_a_posture_that_there_is_not_is_a_line(arch25):
    jacobians = drawn_jacobians(np.random.default_rng(1), arch25, 2)
    scene = with_joints(arch25, np.full((2, 6), 1e6), jacobians, without=[(1, 4)])
    node = sorted(arch25.brick_of_node)[4]
    engine = make_engine("compliance", scene)
    said = f"robot r1 has no posture at node {node}, so the compliance of its grip is not known"
    with pytest.raises(GripError, match=said):
        engine.solve(20, [scene.grip_numbers((3, node))])
    assert engine.solve(20, [scene.grip_numbers((node, 3))]).grip_force.all()
    assert [can_hold(scene, kind, node) for kind in (0, 1)] == [True, False]
    assert can_hold(arch25, 0, node)


def test_scenarios_hold_in_the_same_postures(arch25):
    """In which joints may have other stiffnesses; a scene with arms elsewhere has its own."""
    jacobians = drawn_jacobians(np.random.default_rng(1), arch25, 2)
    scene = with_joints(arch25, np.full((2, 6), 1e6), jacobians)
    engine = make_engine("compliance", scene)
    (drawn,) = seqopt.scenarios(scene, count=1, grips=(0.1, 0.2)).scenes
    factor = drawn.robots[1].arm.joint_stiffness[0] / 1e6
    assert 0.1 <= factor <= 0.2
    found = engine_for(engine, drawn).network.scene.held_postures
    assert found == scene.held_postures
    own = [found.compliance(each.arms)[1] for each in (drawn, scene)]
    assert np.allclose(factor * own[0], own[1], rtol=1e-12)
    first, second = drawn.robots
    away = replace(second, arm=replace(second.arm, position=(9.0, 0.0, 0.0)))
    other = drawn.with_robots(first, away)
    assert _permits.hold_alike(scene, other) is other
    assert "held_postures" not in vars(other)
    assert "held_postures" not in vars(drawn)  # by itself it has postures of its own
