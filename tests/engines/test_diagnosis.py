"""What is nearly loose is solved or refused; large structures by blocks of the stiffness."""

from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

import seqopt
from experiments.harness.scenes import half_circle
from seqopt.engines.diagnosis import _LEAST_DIAGONAL, UNRESISTED, WELL, Finding, _spectrum, diagnose
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want, grip_columns, read_compliance
from seqopt.engines.rigid import _growth as growth
from seqopt.engines.rigid import _mixed as mixed
from seqopt.engines.rigid import _refinement as refinement
from seqopt.engines.rigid import compliance
from seqopt.engines.rigid import compliance as trial
from seqopt.engines.rigid._frontal import FrontalFactor, FrontalSystem
from seqopt.engines.rigid._growth import Growth, grow_tree
from seqopt.engines.rigid._mixed import (
    LAST_CORRECTION,
    add_products,
    held_rows,
    solve_mixed,
    ungripped_system,
)
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid._refinement import Refinement
from seqopt.engines.rigid.compliance import _EVEN, _LARGE, ComplianceEngine, _cancels
from seqopt.errors import MechanismError, SolverError
from seqopt.network.network import build_network
from seqopt.scene.parts import Load
from tests.builders import (
    apart,
    from_both_sides,
    hinged,
    running_bond,
    six_bricks,
    solve_batch,
    with_part,
)
from tests.limit_scenes import HELD, LOOSE_AT, chain, loosened, without_joint
from tests.reference_chain import solve_exactly
from tests.strategies import arches, both_sided, walls


def places(net, bricks, grips):
    return grip_columns(net, bricks, np.array(grips, dtype=int).reshape(1, -1))[0]


class Spoiled:
    """An engine whose answers are another engine's after a change."""

    def __init__(self, engine, change):
        self.engine, self.change, self.network = engine, change, engine.network

    def solve(self, bricks, grips, want):
        return self.change(self.engine.solve(bricks, grips, want))


@pytest.mark.parametrize("grips", [(), (20, 48, 33)])
def test_the_published_arch_is_solved_well(engine25, grips):
    for source in (engine25, engine25.network):
        told = diagnose(source, 25, grips)
        assert told.finding is Finding.SOLVED_WELL
        assert told.backward_error <= WELL
        assert told.smallest_eigenvalue > 1e-6
        assert np.abs(told.mode).max() == 1


@pytest.mark.parametrize("name", ["brick_twist", "joint_wrench", "grip_force"])
def test_spoiled_fields_are_seen(engine25, name):
    """Negative control: one entry of one field off by a millionth of the largest."""

    def change(fields):
        values = getattr(fields, name).copy()
        values.reshape(-1)[np.abs(values).argmax()] *= 1 + 1e-6
        return replace(fields, **{name: values})

    told = diagnose(Spoiled(engine25, change), 17, [20, 33])
    assert told.finding is Finding.ILL_CONDITIONED
    assert 1e-8 < told.backward_error < 3e-6
    assert "do not solve the equations" in told.reason


def test_the_smallest_eigenvalue_is_that_of_the_dense_matrix():
    net = build_network(running_bond(3, 3))
    grips = places(net, 9, [13, 18])
    parts = ungripped_system(net, 9)
    dense = parts.deformation.toarray()
    matrix = dense.T * parts.stiffness @ dense
    scale = np.sqrt(np.maximum(matrix.diagonal(), _LEAST_DIAGONAL * matrix.diagonal().max()))
    null = np.linalg.svd(held_rows(parts, grips).rows / scale)[2][6:].T
    values, vectors = np.linalg.eigh(null.T @ (matrix / scale / scale[:, None]) @ null)
    lowest, condition, mode = _spectrum(net, 9, grips)
    assert lowest == pytest.approx(values[0], rel=1e-6)
    assert condition >= 0.99 * values[-1] / values[0]
    want = null @ vectors[:, 0] / scale
    want = want / want[np.abs(want).argmax()]
    assert mode.ravel() == pytest.approx(want, abs=1e-4)
    assert held_rows(parts, grips).rows @ mode.ravel() == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("grips", [(), (48, 49)])
def test_a_missing_joint_is_a_mechanism_beyond_it(grips):
    net = without_joint(chain(25))
    for engine in (ComplianceEngine(net), FrameEngine(net)):
        told = diagnose(engine, 25, grips)
        assert told.finding is Finding.MECHANISM
        assert told.residuals is None
        assert told.backward_error == np.inf
        assert np.abs(told.mode[: LOOSE_AT + 1]).max() < 1e-6
        assert np.abs(told.mode[LOOSE_AT + 1 :]).max() == 1
    assert told.smallest_eigenvalue < UNRESISTED


@pytest.mark.slow
def test_nearly_loose_is_solved_or_refused_never_wrong():
    seen = set()
    for factor in (*(10.0**-power for power in range(0, 18, 6)), 0.0):
        for grips in ([], [49], [30, 49], HELD):
            net = build_network(loosened(chain(25), factor, only_turning=False))
            told = diagnose(ComplianceEngine(net), 25, grips)
            seen.add(told.finding)
            if told.residuals is not None:
                fields = ComplianceEngine(net).solve(25, [grips], Want.DISPLACEMENTS)
                exact = solve_exactly(net, 25, places(net, 25, grips)).displacement
                got = fields.displacement[0, net.inner.ravel()]
                assert np.abs(got - exact).max() <= 1e-9 * np.abs(exact).max()
            elif told.finding is Finding.ILL_CONDITIONED:
                assert told.condition > 1e10
                assert "refused" in told.reason
    assert seen == set(Finding)


@pytest.mark.slow
def test_a_long_chain_is_solved_well():
    told = diagnose(build_network(chain(1500)), 1500, [])
    assert told.finding is Finding.SOLVED_WELL
    assert told.backward_error < 1e-14
    assert told.condition > 1e12
    assert np.abs(told.mode).max(axis=1).argmax() == 1499
    engine = ComplianceEngine(build_network(chain(338)))
    assert diagnose(engine, 338, [675]).finding is Finding.SOLVED_WELL


@pytest.mark.parametrize("contrast", [1e2, 1e12])
def test_a_frame_at_a_bad_contrast_is_seen(contrast):
    told = diagnose(FrameEngine(build_network(chain(2)), contrast), 2, [3])
    assert told.finding is Finding.ILL_CONDITIONED
    assert told.backward_error > 1e-5
    assert told.condition < 1e3  # it is the frame, not the structure


def test_a_frame_is_corrected_as_long_as_that_helps():
    """Three corrections were not enough, and at another contrast none are: the control."""
    net, none = build_network(chain(100)), np.zeros((1, 0), dtype=int)
    exact = ComplianceEngine(net).solve(100, none).displacement
    found = FrameEngine(net).solve(100, none).displacement
    assert np.abs(found - exact).max() <= 2e-6 * np.abs(exact).max()
    with pytest.raises(SolverError, match="too ill-conditioned"):
        FrameEngine(net, 1e11).solve(100, none)


# exactly rigid bricks where joints are loose, chains long and systems small or not positive
EPS = np.finfo(float).eps
KINDS = ("translational_stiffness", "rotational_stiffness")
FIELDS = ("edge_force", "displacement", "grip_force", "support")
BEYOND = [(43,), (31,), (13, 45)]  # the loose joint, which is between bricks 12 and 13


def off(net, columns, fields, row=0):
    """The largest difference from sixty digits, relative to the largest of each field."""
    exact = solve_exactly(net, len(net.inner), columns)
    wrench, nodes = fields.joint_wrench[row], net.inner.ravel()
    pairs = (
        (fields.displacement[row, nodes], exact.displacement),
        (wrench[:, :3], exact.joint_wrench[:, :3]),
        (wrench[:, 3:], exact.joint_wrench[:, 3:]),
    )
    return max(np.abs(a - b).max() / np.abs(b).max() for a, b in pairs)


@pytest.mark.parametrize("only_turning", [True, False])
@pytest.mark.parametrize("factor", [1e-3, 1e-15])
def test_grips_beyond_a_loose_joint(factor, only_turning):
    """The force method alone loses every digit here and says nothing: the second assertion."""
    net = build_network(loosened(chain(25), factor, only_turning=only_turning))
    sets = [HELD, (30, 37, 49), (3, 8, 10)]
    fields = ComplianceEngine(net).solve(25, sets, Want.ALL)
    columns = grip_columns(net, 25, np.array(sets))
    assert max(off(net, own, fields, row) for row, own in enumerate(columns)) <= 1e-9
    operator = OperatorBuilder(net, grow_tree(net)).operator(25)
    for accuracy in (1e-9, 1e-6):
        fields, trusted = solve_batch(operator, columns, Want.ALL, accuracy=accuracy)
        assert trusted[2]
        assert not trusted[:2].any() or factor >= 1e3 * EPS / accuracy
        for row in np.flatnonzero(trusted):
            assert off(net, columns[row], fields, row) <= accuracy


def test_a_batch_of_many_passes(monkeypatch):
    net = build_network(chain(8))
    sets = [(1, 9, 14), (14, 15, 3), (4, 5, 2), (12, 10, 7), (8, 9, 15)]
    whole = ComplianceEngine(net).solve(8, sets, Want.ALL)
    monkeypatch.setattr(trial, "_CHUNK", 2)
    assert apart(ComplianceEngine(net).solve(8, sets, Want.ALL), whole, FIELDS) <= 1e-12


@pytest.mark.parametrize(
    ("scene", "sets"),
    [
        (chain(150), [(296, 297, 299), (297, 298, 299), (297, 299, 295)]),  # close together
        (hinged(chain(100), 50), [(150, 199)]),  # a spring without stiffness leaves no operator
    ],
)
def test_long_chains_keep_their_digits(scene, sets):
    net, count = build_network(scene), len(scene.bricks)
    fields = ComplianceEngine(net).solve(count, sets, Want.ALL)
    for row, columns in enumerate(grip_columns(net, count, np.array(sets))):
        assert off(net, columns, fields, row) <= 1e-12


# when the fast engine's own answers stand, and when they are corrected
def test_nothing_is_corrected_where_joints_are_even(monkeypatch):
    monkeypatch.setattr(refinement, "Refinement", None)
    for scene in (six_bricks(), from_both_sides(5), chain(9)):
        engine, count = ComplianceEngine(build_network(scene)), len(scene.bricks)
        for bricks in (1, 2, count - 1, count, 1):
            node = scene.placed[bricks - 1].placing_node
            assert np.isfinite(engine.solve(bricks, [[node]]).grip_force).all()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("share", "uneven"), [(1.0, False), (_EVEN, False), (0.99 * _EVEN, True), (1.01 / _EVEN, True)]
)
def test_who_looks_for_what_cancels(monkeypatch, kind, share, uneven):
    """Only what has a joint that is far softer or stiffer than others, from where it acts on."""
    scene, looked = from_both_sides(7), []
    monkeypatch.setattr(
        trial, "_cancels", lambda *seen: looked.append(seen[0].maps.bricks) or _cancels(*seen)
    )
    stiff = {"translational_stiffness": (1e8,) * 3, "rotational_stiffness": (1e6,) * 3}
    grounds = tuple(replace(g, **stiff) for g in scene.grounds)
    joints = [replace(j, **stiff) for j in scene.joints]
    size, joint = stiff[kind][0], scene.joints[2]
    joints[2] = replace(joints[2], **{kind: (size, share * size, size)})  # softer in one direction
    even = replace(scene, grounds=grounds, joints=tuple(joints))
    engine = ComplianceEngine(build_network(even))
    for bricks in range(1, len(scene.bricks) + 1):
        engine.solve(bricks, [[scene.placed[bricks - 1].placing_node]])
    acts = 1 + max(scene.build_order.index(brick) for brick in joint.bricks)
    assert looked == ([*range(acts, len(scene.bricks) + 1)] if uneven else [])


# residuals in twice the digits, and what is answered or refused by them on every processor
def exactly(start, matrix, factors):
    """The sums of products as fractions."""
    rows = matrix.toarray()
    return [
        Fraction(a) + sum((Fraction(m) * Fraction(x) for m, x in zip(row, factors, strict=True)))
        for a, row in zip(start.tolist(), rows.tolist(), strict=True)
    ]


@given(st.integers(0, 2**32 - 1), st.integers(0, 7), st.integers(1, 9))
def test_sums_of_products_are_those_of_fractions(seed, width, rows):
    """Though all but sixteen digits cancel."""
    rng = np.random.default_rng(seed)
    dense = rng.normal(size=(rows, width)) * (rng.random((rows, width)) < 0.6)
    matrix, factors = sparse.csr_array(dense), rng.normal(size=width) * 10.0 ** rng.integers(-9, 9)
    start = -(dense @ factors)
    found, wanted = add_products(start, matrix, factors), exactly(start, matrix, factors)
    size = np.abs(dense) @ np.abs(factors) + np.abs(start)
    for one, true, scale in zip(found, wanted, size, strict=True):
        allowed = EPS * abs(true) + Fraction((width + 1) ** 2 * (EPS * EPS) * scale)
        assert abs(Fraction(float(one)) - true) <= allowed


def test_plain_sums_of_products_are_not():
    """The control: a third times three, less one."""
    matrix, third = sparse.csr_array([[3.0, 1e-3]]), np.array([1 / 3, 0.0])
    start = np.array([-1.0])
    (true,) = exactly(start, matrix, third)
    assert abs(true) == Fraction(1, 2**54)
    assert add_products(start, matrix, third)[0] == float(true)
    assert (start + matrix @ third)[0] == 0.0


def spoiled():
    """Sums without the last digit of doubles, another way in each."""
    rng = np.random.default_rng(0)

    def add(start, matrix, factors):
        size = np.abs(start) + abs(matrix) @ np.abs(factors)
        lost = 10 * EPS * size * rng.choice([-1, 1], len(size))
        return add_products(start, matrix, factors) + lost

    return add


def test_corrections_that_stall_refuse(monkeypatch):
    """Sums of doubles refused half of such sets, and others on other processors."""
    hinge = build_network(loosened(chain(25), 1e-8, only_turning=True))
    monkeypatch.setattr(mixed, "add_products", spoiled())
    with pytest.raises(SolverError, match="too close to a mechanism"):
        solve_mixed(hinge, 25, np.array([(43,)]))


@pytest.mark.parametrize(("power", "refused"), [(7, False), (13, True)])
def test_what_last_digits_decide_is_refused(power, refused):
    """How far the part beyond turns about its grips: by moments that are nothing but rounding."""
    net = build_network(loosened(chain(25), 10.0**-power, only_turning=True))
    for held in BEYOND:
        if refused:
            with pytest.raises(SolverError, match="too close to a mechanism"):
                solve_mixed(net, 25, np.array([held]))
        else:
            assert off(net, np.array(held), solve_mixed(net, 25, np.array([held]))) <= 1e-10


# large structures by blocks that the build leaves behind, against one factorization per set
def loaded(scene):
    """Loads that begin late, on bricks passed long before, wind, and ground that sinks."""
    last = scene.build_order[-1]
    late = Load(brick=2, force=(3.0, 0.0, -50.0), since=last)
    loads = (late, Load(brick=3, force=(0.0, 8.0, 0.0)))
    sinks = with_part(scene, "grounds", 0, movement=(1e-4, 0.0, -2e-4))
    return replace(sinks, loads=loads, wind=(0.1, 0.2, 0.0))


SCENES = {
    "vault": lambda: seqopt.load_scene("vault:span=1,rise=0.4,columns=2"),
    "chain": lambda: seqopt.load_scene("chain:bricks=16"),
    "loads": lambda: loaded(seqopt.load_scene("wall:courses=4,columns=4")),
    "soft": lambda: seqopt.load_scene("chain:bricks=16").with_grips(1e6, 1e4),
}
AT_ONCE = 3  # bricks of a block, so that small structures have several


def asked(network, bricks, seed, moved=None):
    """A set at the newest bricks, one anywhere, and one that holds a brick at both of its nodes."""
    rng, numbers = np.random.default_rng(seed), network.scene.placed_nodes[: 2 * bricks]
    nodes = np.array([node for node in numbers if node not in network.scene.blocked_nodes])
    sets = np.array([nodes[-3:-1], rng.choice(nodes, 2, replace=False), numbers[2:4]])
    columns = grip_columns(network, bricks, sets)
    return columns, read_compliance(network, columns, sets, moved)


@pytest.mark.parametrize("name", SCENES)
def test_one_factorization_per_set_agrees(name):
    network = build_network(SCENES[name]())
    system, count = FrontalSystem(network, AT_ONCE), len(network.inner)
    for bricks in (2, 3 * AT_ONCE, count // 2, count, count - 2):  # the last one begins anew
        moved = np.random.default_rng(bricks).normal(size=(3, 2, 3)) * 1e-5
        for far in (None, moved):
            columns, compliance = asked(network, bricks, bricks, far)
            found = system.solve(bricks, columns, compliance, LAST_CORRECTION)
            assert apart(found, solve_mixed(network, bricks, columns, compliance)) < 1e-8
    assert len(system._factor.blocks) > 2


def test_what_blocks_get_wrong_is_corrected_or_refused():
    network = build_network(SCENES["vault"]())
    system, count = FrontalSystem(network, AT_ONCE), len(network.inner)
    columns, compliance = asked(network, count, 0)
    right = system.solve(count, columns, compliance, LAST_CORRECTION)
    blocks = system._factor.blocks
    blocks[0] = blocks[0]._replace(answer=2 * blocks[0].answer)
    assert apart(system.solve(count, columns, compliance, LAST_CORRECTION), right) < 1e-8
    blocks[0] = blocks[0]._replace(carried=3 * blocks[0].carried)
    with pytest.raises(SolverError, match="keep too few digits"):
        system.solve(count, columns, compliance, LAST_CORRECTION)


@pytest.mark.parametrize("softer", [1e-3, 1e-8, 0.0])
def test_what_hardly_holds_is_answered_right_or_not_at_all(softer):
    scene, rng = SCENES["chain"](), np.random.default_rng(0)
    for joint in (2, 9):
        turns = tuple(softer * k for k in scene.joints[joint].rotational_stiffness)
        network = build_network(with_part(scene, "joints", joint, rotational_stiffness=turns))
        system, count = FrontalSystem(network, AT_ONCE), len(network.inner)
        for held in range(3):
            nodes = rng.choice(np.arange(2, 2 * count - 1), held, replace=False)
            columns = grip_columns(network, count - 1, nodes[None])
            own_grips = read_compliance(network, columns, nodes[None], None)
            try:
                right = solve_mixed(network, count - 1, columns, own_grips)
            except (MechanismError, SolverError):
                right = None
            with suppress(SolverError):
                found = system.solve(count - 1, columns, own_grips, LAST_CORRECTION)
                assert right is not None
                assert apart(found, right) < 1e-7


def test_a_mechanism_is_left_to_operators():
    scene = hinged(seqopt.load_scene(f"chain:bricks={_LARGE}"), 4)
    network, free = build_network(scene), np.zeros((1, 0), dtype=int)
    compliance = read_compliance(network, free, free, None)
    with pytest.raises(SolverError):
        FrontalSystem(network).solve(30, free, compliance, LAST_CORRECTION)
    with pytest.raises(MechanismError):
        ComplianceEngine(network).solve(30, free)


@pytest.mark.parametrize(("spoil", "solutions"), [(0.0, 2), (7e-3, 6)])
def test_corrections_end_before_one_that_would_not_count(monkeypatch, spoil, solutions):
    network, calls, solve = build_network(SCENES["chain"]()), [], FrontalFactor.solve
    count = len(network.inner)
    columns, compliance = asked(network, count, 1)

    def spoiled(*arguments):
        calls.append(arguments)
        return tuple(found * (1 + spoil) for found in solve(*arguments))

    monkeypatch.setattr(FrontalFactor, "solve", spoiled)
    found = FrontalSystem(network, AT_ONCE).solve(count, columns, compliance, LAST_CORRECTION)
    assert len(calls) == solutions * len(columns)
    expected = solve_mixed(network, count, columns, compliance)
    assert apart(found, expected) <= 1e-9
    monkeypatch.setattr("seqopt.engines.rigid._frontal._MARGIN", 0.0)  # the control
    found = FrontalSystem(network, AT_ONCE).solve(count, columns, compliance, LAST_CORRECTION)
    assert (apart(found, expected) > 1e-9) == (spoil > 0)


# flexibility that grows in place: order of asking, accuracy, what it keeps, and what it doubts
PER_PAIR = 8 * 36 * 8  # bytes: arrays of bricks by bricks (3) and by springs (2 × 2), and a rest


def error(fields, exact):
    """The largest difference of each set in what tables show, relative to its largest entry."""
    out = np.zeros(len(exact.grip_force))
    for name in ("edge_force", "displacement", "support", "grip_force"):
        a, b = (getattr(f, name).reshape(len(out), -1) for f in (fields, exact))
        out = np.maximum(out, np.abs(a - b).max(axis=1) / np.abs(b).max(axis=1))
    return out


# order of asking
@settings(max_examples=8)
@given(scene=st.one_of(arches(), walls(), both_sided()), data=st.data())
def test_answers_do_not_depend_on_what_was_asked_before(scene, data):
    net = build_network(scene)
    engine = ComplianceEngine(net)
    counts = st.integers(1, len(scene.bricks))
    for bricks in data.draw(st.lists(counts, min_size=1, max_size=6)):
        free = [n for b in scene.placed[:bricks] for n in b.nodes if n not in scene.blocked_nodes]
        sets = [data.draw(st.permutations(free))[: min(2, len(free))]]
        assert engine.solve(bricks, sets, Want.ALL) == ComplianceEngine(net).solve(
            bricks, sets, Want.ALL
        )


# accuracy
def test_an_arch_that_closes_keeps_its_digits(monkeypatch):
    """What a loop takes away is a million times what it leaves; summed again it does not show."""
    net, count = half_circle(60), 60

    def worst(net):
        operator = OperatorBuilder(net, grow_tree(net)).operator(count)
        columns = np.array([[2 * count - 1, 2 * count - 3, i] for i in range(0, count, 5)])
        fields, _ = solve_batch(operator, columns, Want.ALL)
        return error(fields, solve_mixed(net, count, columns)).max()

    assert worst(net) <= 1e-10
    better = worst(net)
    monkeypatch.setattr(growth, "_TAKEN", np.inf)
    assert worst(net) > 3 * better  # negative control


# what is doubted
def hard_sets(bricks, rng, count=150):
    """Three nodes anywhere, near each other, and at the tip with one anywhere."""
    nodes = 2 * bricks
    anywhere = [rng.choice(nodes, 3, replace=False) for _ in range(count)]
    starts = rng.integers(0, nodes - 8, count)
    near = [start + rng.choice(8, 3, replace=False) for start in starts]
    tip = [[nodes - 1, nodes - 3, rng.integers(nodes - 4)] for _ in range(count)]
    rows = np.array([*anywhere, *near, *tip])
    return rows[(np.diff(np.sort(rows // 2, axis=1), axis=1) > 0).all(axis=1)]


CASES = [(half_circle(80), 80), (half_circle(160), 159), (build_network(running_bond(6, 8)), 45)]


@pytest.mark.parametrize(("net", "bricks"), CASES)
def test_no_set_errs_unnoticed(net, bricks):
    columns = hard_sets(bricks, np.random.default_rng(bricks))
    operator = OperatorBuilder(net, grow_tree(net)).operator(bricks)
    exact = Refinement(net, bricks).solve(columns, operator)
    for accuracy in (1e-6, 1e-9, 1e-10):
        fields, trusted = solve_batch(operator, columns, Want.ALL, accuracy=accuracy)
        assert error(fields, exact)[trusted].max(initial=0) <= accuracy
    _, easily = solve_batch(operator, columns, accuracy=1e-6)
    assert easily.mean() >= 0.95  # few are doubted in vain where six digits are enough


def test_sets_that_err_are_there_to_be_noticed(monkeypatch):
    """Negative control: without doubt, answers of a spoiled operator are off and trusted."""
    net, bricks = half_circle(160), 159
    columns = hard_sets(bricks, np.random.default_rng(bricks))
    operator = OperatorBuilder(net, grow_tree(net)).operator(bricks)
    monkeypatch.setattr(trial, "_UNSEEN", 1e-300)
    spoiled = replace(operator, dead_displacement=operator.dead_displacement * (1 + 1e-8))
    fields, trusted = solve_batch(spoiled, columns, Want.ALL, accuracy=1e-10)
    assert trusted.all()
    assert error(fields, Refinement(net, bricks).solve(columns, operator)).max() > 1e-10


def test_a_screen_is_not_corrected_where_six_digits_are_enough(monkeypatch):
    net = half_circle(100)
    tip = [[net.node_name[i] for i in net.inner.ravel()[[197, 195, 193]]]]
    exact = ComplianceEngine(net).solve(99, tip)
    strict = ComplianceEngine(net, accuracy=1e-13).solve(99, tip, Want.RESPONSES | Want.SCREEN)
    monkeypatch.setattr(refinement, "Refinement", None)  # nothing is corrected
    screened = ComplianceEngine(net).solve(99, tip, Want.RESPONSES | Want.SCREEN)
    assert error(screened, exact).max() <= 1e-6
    assert error(strict, exact).max() <= 1e-6
    with pytest.raises(TypeError):
        ComplianceEngine(net).solve(99, tip)


# what is kept
def kept_bytes(net, most=compliance._KEPT):
    """The bytes of all arrays after every brick count was asked for grips at all its nodes."""
    engine = ComplianceEngine(net)
    with patch.object(compliance, "_KEPT", most):
        for bricks in range(1, len(net.inner) + 1):
            known, index = net.index_of_grip
            engine.solve(bricks, known[index < 2 * bricks][:, None], Want.EDGES)
    operators = engine._kept.values()
    growth = engine._builder.growth
    return (
        growth.twist.nbytes + growth.wrench.nbytes + sum(operator.nbytes for operator in operators)
    )


@pytest.mark.parametrize("make", [half_circle, lambda n: build_network(running_bond(n // 8, 8))])
def test_memory_grows_as_the_square_of_the_bricks(make):
    for count in (16, 48):
        assert kept_bytes(make(count), most=0) <= PER_PAIR * count**2 + 2e5


def test_an_operator_per_brick_count_would_be_seen():
    """Negative control: keeping all of them grows as the cube."""
    assert kept_bytes(half_circle(64), most=np.inf) > PER_PAIR * 64**2 + 2e5


def test_a_search_asks_brick_by_brick(monkeypatch):
    """Nothing grows anew but the first two bricks: their steps leave no grip open."""
    added, add = [], Growth._add
    monkeypatch.setattr(Growth, "_add", lambda growth: added.append(add(growth)))
    engine = ComplianceEngine(seqopt.load_scene("arch25"))
    loop = seqopt.three_robot_loop(engine.network)
    problem = seqopt.pose(engine, loop, seqopt.CRITERIA["equations-2-3"])
    seqopt.solve(problem, "cascade", proof=False)
    assert len(added) <= 25 + 2
    engine._builder.growth.reach(25)  # from what was asked last
    assert len(added) > 25 + 2, "what begins anew is seen"


def test_the_last_brick_count_but_one_is_recalled():
    """Loops that closed since are opened again, in some rows alone."""
    scene = running_bond(4, 5)
    net, total, held = build_network(scene), len(scene.bricks), [2, 7, 9]
    for bricks in (10, 13, total - 1):
        builder = OperatorBuilder(net, grow_tree(net))
        builder.growth.remembers = True
        builder.growth.reach(bricks + 1)
        found = builder.operator(bricks, held)
        assert builder.growth.bricks == bricks + 1  # nothing began anew
        fresh = OperatorBuilder(net, grow_tree(net)).operator(bricks, held)
        for name in ("flexibility", "dead_displacement", "twist", "wrench", "loss"):
            a, b = (getattr(each, name) for each in (found, fresh))
            assert np.abs(a - b).max() <= 1e-11 * np.abs(b).max(), name
    assert builder.operator(total - 2, held).maps.bricks == total - 2
    assert builder.growth.bricks == total - 2
