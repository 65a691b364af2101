"""What every engine does with what it is asked: conformance to the interface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.contact.mortar import DRY, EPOXY, BedStiffness, Mortar, find_elastic_limits
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.interface import Want
from seqopt.engines.registry import ENGINES, REASONS, AutoEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import GripError, MechanismError, SceneError
from seqopt.network.build import build_network
from seqopt.responses.table import step_fields
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import sequential
from seqopt.study import STUDY_BED
from tests.builders import from_both_sides, largest_difference, running_bond, six_bricks


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


# discrete elements on beds of springs of their own


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


# the cheapest level that is enough is taken, and counted


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
