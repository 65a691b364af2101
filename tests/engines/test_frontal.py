"""Large structures by blocks that the build leaves behind, against one factorization per set."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from experiments.harness.scenes import grip_sets, half_circle
from seqopt.engines.interface import Want, grip_columns, read_compliance
from seqopt.engines.rigid import _growth as growth
from seqopt.engines.rigid import _refinement as refinement
from seqopt.engines.rigid import compliance
from seqopt.engines.rigid import compliance as trial
from seqopt.engines.rigid._frontal import FrontalFactor, FrontalSystem
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._mixed import LAST_CORRECTION, solve_mixed
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid._refinement import Refinement
from seqopt.engines.rigid.compliance import _LARGE, ComplianceEngine
from seqopt.errors import MechanismError, SolverError
from seqopt.network.build import build_network
from seqopt.scene.parts import Load
from tests.builders import apart, hinged, running_bond, solve_batch
from tests.strategies import arches, both_sided, walls


def loaded(scene):
    """Loads that begin late, on bricks passed long before, wind, and ground that sinks."""
    last = scene.build_order[-1]
    late = Load(brick=2, force=(3.0, 0.0, -50.0), since=last)
    loads = (late, Load(brick=3, force=(0.0, 8.0, 0.0)))
    sinks = replace(scene.grounds[0], movement=(1e-4, 0.0, -2e-4))
    return replace(scene, loads=loads, wind=(0.1, 0.2, 0.0), grounds=(sinks, *scene.grounds[1:]))


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
        own = scene.joints[joint]
        turns = tuple(softer * k for k in own.rotational_stiffness)
        joints = (*scene.joints[:joint], replace(own, rotational_stiffness=turns))
        network = build_network(replace(scene, joints=(*joints, *scene.joints[joint + 1 :])))
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


@pytest.mark.parametrize("count", [60])
def test_an_arch_that_closes_keeps_its_digits(count, monkeypatch):
    """What a loop takes away is a million times what it leaves; summed again it does not show."""

    def worst(net):
        operator = OperatorBuilder(net, grow_tree(net)).operator(count)
        columns = np.array([[2 * count - 1, 2 * count - 3, i] for i in range(0, count, 5)])
        fields, _ = solve_batch(operator, columns, Want.ALL)
        return error(fields, solve_mixed(net, count, columns)).max()

    net = half_circle(count)
    assert worst(net) <= 1e-10
    better = worst(net)
    monkeypatch.setattr(growth, "_TAKEN", np.inf)
    assert worst(net) > 3 * better  # negative control


@pytest.mark.parametrize(("columns", "courses"), [(2, 30), (9, 9)])
def test_walls_agree_with_the_mixed_system(columns, courses):
    net = build_network(running_bond(columns, courses))
    total = columns * courses
    for bricks in (total // 2 + 1, total):
        sets = grip_sets(net, bricks, 12)
        operator = OperatorBuilder(net, grow_tree(net)).operator(bricks)
        places = grip_columns(net, bricks, sets)
        fields, trusted = solve_batch(operator, places, Want.ALL)
        assert trusted.all()
        assert error(fields, solve_mixed(net, bricks, places)).max() <= 1e-11


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
    assert builder.operator(total - 2, held).bricks == total - 2
    assert builder.growth.bricks == total - 2
