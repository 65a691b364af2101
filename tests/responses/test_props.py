"""What props do to responses: none that are soft, robots' grips where robots hold, stiff centering.

Engines are asked about props as about grips, whose agreement other tests show.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from experiments.placement.parts.staged import analyze_staged
from seqopt import Prop, Robot
from seqopt.engines.interface import Want
from seqopt.responses.quantities import _excess_of
from tests.builders import small_arch

UP = (0.0, 0.0, 1.0)


def other_node(scene, place):
    """The node of a brick at which it is not placed."""
    brick = scene.placed[place]
    return next(node for node in brick.nodes if node != brick.placing_node)


def sequence(scene, engine="compliance"):
    network = seqopt.build_network(scene)
    return seqopt.make_engine(engine, network), seqopt.sequential(network)


def alike(one, other, **how):
    names = [n for n in other if other[n].dtype == float and n in one and "prop" not in n]
    np.testing.assert_allclose(one[names], other[names], **how)


@pytest.mark.parametrize("engine", ["compliance", "frame"])
def test_a_prop_that_gives_way_is_none(engine):
    scene = small_arch(6)
    node = other_node(scene, 3)
    bare = seqopt.analyze(*sequence(scene, engine))
    soft = seqopt.analyze(*sequence(scene.with_props(Prop(node=node, stiffness=1e-3)), engine))
    alike(soft, bare, rtol=1e-4, atol=1e-5)
    assert soft["F_prop_N"].max() < 1e-4
    stiff = seqopt.analyze(*sequence(scene.with_props(Prop(node=node)), engine))
    assert stiff["F_prop_N"].max() > 1.0  # the control: it is not the test that sees nothing


@pytest.mark.parametrize("stiffness", [None, 1e6])
def test_a_prop_is_the_grip_of_a_robot_that_holds_all_the_time(stiffness):
    scene = small_arch(6)
    node = other_node(scene, 2)
    engine, steps = sequence(scene.with_props(Prop(node=node, stiffness=stiffness)))
    held = [replace(s, grips=(*s.grips, node if s.held and s.bricks >= 3 else None)) for s in steps]
    more = Robot(name="more", payload=1e6, stiffness=stiffness)
    beside = seqopt.make_engine("compliance", scene.with_robots(*scene.robots, more))
    alike(seqopt.analyze(engine, steps), seqopt.analyze(beside, held), rtol=1e-9, atol=1e-9)


def test_stiff_props_at_every_brick_hold_the_structure_still():
    """Displacements go to those between props as their stiffness grows: to far less than without.

    A brick of weight W on springs k at both ends, and on nothing else, sinks by W / 2k.
    """
    scene = small_arch(6)
    nodes = [n for b in scene.placed for n in b.nodes if n not in scene.blocked_nodes]
    bare = seqopt.make_engine("compliance", scene).solve(5, np.zeros((1, 0), int))
    most = []
    for stiffness in (1e3, 1e5, 1e7, 1e9):
        props = [Prop(node=node, stiffness=stiffness) for node in nodes]
        engine = seqopt.make_engine("compliance", scene.with_props(*props))
        found = engine.solve(5, [engine.network.scene.prop_numbers(5, held=False)])
        most.append(np.linalg.norm(found.displacement, axis=2).max())
    assert most == sorted(most, reverse=True)
    assert most[-1] < 1e-3 * np.linalg.norm(bare.displacement, axis=2).max()
    weight = np.linalg.norm(engine.network.weight, axis=1).max()
    assert most[-1] < weight / 1e9  # joints carry a part of it


def test_excess_is_a_pull_or_what_is_beyond_a_capacity():
    force = np.array([[[0.0, 3.0, 4.0]], [[0.0, 0.0, -2.0]], [[0.0, 0.0, 9.0]]])
    assert _excess_of([Prop(node=1)], force).tolist() == [0, 0, 0]
    assert _excess_of([Prop(node=1, direction=UP)], force).tolist() == [0, 2, 0]
    assert _excess_of([Prop(node=1, capacity=5)], force).tolist() == [0, 0, 4]
    assert _excess_of([Prop(node=1, direction=UP, capacity=1)], force).tolist() == [4, 2, 8]


def test_staged_construction_knows_props():
    """They bear what comes after them, and nothing is left of them at the end."""
    scene = small_arch(6)
    node = other_node(scene, 2)
    network = seqopt.build_network(scene.with_props(Prop(node=node)))
    table = analyze_staged(network, seqopt.sequential(network))
    assert table["F_prop_N"].max() > 1.0
    assert table["props"].tolist()[-1] == 0


def test_a_table_of_props_says_what_each_bears():
    scene = small_arch(6)
    node = other_node(scene, 3)
    engine, steps = sequence(scene.with_props(Prop(node=node, direction=(0, 0, -1))))
    build = seqopt.GivenSequence(engine, steps)
    (row,) = build.props().to_dict("records")
    table = seqopt.analyze(engine, steps)
    assert row["node"] == node
    assert row["largest_force_N"] == pytest.approx(table["F_prop_N"].max())
    assert -row["least_push_N"] == pytest.approx(table["prop_excess_N"].max())
    assert steps[row["from_step"] - 1].bricks == 4
    assert steps[row["to_step"]].held == ()
    assert engine.solve(2, [[1]], Want(0)).grip_force.shape == (1, 1, 3)


def test_centering_leaves_robots_their_nodes():
    scene = small_arch(5)
    nodes = [prop.node for prop in scene.with_centering().props]
    assert not {*nodes} & {brick.placing_node for brick in scene.placed}
    assert len(nodes) >= 4
