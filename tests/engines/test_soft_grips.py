"""Grips that give way, against a dense solver of rigid bodies that are held by springs."""

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.arms import _permits
from seqopt.engines.diagnosis import Finding, diagnose
from seqopt.engines.interface import Want, grip_columns, read_compliance
from seqopt.engines.registry import engine_for, make_engine
from seqopt.engines.rigid._mixed import solve_mixed
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import GripError, MechanismError, SceneError
from seqopt.network.network import build_network
from tests.arms.scenes import compliances, with_joints
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
    return [net.node_name.index(n) for b in net.scene.placed[:bricks] for n in b.nodes]


def drawn_state(arch, i):
    """A random state: scene, brick count, grips, stiffness of hands, and how far they are moved.

    Grips are nodes, and the numbers by which engines know them.
    """
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
    hands = hands_of([(shift, turn)] * len(nodes))
    return scene.with_grips(shift, turn), bricks, (nodes, nodes), hands, moved


def drawn_jacobians(rng, scene, robots, joints=6):
    """How nodes move with joints about axes through random points a meter or so away."""
    nodes = len(scene.brick_of_node)
    axes = rng.normal(size=(robots, nodes, 3, joints))
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    away = rng.normal(size=(robots, nodes, 3, joints))
    return np.concatenate([np.cross(axes, away, axis=2), axes], axis=2)


def drawn_joints(arch, i):
    """The same of arms whose joints give way, and hands beside them; compliances for stiffness."""
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
    scene = with_joints(scene, stiffness[:robots], jacobians, hands[:robots])
    return scene, bricks, (nodes, scene.grip_numbers(nodes)), compliances(scene, nodes), moved


def agree_with_dense(state):
    """The largest relative difference of a state's forces, moments and displacements."""
    scene, bricks, (nodes, numbers), hands, moved = state
    borne, shifts = SoftBodies(scene, bricks).solve(nodes, hands, moved)
    net, given = build_network(scene), moved[None] if moved.any() else None
    found = ComplianceEngine(net).solve(bricks, [numbers], Want.ALL, given)
    own = found.displacement[0, inner_nodes(net, bricks)]
    moment = found.grip_moment[0] if found.grip_moment.size else np.zeros((len(nodes), 3))
    pairs = ((found.grip_force[0], borne[:, :3]), (moment, borne[:, 3:]), (own, shifts))
    return max(far(*pair) for pair in pairs)


@pytest.mark.parametrize("draw", [drawn_state, drawn_joints])
@pytest.mark.parametrize("i", range(0, STATES, 45))
def test_a_dense_solver_agrees(arch25, draw, i):
    assert agree_with_dense(draw(arch25, i)) <= 1e-9


def test_the_dense_solver_would_notice(arch25):
    """Negative control: a tenth softer, moved a tenth less, or no give across the axes of hands."""
    for (scene, bricks, (nodes, _), hands, moved), across in (
        (drawn_state(arch25, 1), False),
        (drawn_joints(arch25, 1), True),
    ):
        solver, others = SoftBodies(scene, bricks), [[0.9 * np.array(each) for each in hands]]
        right = solver.solve(nodes, hands, moved)[0]
        others += [[np.diag(np.diag(each)) for each in hands]] if across else []
        assert all(far(solver.solve(nodes, own, moved)[0], right) > 1e-3 for own in others)
        assert far(solver.solve(nodes, hands, 0.9 * moved)[0], right) > 1e-3


WAYS = {
    "alike": [(1e6, None)] * 3,
    "turning": [(1e6, 1e4)] * 3,
    "each its own": [(3e6, None), (1e6, 2e4), (1e5, None)],
    "by axis": [((1e5, 1e6, 1e7), None)] * 3,
}


@pytest.mark.parametrize(("grips", "moved"), [((3, 8, 11), 1e-8), ((4, 5, 9), 0.0)])
@pytest.mark.parametrize("ways", WAYS)
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


# grips that give way as the joints of an arm do: full compliances against a dense solver
@pytest.mark.parametrize("turn", [None, 1e5])
@pytest.mark.parametrize("grips", [(3, 8, 11), (4, 5, 9)])
def test_engines_agree_with_joints(grips, turn):
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
        assert far(found.displacement[0, inner_nodes(net, 6)], shifts) <= close


def test_a_posture_that_there_is_not_is_a_line(arch25):
    jacobians = drawn_jacobians(np.random.default_rng(1), arch25, 2)
    scene = with_joints(arch25, np.full((2, 6), 1e6), jacobians, without=[(1, 4)])
    node = sorted(arch25.brick_of_node)[4]
    engine = make_engine("compliance", scene)
    said = f"robot r1 has no posture at node {node}, so the compliance of its grip is not known"
    with pytest.raises(GripError, match=said):
        engine.solve(20, [scene.grip_numbers((3, node))])
    assert engine.solve(20, [scene.grip_numbers((node, 3))]).grip_force.all()
    assert scene.held_postures.row(1, node) == -1 != scene.held_postures.row(0, node)


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
