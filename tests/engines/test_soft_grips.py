"""Grips that give way, against a dense solver of rigid bodies that are held by springs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.engines._grip_compliance import read_compliance
from seqopt.engines.diagnosis import Finding, diagnose
from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.registry import make_engine
from seqopt.engines.rigid._mixed import solve_mixed
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import GripError, MechanismError, SceneError
from seqopt.network.build import build_network
from tests.builders import apart, six_bricks
from tests.limit_scenes import softened
from tests.soft_bodies import SoftBodies

STATES = 200  # random ones, one in two with hands that are moved
NAMES = ("edge_force", "displacement", "grip_force", "grip_moment", "support", "joint_wrench")


def far(found, wanted):
    return np.abs(found - wanted).max() / max(np.abs(wanted).max(), 1e-300)


def robots(scene, *ways):
    """The scene with robots as stiff as said, in shifts and in turns."""
    each = enumerate(ways)
    made = (
        seqopt.Robot(name=f"r{i}", payload=1e5, stiffness=s, rotational_stiffness=t)
        for i, (s, t) in each
    )
    return scene.with_robots(*made)


def hands_of(ways):
    """Stiffness along and about six axes of robots that are not rigid."""
    out = np.zeros((len(ways), 6))
    for row, (shift, turn) in zip(out, ways, strict=True):
        row[:3], row[3:] = shift, 0.0 if turn is None else turn
    return out


def inner_nodes(net, bricks):
    return [net.index_of_node[n] for b in net.scene.placed[:bricks] for n in b.nodes]


def drawn_state(arch, i):
    """A random state: scene, brick count, nodes, stiffness of hands, and how far they are moved."""
    rng = np.random.default_rng([i, 7])
    scene = softened(arch, i)
    size = 10 ** rng.uniform(3, 9)
    shift = size if rng.random() < 0.7 else tuple(size * 10 ** rng.uniform(-1, 1, 3))
    turn = None if rng.random() < 0.6 else 10 ** rng.uniform(1, 7)
    bricks = int(rng.integers(2, 26))
    free = [n for b in scene.placed[:bricks] for n in b.nodes if n not in scene.blocked_nodes]
    nodes = rng.choice(free, min(int(rng.integers(1, 5)), len(free)), replace=False).tolist()
    if rng.random() < 0.4:  # two on one brick
        pair = scene.placed[int(rng.integers(1, bricks))].nodes
        nodes = [*pair, *(n for n in nodes if n not in pair)][:4]
    moved = 4e-4 * rng.normal(size=(len(nodes), 3)) * (i % 2)
    return (
        scene.with_grips(shift, turn),
        bricks,
        nodes,
        hands_of([(shift, turn)] * len(nodes)),
        moved,
    )


def agree_with_dense(arch, i):
    """The largest relative difference of a random state's forces, moments and displacements."""
    scene, bricks, nodes, hands, moved = drawn_state(arch, i)
    borne, shifts = SoftBodies(scene, bricks).solve(nodes, hands, moved)
    net = build_network(scene)
    given = moved[None] if moved.any() else None
    found = ComplianceEngine(net).solve(bricks, [nodes], Want.ALL, given)
    own = found.displacement[0, inner_nodes(net, bricks)]
    out = [far(found.grip_force[0], borne[:, :3]), far(own, shifts)]
    return max([*out, far(found.grip_moment[0], borne[:, 3:])] if hands[:, 3:].any() else out)


@pytest.mark.parametrize("i", range(0, STATES, 40))
def test_a_dense_solver_agrees(arch25, i):
    assert agree_with_dense(arch25, i) <= 1e-9


@pytest.mark.long
@pytest.mark.slow
def test_a_dense_solver_agrees_on_all_states(arch25):
    assert max(agree_with_dense(arch25, i) for i in range(STATES)) <= 1e-9


def test_the_dense_solver_would_notice(arch25):
    """Negative control: a tenth softer, or moved a tenth less, is another answer."""
    scene, bricks, nodes, hands, moved = drawn_state(arch25, 1)
    solver = SoftBodies(scene, bricks)
    right = solver.solve(nodes, hands, moved)[0]
    assert far(solver.solve(nodes, 0.9 * hands, moved)[0], right) > 1e-3
    assert far(solver.solve(nodes, hands, 0.9 * moved)[0], right) > 1e-3


WAYS = {
    "alike": [(1e6, None)] * 3,
    "turning": [(1e6, 1e4)] * 3,
    "each its own": [(3e6, None), (1e6, 2e4), (1e5, None)],
    "by axis": [((1e5, 1e6, 1e7), None)] * 3,
}


@pytest.mark.parametrize("grips", [(3, 8, 11), (4, 5, 9)])
@pytest.mark.parametrize("ways", WAYS)
@pytest.mark.parametrize("moved", [0.0, 1e-8])
def test_engines_agree(ways, grips, moved):
    """Who holds which node counts; so small a shift leaves joints in their elastic limits."""
    scene = robots(six_bricks("V"), *WAYS[ways])
    shift = moved * np.random.default_rng(0).normal(size=(1, 3, 3))
    shift[..., 1] = 0.0
    net, numbers = build_network(scene), [scene.grip_numbers(grips)]
    borne, shifts = SoftBodies(scene, 6).solve(grips, hands_of(WAYS[ways]), shift[0])
    for name, most in {"compliance": 1e-12, "discrete": 1e-8}.items():
        found = make_engine(name, net).solve(6, numbers, Want.ALL, shift)
        assert far(found.grip_force[0], borne[:, :3]) <= most
        assert far(found.grip_moment[0], borne[:, 3:]) <= most
        assert far(found.displacement[0, inner_nodes(net, 6)], shifts) <= most
    whole = make_engine("compliance", net).solve(6, numbers, Want.ALL, shift)
    assert apart(make_engine("frame", net).solve(6, numbers, Want.ALL, shift), whole) <= 1e-4
    assert apart(make_engine("auto", net).solve(6, numbers, Want.ALL, shift), whole) <= 1e-9
    swapped = build_network(robots(scene, *WAYS[ways][::-1]))
    other = make_engine("compliance", swapped).solve(6, numbers, Want.ALL, shift)
    assert (apart(other, whole) > 1e-3) == (ways == "each its own")


@pytest.mark.parametrize("ways", [[(None, None), (1e6, None), (1e5, 1e3)], [(None, 1e5)] * 3])
@pytest.mark.parametrize("grips", [(3, 20, 33), (22, 23, 33), (36, 37, 39)])
def test_some_are_rigid(arch25, ways, grips):
    """Together with soft ones, on one brick, and on an island that robots alone hold."""
    joints = arch25.joints[:11] + arch25.joints[12:]
    scene = replace(arch25, joints=joints) if grips[0] == 36 else arch25
    scene, bricks = robots(scene, *ways), 20
    net, numbers = build_network(scene), np.array([scene.grip_numbers(grips)])
    columns = grip_columns(net, bricks, numbers)
    sure = solve_mixed(net, bricks, columns, read_compliance(net, columns, numbers, None))
    engine = ComplianceEngine(net)
    assert apart(engine.solve(bricks, numbers, Want.ALL), sure) <= 1e-9
    strong = make_engine("discrete", net, "bond=1e12")
    assert apart(strong.solve(bricks, numbers, Want.ALL), sure) <= 1e-6
    assert diagnose(engine, bricks, numbers[0]).finding is Finding.SOLVED_WELL
    near = [(1e14 if shift is None else shift, turn) for shift, turn in ways]
    borne, _ = SoftBodies(scene, bricks).solve(grips, hands_of(near), np.zeros((3, 3)))
    alone = len({n // 2 for n in grips}) == len(grips)  # else two rigid ones share by another rule
    if alone and grips[0] != 36:
        assert far(sure.grip_force[0], borne[:, :3]) <= 1e-5


# the rigid limit


@pytest.mark.parametrize("grips", [(3, 20, 33), (34, 35), (22, 23, 46, 47)])
def test_what_softness_changes_falls_as_it_does(arch25, grips):
    """In proportion to 1/k down to 1e15 N/m.

    Where two hold one brick, both bear as much along it however stiff they are: rigid grips take
    what reaches their own nodes, and there only the rest is compared.
    """
    held = np.array([grips])
    rigid = make_engine("compliance", arch25).solve(24, held, Want.ALL)
    scale = {n: np.abs(getattr(rigid, n)).max() for n in NAMES}
    found = {}
    for k in 10.0 ** np.arange(10, 16):
        soft = make_engine("compliance", arch25.with_grips(k)).solve(24, held, Want.ALL)
        names = ["displacement", "support", "joint_wrench"]
        names += ["edge_force", "grip_force"] if len(grips) == 3 else []
        found[k] = np.array(
            [k * np.abs(getattr(soft, n) - getattr(rigid, n)).max() / scale[n] for n in names]
        )
    for k in 10.0 ** np.arange(11, 16):
        assert found[k] == pytest.approx(found[1e11], rel=2e-2)
        assert found[k] == pytest.approx(found[1e15], rel=4e7 / k * 10 + 1e-3)


def test_two_on_one_brick_share_by_their_stiffness(arch25):
    """Along it; and to all digits also where they are nearly rigid."""
    for size in (1e5, 1e9, 1e13, 1e15):
        scene = robots(arch25, (size / 3, None), (size, None))
        net = build_network(scene)
        grips = scene.grip_numbers((22, 23))
        engine = ComplianceEngine(net)
        force = engine.solve(18, [grips]).grip_force[0]
        axis = net.edge_axis[np.flatnonzero((net.edge_spring < 0) & (net.edge_brick == 11))[0]]
        first, second = force @ axis
        assert second == pytest.approx(3 * first, rel=1e-9)
        columns = grip_columns(net, 18, [grips])
        sure = solve_mixed(net, 18, columns, read_compliance(net, columns, [grips], None))
        assert force == pytest.approx(sure.grip_force[0], rel=1e-9, abs=1e-7)


def test_moving_two_apart_pulls_at_both(arch25):
    """What a rigid pair ignores stretches the springs of a soft one: k/2 times the way."""
    net = build_network(arch25.with_grips(1e6))
    axis = net.edge_axis[np.flatnonzero((net.edge_spring < 0) & (net.edge_brick == 11))[0]]
    moved = np.zeros((1, 2, 3))
    moved[0, 1] = 1e-4 * axis
    engine = ComplianceEngine(net)
    still, pulled = (engine.solve(18, [[22, 23]], Want.ALL, m).grip_force[0] for m in (None, moved))
    shared = np.diff((pulled - still) @ axis)
    assert shared == pytest.approx([1e6 * 1e-4], rel=1e-9)


# what is asked, and refused


def test_turning_is_a_hold_of_its_own():
    """One grip that lets nothing turn holds a brick that two others leave turning."""
    scene = replace(six_bricks("V"), joints=())
    free, firm = (build_network(scene.with_grips(1e6, turn)) for turn in (None, 1e4))
    for name in ("compliance", "frame", "discrete"):
        with pytest.raises(MechanismError, match="motion of brick 2"):
            make_engine(name, free).solve(2, [[3]])
        found = make_engine(name, firm).solve(2, [[3]], Want.ALL)
        weight = np.linalg.norm(free.weight[1])
        assert np.linalg.norm(found.grip_force) == pytest.approx(weight, rel=1e-4)
        assert np.abs(found.grip_moment).max() > 0


def test_numbers_of_grips_that_there_are_not(arch25):
    scene = robots(arch25, (1e6, None), (None, None))
    engine = make_engine("compliance", scene)
    first, second = scene.grip_numbers((7, None)), scene.grip_numbers((None, 7))
    assert first == (7,)
    assert second != first
    for wrong in (0, second[0] + 100, -1, 60 + second[0] - first[0]):
        with pytest.raises(GripError, match="grip on node"):
            engine.solve(10, [[wrong]])
    with pytest.raises(GripError, match="a node is held twice"):
        engine.solve(10, [[*first, *second]])


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"stiffness": 0.0}, "robot a: stiffness is 0.0; give one number or three, 0.001 to 1e"),
        ({"stiffness": "soft"}, "stiffness is 'soft'"),
        ({"stiffness": (1e6, 1e6)}, "stiffness is"),
        ({"stiffness": np.inf}, "N/m, or none if rigid"),
        ({"stiffness": True}, "stiffness is True"),
        ({"rotational_stiffness": -1.0}, "rotational_stiffness is -1.0.*or none if its node may"),
        ({"rotational_stiffness": 1e16}, "rotational_stiffness is"),
    ],
)
def test_wrong_stiffness_is_a_line(given, named):
    with pytest.raises(SceneError, match=named):
        seqopt.Robot(name="a", payload=1.0, **given)
