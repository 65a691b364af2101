"""What a diagnosis says of sound; exactly rigid bricks where joints are loose."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from seqopt.engines.diagnosis import _LEAST_DIAGONAL, UNRESISTED, WELL, Finding, _spectrum, diagnose
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.rigid import _mixed as mixed
from seqopt.engines.rigid import _refinement as refinement
from seqopt.engines.rigid import compliance as trial
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._mixed import add_products, held_rows, solve_mixed, ungripped_system
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid.compliance import _EVEN, ComplianceEngine, _cancels
from seqopt.errors import MechanismError, SolverError
from seqopt.network.build import build_network
from tests.builders import apart, from_both_sides, hinged, running_bond, six_bricks, solve_batch
from tests.limit_scenes import HELD, LOOSE_AT, chain, loosened, without_joint
from tests.reference_chain import solve_exactly


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
@pytest.mark.parametrize("share", [1e-6])
def test_spoiled_fields_are_seen(engine25, name, share):
    """Negative control: one entry of one field off by a share of the largest."""

    def change(fields):
        values = getattr(fields, name).copy()
        values.reshape(-1)[np.abs(values).argmax()] *= 1 + share
        return replace(fields, **{name: values})

    told = diagnose(Spoiled(engine25, change), 17, [20, 33])
    assert told.finding is Finding.ILL_CONDITIONED
    assert share / 100 < told.backward_error < 3 * share
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


def test_what_double_precision_cannot_tell_from_a_mechanism_is_refused():
    net = build_network(loosened(chain(25), 1e-13, only_turning=False))
    with pytest.raises((MechanismError, SolverError)) as caught:
        ComplianceEngine(net).solve(25, [[30, 49]])
    if isinstance(caught.value, MechanismError):
        moving = np.array([np.abs(row).max() for _, row in caught.value.mode])
        assert moving[: LOOSE_AT + 1].max() < 1e-6


# when the fast engine's own answers stand, and when they are corrected


def test_nothing_is_corrected_where_joints_are_even(monkeypatch):
    monkeypatch.setattr(refinement, "Refinement", None)
    for scene in (six_bricks(), from_both_sides(5), chain(9)):
        engine, count = ComplianceEngine(build_network(scene)), len(scene.bricks)
        for bricks in (1, 2, count - 1, count, 1):
            node = scene.placed[bricks - 1].placing_node
            assert np.isfinite(engine.solve(bricks, [[node]]).grip_force).all()


def evenly(scene, joint, kind, share):
    """The scene with equal joints, one of which is softer in one direction."""
    stiff = {"translational_stiffness": (1e8,) * 3, "rotational_stiffness": (1e6,) * 3}
    grounds = tuple(replace(g, **stiff) for g in scene.grounds)
    joints = [replace(j, **stiff) for j in scene.joints]
    size = stiff[kind][0]
    joints[joint] = replace(joints[joint], **{kind: (size, share * size, size)})
    return replace(scene, grounds=grounds, joints=tuple(joints))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("share", "uneven"), [(1.0, False), (_EVEN, False), (0.99 * _EVEN, True), (1.01 / _EVEN, True)]
)
@pytest.mark.parametrize("scene", [from_both_sides(7)])
def test_who_looks_for_what_cancels(monkeypatch, scene, kind, share, uneven):
    """Only what has a joint that is far softer or stiffer than others, from where it acts on."""
    looked = []
    monkeypatch.setattr(
        trial, "_cancels", lambda *seen: looked.append(seen[0].bricks) or _cancels(*seen)
    )
    joint = scene.joints[2]
    engine = ComplianceEngine(build_network(evenly(scene, 2, kind, share)))
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


@pytest.fixture(scope="module")
def hinge():
    """A chain of which one joint has 1e-8 of the others' stiffness in turning."""
    return build_network(loosened(chain(25), 1e-8, only_turning=True))


@pytest.mark.parametrize("held", BEYOND)
def test_loose_sets_are_answered_as_sixty_digits_do(hinge, held):
    """By residuals in doubles, half of them were refused, others on other processors."""
    columns = np.array(held)
    assert off(hinge, columns, solve_mixed(hinge, 25, columns[None])) <= 1e-9
    numbers = [[hinge.node_name[i] for i in hinge.inner.ravel()[columns]]]
    fields = ComplianceEngine(hinge).solve(25, numbers, Want.ALL)
    assert off(hinge, columns, fields) <= 1e-9


def spoiled():
    """Sums without the last digit of doubles, another way in each."""
    rng = np.random.default_rng(0)

    def add(start, matrix, factors):
        size = np.abs(start) + abs(matrix) @ np.abs(factors)
        lost = 10 * EPS * size * rng.choice([-1, 1], len(size))
        return add_products(start, matrix, factors) + lost

    return add


def test_corrections_that_stall_refuse(hinge, monkeypatch):
    """The control of the test before."""
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
