"""When the fast engine's own answers stand, and when they are corrected."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from seqopt.engines.interface import _NAMES, Want, grip_columns
from seqopt.engines.rigid import _refinement as refinement
from seqopt.engines.rigid import compliance
from seqopt.engines.rigid import compliance as trial
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._mixed import solve_mixed
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid._refinement import _Corrector
from seqopt.engines.rigid._response_maps import loads_of
from seqopt.engines.rigid.compliance import _CANCEL, _EVEN, ComplianceEngine, _cancels
from seqopt.network.build import build_network
from tests.builders import from_both_sides, six_bricks, solve_batch
from tests.limit_scenes import chain, loosened
from tests.reference_chain import solve_exactly

KINDS = ("translational_stiffness", "rotational_stiffness")
BOTH_SIDES = [(6, 15, 25), (9, 14, 26)]  # of the loose joint


def test_nothing_is_corrected_where_joints_are_even(monkeypatch):
    monkeypatch.setattr(refinement, "Refinement", None)
    for scene in (six_bricks(), from_both_sides(5), chain(9)):
        engine, count = ComplianceEngine(build_network(scene)), len(scene.bricks)
        for bricks in (1, 2, count - 1, count, 1):
            node = scene.placed[bricks - 1].placing_node
            assert np.isfinite(engine.solve(bricks, [[node]]).grip_force).all()


def test_grips_on_both_sides_of_a_joint_that_hardly_turns(monkeypatch):
    """What is read off the grips' equations does not see what is wrong in them: the control."""
    net = build_network(loosened(chain(16), 1e-7, only_turning=True))
    columns = grip_columns(net, 16, BOTH_SIDES)
    operator = OperatorBuilder(net, grow_tree(net)).operator(16)
    spoiled = replace(operator, dead_displacement=operator.dead_displacement * (1 + 1e-6))
    plain, trusted = solve_batch(spoiled, columns, Want.ALL, accuracy=1e-7)
    assert trusted.all()
    assert solve_batch(operator, columns)[1].any()
    better, worse = ComplianceEngine(net).solve(16, BOTH_SIDES, Want.ALL), 0.0
    for row, grips in enumerate(columns):
        exact = solve_exactly(net, 16, grips)
        size = np.abs(exact.displacement).max()
        nodes = net.inner.ravel()
        assert np.abs(better.displacement[row, nodes] - exact.displacement).max() <= 1e-9 * size
        gap = np.abs(plain.displacement[row, nodes] - exact.displacement).max()
        worse = max(worse, gap / size)
    assert worse > 5e-9
    assert not solve_batch(operator, columns, even=False)[1].all()


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
        trial, "_cancels", lambda *seen: looked.append(len(seen[0].axis)) or _cancels(*seen)
    )
    joint = scene.joints[2]
    engine = ComplianceEngine(build_network(evenly(scene, 2, kind, share)))
    for bricks in range(1, len(scene.bricks) + 1):
        engine.solve(bricks, [[scene.placed[bricks - 1].placing_node]])
    acts = 1 + max(scene.build_order.index(brick) for brick in joint.bricks)
    assert looked == ([*range(acts, len(scene.bricks) + 1)] if uneven else [])


@pytest.mark.parametrize(("share", "seen"), [(1 - 1e-9, False), (1 + 1e-9, True)])
@pytest.mark.parametrize("chunk", [2, 2048])
def test_motions_cancel_where_their_parts_are_ten_times_what_is_left(
    monkeypatch, share, seen, chunk
):
    """At any node that a grip loads, what forces and weight move, signs aside, over the rest."""
    monkeypatch.setattr(trial, "_CHUNK", chunk)
    rng = np.random.default_rng(0)
    flexibility, dead, motion = rng.normal(size=(6, 6)), rng.normal(size=6), np.eye(7, 9)
    index = np.array([[0, 1, 2], [3, 4, 5], [0, 4, 2], [5, 1, 3], [2, 0, 4]])
    force = rng.normal(size=index.shape)
    for row in range(5):
        loaded = np.append(np.zeros(6), 1.0)
        loaded[index[row]] = force[row]
        parts = max(
            sum(abs(flexibility[i, j] * f) for j, f in zip(index[row], force[row], strict=True))
            + abs(dead[i])
            for i in index[row]
        )
        left = np.abs(loaded @ motion).max()
        size = share * _CANCEL * left / parts
        own = SimpleNamespace(
            flexibility=size * flexibility,
            dead_displacement=size * dead,
            answer=lambda _, rows, pull: loads_of(rows, pull, 7) @ motion,
        )
        assert _cancels(own, index, force)[row] == seen
    assert _cancels(own, np.zeros((3, 0), int), np.zeros((3, 0))).tolist() == [False] * 3


def test_grips_on_other_bricks_are_answered_as_if_nothing_had_been_asked():
    """An operator of few bricks serves those alone; more of them are added, and it is kept."""
    net = build_network(chain(16))
    engine = ComplianceEngine(net)
    asked = [[[3]], [[3], [4]], [[17, 22]], [[3, 17]], [[31]], [[3]]]
    for sets in asked:
        assert engine.solve(16, sets, Want.ALL) == engine.solve(16, sets, Want.ALL)
        own = ComplianceEngine(net).solve(16, sets, Want.ALL)
        again = engine.solve(16, sets, Want.ALL)
        for name in _NAMES:
            size = np.abs(getattr(own, name)).max()
            assert np.abs(getattr(again, name) - getattr(own, name)).max() <= 1e-9 * size, name


def test_an_operator_that_covers_what_is_asked_is_not_made_again(monkeypatch):
    made = []

    class Counted(OperatorBuilder):
        def operator(self, bricks, held=None):
            made.append(held.tolist())
            return super().operator(bricks, held)

    monkeypatch.setattr(compliance, "OperatorBuilder", Counted)
    scene = chain(16)
    engine = ComplianceEngine(build_network(scene))
    nodes = [brick.nodes for brick in scene.placed]
    one, other, far = nodes[1][0], nodes[1][1], [nodes[8][0], nodes[10][1]]
    for grips in ([one], [other], far, [other, far[0]], [one, far[1]]):
        engine.solve(16, [grips])
    assert made == [[1], [1, 8, 10]]


def test_what_is_only_compared_is_corrected_once_and_right_to_six_digits(monkeypatch):
    """Grips close to the tip of a long chain, against the refined mixed system."""
    bricks, made = 120, []

    class Counted(_Corrector):
        def _correction(self, *arguments):
            made.append(len(arguments[0].columns))
            return super()._correction(*arguments)

    monkeypatch.setattr("seqopt.engines.rigid._refinement._Corrector", Counted)
    net = build_network(chain(bricks))
    nodes = np.array([brick.nodes for brick in net.scene.placed])
    pairs = [(i, j) for i in (1, 2, 3) for j in (4, 6, 9)]
    sets = np.array([[nodes[-1, 1], nodes[-1 - i, 0], nodes[-1 - j, 1]] for i, j in pairs])
    engine = ComplianceEngine(net, accuracy=1e-13)
    exact = solve_mixed(net, bricks, grip_columns(net, bricks, sets))
    size = np.abs(exact.edge_force).max(axis=1)
    taken = {}
    for want, most in ((Want.RESPONSES, 1e-9), (Want.RESPONSES | Want.SCREEN, 1e-6)):
        monkeypatch.setattr(trial, "_UNSEEN", 1.0)  # nothing is trusted
        made.clear()
        off = np.abs(engine.solve(bricks, sets, want).edge_force - exact.edge_force).max(axis=1)
        assert (off <= most * size).all()
        taken[most] = sum(made)
    assert taken[1e-6] == len(sets) < taken[1e-9]


def test_a_correction_is_kept_for_the_same_bricks_and_gets_their_operator(monkeypatch):
    made, helped = [], []

    class Watched(refinement.Refinement):
        def __init__(self, network, bricks, *more, **named):
            made.append(bricks)
            super().__init__(network, bricks, *more, **named)

        def solve(self, columns, operator, *more):
            helped.append(operator is not None)
            return super().solve(columns, operator, *more)

    monkeypatch.setattr(refinement, "Refinement", Watched)
    engine = ComplianceEngine(build_network(loosened(chain(16), 1e-9, only_turning=True)))
    for bricks in (16, 16, 14, 14, 16):
        engine.solve(bricks, [[2 * bricks - 1, 2 * bricks - 3, 4]])
    assert made == [16, 14, 16]
    assert helped == [True] * 5
