"""Every engine keeps the interface, and says what is loose."""

from contextlib import nullcontext, suppress
from dataclasses import replace

import numpy as np
import pytest

from experiments.harness.scenes import grip_sets
from seqopt.contact.mortar import DRY, EPOXY, BedStiffness, Mortar, find_elastic_limits
from seqopt.engines.diagnosis import Finding, diagnose
from seqopt.engines.discrete import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import _NAMES, Want, grip_columns
from seqopt.engines.registry import ENGINES, REASONS, AutoEngine
from seqopt.engines.rigid import _refinement as refinement
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._mixed import require_resistance, solve_mixed
from seqopt.engines.rigid._operator import OperatorBuilder, grip_forces, well_conditioned
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import GripError, MechanismError, SceneError, SolverError
from seqopt.network.network import build_network
from seqopt.responses.table import step_fields
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import sequential
from seqopt.study import STUDY_BED
from tests.builders import (
    all_nodes,
    block,
    branch,
    from_both_sides,
    hinged,
    largest_difference,
    on_soft_ground,
    running_bond,
    six_bricks,
    small_arch,
    solve_batch,
    torsion_free,
)
from tests.direct_solve import solve_dense
from tests.limit_scenes import chain
from tests.reference_chain import solve_exactly


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
        step_fields(DiscreteEngine(network, replace(DRY, friction=0.466)), step)
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


# what is loose, nearly loose or badly held is answered for many grip sets together
NONE = np.zeros((1, 0), dtype=int)
TWISTED = 12  # the joint of arch25 that acts from 14 bricks on


def apart(fields, others):
    """The largest difference of each set and field, relative to its largest entry."""
    worst = 0.0
    for name in _NAMES:
        a, b = (getattr(f, name).reshape(len(f.grip_force), -1) for f in (fields, others))
        size = np.abs(b).max(axis=1, initial=1e-300)
        worst = max(worst, (np.abs(a - b).max(axis=1, initial=0) / size).max())
    return worst


# a loose joint, an island
def test_a_torsion_free_joint_matters_only_where_it_acts(arch25, engine25, monkeypatch):
    monkeypatch.setattr(refinement, "Refinement", None)  # nothing is corrected
    engine = ComplianceEngine(build_network(torsion_free(arch25, TWISTED)))
    for bricks in (1, 7, TWISTED + 1):
        sets = grip_sets(engine.network, bricks, 20) if bricks > 1 else NONE
        mine, whole = (e.solve(bricks, sets, Want.ALL) for e in (engine, engine25))
        assert apart(mine, whole) <= 1e-12
    with pytest.raises(TypeError):
        engine.solve(TWISTED + 2, NONE)


@pytest.mark.parametrize(("kind", "bricks"), [("hinge", 14), ("island", 14), ("island", 25)])
def test_sets_together_agree_with_sets_on_their_own(arch25, kind, bricks):
    """Every set that is a mechanism is called one, every other one answered alike."""
    scene = {
        "hinge": hinged(arch25, 3),
        "island": replace(arch25, joints=arch25.joints[:11] + arch25.joints[12:]),
    }[kind]
    net = build_network(scene)
    engine, sound = ComplianceEngine(net), []
    sets = [*grip_sets(net, bricks, 25), (21, 24, 26), (24, 26, 27), (25, 26, 27)]
    for grips in sets:
        row = grip_columns(net, bricks, [grips])
        try:
            require_resistance(net, bricks, row[0])
            solve_mixed(net, bricks, row)
        except MechanismError:
            with pytest.raises(MechanismError):
                engine.solve(bricks, [grips])
        else:
            sound.append(grips)
    assert sound
    alone = solve_mixed(net, bricks, grip_columns(net, bricks, sound))
    assert apart(engine.solve(bricks, sound, Want.ALL), alone) <= 1e-9
    assert bricks == 25 or len(sound) < len(sets)


def test_an_unloaded_mechanism_is_found():
    """Bricks in line beyond a torsion-free joint have no reason to turn, and nothing to stop them.

    Grips on that line do not keep them either; one beside it does.
    """
    shape = ArchShape(pitch=np.full(4, 0.3), pattern="V", closed=False)
    engine = ComplianceEngine(build_network(torsion_free(arch_scene(shape), 1)))
    for grips in ([[]], [[7]], [[5, 6, 7]]):
        with pytest.raises(MechanismError, match="nothing resists"):
            engine.solve(4, np.array(grips, dtype=int).reshape(1, -1))
    beside = replace(shape, pattern="VVVL")
    engine = ComplianceEngine(build_network(torsion_free(arch_scene(beside), 1)))
    assert np.isfinite(engine.solve(4, [[7]]).displacement).all()


def test_a_scene_that_is_loose_from_its_first_brick():
    """Ground that does not resist turning: no operator at any brick count."""
    scene = on_soft_ground(six_bricks(), 0.0)
    net = build_network(scene)
    assert len(grow_tree(net).spring) == 0
    engine = ComplianceEngine(net)
    for bricks, grips in ((1, []), (3, [3])):
        with pytest.raises(MechanismError):
            engine.solve(bricks, np.array(grips, dtype=int).reshape(1, -1))
    sets = [(3, 5), (2, 9), (11, 6)]
    alone = solve_mixed(net, 6, grip_columns(net, 6, sets))
    assert apart(engine.solve(6, sets, Want.ALL), alone) <= 1e-9


# grip sets that the operator alone does not answer well enough
def test_close_grips_on_a_long_chain_are_corrected_together(monkeypatch):
    for alone in ("solve_mixed", "require_resistance"):  # no set is looked at on its own
        monkeypatch.setattr(refinement, alone, None)
    net, count, tip = build_network(chain(75)), 75, 149
    sets = [(tip, tip - 1, tip - 2), (tip, tip - 2, tip - 4), (tip - 1, tip - 2, tip - 3)]
    engine = ComplianceEngine(net)
    columns = grip_columns(net, count, sets)
    _, trusted = solve_batch(engine._operator(count, columns), columns)
    assert not trusted.any()
    fields = engine.solve(count, sets, Want.ALL)
    for row, places in enumerate(columns):
        exact = solve_exactly(net, count, places)
        moved = fields.displacement[row, net.inner.ravel()]
        assert np.abs(moved - exact.displacement).max() <= 1e-12 * np.abs(exact.displacement).max()


# every brick held at both nodes
@pytest.mark.parametrize("bricks", [1, 6])
def test_every_brick_held_at_both_nodes(bricks):
    """Nothing moves and no joint carries: sound, however rounding compares with itself."""
    scene = replace(six_bricks(), blocked_nodes=())
    net = build_network(scene)
    for held in (net, build_network(hinged(scene, 2))):
        sets = all_nodes(held, bricks)
        columns = grip_columns(held, bricks, sets)
        answers = [
            solve_mixed(net, bricks, columns),
            ComplianceEngine(held).solve(bricks, sets, Want.ALL),
            FrameEngine(held).solve(bricks, sets),
        ]
        weight = np.linalg.norm(net.weight[:bricks], axis=1).sum()
        for fields in answers:
            assert fields.grip_force.sum(axis=(0, 1)) == pytest.approx([0, 0, weight], abs=1e-9)
            assert np.abs(fields.joint_wrench).max() <= 1e-9 * weight
            assert np.abs(fields.displacement).max() <= 1e-12
        for source in (held, ComplianceEngine(held), FrameEngine(held)):
            assert diagnose(source, bricks, sets[0]).finding is Finding.SOLVED_WELL


# soft ground
@pytest.mark.parametrize("turning", [1e-2, 1e-9])
@pytest.mark.parametrize("grips", [(), (10, 17)])
def test_soft_ground_is_no_mechanism(arch25, turning, grips):
    """It is answered well, or refused as too much for double precision, by every route."""
    net = build_network(on_soft_ground(arch25, turning))
    columns = grip_columns(net, 10, np.array([grips], dtype=int).reshape(1, -1))
    require_resistance(net, 10, columns[0])
    for source in (net, ComplianceEngine(net), FrameEngine(net)):
        assert diagnose(source, 10, grips).finding is not Finding.MECHANISM
    for solve in (ComplianceEngine(net).solve, FrameEngine(net).solve):
        with suppress(SolverError) if len(grips) < 2 else nullcontext():
            solve(10, np.array([grips], dtype=int).reshape(1, -1))
    with suppress(SolverError):
        solve_dense(net, 10, columns)


def test_ground_that_does_not_resist_is_a_mechanism(arch25):
    """Negative control: the same without any stiffness."""
    net = build_network(on_soft_ground(arch25, 0.0))
    for engine in (ComplianceEngine(net), FrameEngine(net)):
        with pytest.raises(MechanismError):
            engine.solve(3, [[4]])
        assert diagnose(engine, 3, [4]).finding is Finding.MECHANISM


def test_a_single_brick_on_soft_ground_is_answered():
    """The weight over the softness: 2.4e-6 N m/rad against an arm of a tenth of a meter."""
    net = build_network(block(lean=0.3, rotational_stiffness=(2.4e-6, 2.4e-6, 2.4e-6)))
    twist = ComplianceEngine(net).solve(1, NONE, Want.BRICKS).brick_twist[0, 0]
    arm = net.centroid[0] - net.springs.position[0]
    assert twist[3:] == pytest.approx(np.cross(arm, net.weight[0]) / 2.4e-6, rel=1e-9, abs=1e-3)


# the compliance operator and its grips' equations against solving each structure directly
SCENES = {
    "arch": small_arch(5),
    "wall": running_bond(3, 3),
    "both sides": from_both_sides(6, "VLR"),
    "branch": branch(),
}


def unequal(scene):
    """The scene with joints of which no two are alike, in no two directions."""
    joints = [
        replace(
            joint,
            translational_stiffness=(1e8 + 1e6 * i, 2e8 + 3e6 * i, 5e8),
            rotational_stiffness=(1e6 + 1e4 * i, 3e6, 4e6 + 2e4 * i),
        )
        for i, joint in enumerate(scene.joints)
    ]
    return replace(scene, joints=tuple(joints))


def free_nodes(scene, bricks):
    nodes = [node for brick in scene.placed[:bricks] for node in brick.nodes]
    return [node for node in nodes if node not in scene.blocked_nodes]


def sets_of(scene, bricks, grips, count=4):
    """Sets of free nodes, among them those of the last bricks, where two share a brick."""
    free = free_nodes(scene, bricks)
    rng = np.random.default_rng(10 * bricks + grips)
    drawn = [rng.choice(free, grips, replace=False) for _ in range(count)]
    return np.array([*drawn, free[:grips], free[-grips:]]) if grips else np.zeros((1, 0), int)


@pytest.mark.parametrize("grips", [0, 2, 4])
@pytest.mark.parametrize("name", SCENES)
def test_every_field_is_that_of_a_direct_solve(name, grips):
    """At every brick count: what closes loops is there or not, ends carry or do not yet."""
    scene = unequal(SCENES[name])
    net = build_network(scene)
    builder = OperatorBuilder(net, grow_tree(net))
    for bricks in range(1, len(scene.bricks) + 1):
        if len(free_nodes(scene, bricks)) < grips:
            continue
        columns = grip_columns(net, bricks, sets_of(scene, bricks, grips))
        fields, trusted = solve_batch(builder.operator(bricks), columns, Want.ALL)
        direct = solve_dense(net, bricks, columns)
        assert trusted.all()
        for field in _NAMES:
            own, other = getattr(fields, field), getattr(direct, field)
            unit = 1e-8 if field in ("displacement", "brick_twist") else 1.0  # what 1 N moves
            gap = np.abs(own - other).max(initial=0)
            assert gap <= 1e-9 * np.abs(other).max(initial=unit), (bricks, field)


def test_only_what_is_wanted_is_computed():
    net = build_network(small_arch(5))
    engine = ComplianceEngine(net)
    whole = engine.solve(5, [[3, 7]], Want.ALL)
    fields = {
        Want.EDGES: "edge_force",
        Want.DISPLACEMENTS: "displacement",
        Want.SUPPORT: "support",
        Want.JOINTS: "joint_wrench",
        Want.BRICKS: "brick_twist",
    }
    for want in fields:
        part = engine.solve(5, [[3, 7]], want)
        same(part.grip_force, whole.grip_force)
        for other, name in fields.items():
            if other is want:
                same(getattr(part, name), getattr(whole, name))
            else:
                assert getattr(part, name).shape[1] == 0


def same(part, whole):
    np.testing.assert_allclose(part, whole, rtol=0, atol=1e-12 * np.abs(whole).max())


def eliminated(matrix):
    """The pivots of a matrix, from the first unknown to the last."""
    left, pivots = matrix.copy(), []
    while len(left):
        pivots.append(left[0, 0])
        left = left[1:, 1:] - np.outer(left[1:, 0], left[0, 1:]) / left[0, 0]
    return np.array(pivots)


@pytest.mark.parametrize("grips", [(3,), (2, 7, 9)])
def test_what_rounding_may_change_grips_forces_by(grips):
    """Of each displacement the digits that are lost, over what is left to tell the force by."""
    net = build_network(unequal(small_arch(5)))
    operator = OperatorBuilder(net, grow_tree(net)).operator(5)
    rng = np.random.default_rng(0)
    operator = replace(operator, loss=rng.uniform(1.0, 9.0, len(operator.loss)))
    columns = np.array([grips])
    index = operator.load_index(columns)
    found = grip_forces(operator, columns, index)
    part, loss = operator.flexibility[np.ix_(index[0], index[0])], operator.loss[index[0]]
    own, size, dead = (
        np.diag(part),
        np.abs(found.force[0]),
        np.abs(operator.dead_displacement[index[0]]),
    )
    left = eliminated(part)
    sums = [
        sum(np.sqrt(own[i] * loss[i] * own[j] * loss[j]) * size[j] for j in range(len(own)))
        + dead[i] * loss[i]
        for i in range(len(own))
    ]
    doubt = (sums / left).max() / size.max()
    assert found.lowest == pytest.approx([(left / own).min()], rel=1e-9)
    for most, stands in ((doubt * (1 - 1e-9), False), (doubt * (1 + 1e-9), True)):
        assert well_conditioned(operator.doubts, index, found, most).tolist() == [stands]
    for lowest in (-1.0, 0.0, np.nan):  # not definite: nothing is known of the error
        pivot = found.pivot.copy()
        pivot[-1] = lowest
        found = found._replace(pivot=pivot)
        assert not well_conditioned(operator.doubts, index, found, 1e300).any()
