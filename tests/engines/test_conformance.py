"""What every engine does with what it is asked: conformance to the interface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.engines.interface import Want
from seqopt.engines.registry import ENGINES
from seqopt.errors import GripError, MechanismError
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from tests.builders import from_both_sides, six_bricks


@pytest.fixture(params=ENGINES)
def engine(request):
    return ENGINES[request.param](build_network(six_bricks("VLR")))


def test_shapes(engine):
    net = engine.network
    fields = engine.solve(4, [[3, 7], [7, 1], [4, 5]], Want.ALL)
    assert fields.edge_force.shape == (3, net.count_edges(4))
    assert fields.displacement.shape == (3, net.count_nodes(4), 3)
    assert fields.grip_force.shape == (3, 2, 3)
    assert fields.support.shape == (3, 2, 6)
    assert fields.joint_wrench.shape == (3, len(net.springs.since), 6)
    assert fields.brick_twist.shape == (3, 4, 6)
    for name in ("edge_force", "displacement", "grip_force", "support", "joint_wrench"):
        assert np.isfinite(getattr(fields, name)).all()


def test_no_sets_and_no_grips(engine):
    assert engine.solve(3, np.zeros((0, 2), dtype=int)).edge_force.shape[0] == 0
    assert engine.solve(3, np.zeros((1, 0), dtype=int)).grip_force.shape == (1, 0, 3)


def test_it_is_repeatable(engine):
    first, second = (engine.solve(6, [[3, 8, 11]]) for _ in range(2))
    assert (first.edge_force == second.edge_force).all()
    assert (first.displacement == second.displacement).all()


def test_the_order_of_grips_does_not_matter(engine):
    a, b = engine.solve(6, [[3, 8, 11]]), engine.solve(6, [[11, 3, 8]])
    assert a.grip_force[0] == pytest.approx(b.grip_force[0][[1, 2, 0]], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(
    ("bricks", "grips", "named"),
    [
        (0, [[1]], "brick count 0: the scene has 1 to 6"),
        (7, [[1]], "brick count 7"),
        (3, [[0]], r"grip on node 0: with 3 bricks the free nodes are \[1, 2, 3, 4, 5\]"),
        (3, [[6]], "grip on node 6"),
        (3, [[-1]], "grip on node -1"),
        (3, [[4, 4]], r"grip set \[4, 4\]: a node is held twice"),
        (3, [[1, 2], [5, 5]], r"grip set \[5, 5\]"),
        (3, [1, 2], r"grips have shape \(2,\)"),
        (3, [[1], [2, 3]], "grip sets have different sizes"),
        (3, [[1.0]], "integer node numbers"),
        (3, [[float("nan")]], "integer node numbers"),
    ],
)
def test_bad_grips_are_refused(engine, bricks, grips, named):
    with pytest.raises(GripError, match=named):
        engine.solve(bricks, grips)


@pytest.mark.parametrize("name", ENGINES)
def test_a_brick_held_by_robots_alone(name):
    """One grip leaves it turning, two leave it turning about their line, whatever the engine."""
    scene = arch_scene(ArchShape(pitch=[1.2, 0.7], pattern="VLR", closed=False))
    alone = replace(scene, joints=())
    engine = ENGINES[name](build_network(alone))
    engine.solve(1, [[1]])
    for grips in ([[2]], [[2, 3]]):
        with pytest.raises(MechanismError, match="motion of brick 2"):
            engine.solve(2, grips)


@pytest.mark.parametrize("name", ENGINES)
def test_an_end_that_closes_late(name):
    """A ground end with ``closes_with`` carries nothing before that brick is placed."""
    scene = arch_scene(ArchShape(pitch=[1.0, 0.3, -0.3, -1.0], pattern="VLR"))
    near, far = scene.grounds
    early = replace(far, brick=3, position=scene.joints[2].position, anchor=far.anchor)
    late = replace(scene, grounds=(near, replace(early, closes_with=4)))
    at_once = replace(scene, grounds=(near, early))
    free = replace(scene, grounds=(near,))
    forces = [
        ENGINES[name](build_network(s)).solve(3, [[3]]).support[0, :, :3]
        for s in (late, at_once, free)
    ]
    assert forces[0][:1] == pytest.approx(forces[2], rel=1e-5)
    assert not forces[0][1].any()
    assert np.abs(forces[0] - forces[1]).max(axis=1).min() > 1
    closed = ENGINES[name](build_network(late)).solve(4, [[3]]).support[0, :, :3]
    assert np.abs(closed - forces[0]).max(axis=1).min() > 1


@pytest.mark.parametrize("name", ENGINES)
def test_ends_come_in_the_scenes_order(name):
    """Not in that in which they begin to act, nor in that of their bricks."""
    scene = from_both_sides(7, "VLR")
    turned = replace(scene, grounds=scene.grounds[::-1])
    one, other = (
        ENGINES[name](build_network(s)).solve(5, [[5]], Want.ALL) for s in (scene, turned)
    )
    scale = np.abs(one.support).max()
    assert np.abs(one.support - other.support[:, ::-1]).max() <= 1e-4 * scale
    assert np.abs(one.support[:, 0] - one.support[:, 1]).max() > 0.1 * scale
    first = ENGINES[name](build_network(turned)).solve(1, [[1]]).support[0]
    assert not first[0].any()  # of brick 7, which does not stand yet
    assert first[1].any()
