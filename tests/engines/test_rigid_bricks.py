"""Exactly rigid bricks where joints are loose, chains long and systems small or not positive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.rigid import _refinement as refinement
from seqopt.engines.rigid import compliance as trial
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid.compliance import _EVEN, ComplianceEngine, _cancels
from seqopt.errors import MechanismError, SolverError
from seqopt.network.build import build_network
from tests.builders import from_both_sides, hinged, six_bricks, solve_batch
from tests.limit_scenes import HELD, LOOSE_AT, chain, loosened
from tests.reference_chain import solve_exactly


def error(net, fields, row, grips):
    """The largest relative error of displacements, joint forces and joint moments."""
    bricks = len(net.inner)
    columns = grip_columns(net, bricks, np.array([grips], dtype=int))[0]
    exact = solve_exactly(net, bricks, columns)
    wrench = fields.joint_wrench[row]
    pairs = (
        (fields.displacement[row, net.inner.ravel()], exact.displacement),
        (wrench[:, :3], exact.joint_wrench[:, :3]),
        (wrench[:, 3:], exact.joint_wrench[:, 3:]),
    )
    return max(np.abs(got - want).max() / np.abs(want).max() for got, want in pairs)


@pytest.mark.parametrize("only_turning", [True, False])
@pytest.mark.parametrize("factor", [1e-3, 1e-9, 1e-15])
def test_grips_beyond_a_loose_joint(factor, only_turning):
    """The force method alone loses every digit here and says nothing: the second assertion."""
    net = build_network(loosened(chain(25), factor, only_turning=only_turning))
    sets = [HELD, (30, 37, 49), (3, 8, 10)]
    fields = ComplianceEngine(net).solve(25, sets, Want.ALL)
    for row, grips in enumerate(sets):
        assert error(net, fields, row, grips) <= 1e-9
    operator = OperatorBuilder(net, grow_tree(net)).operator(25)
    columns = grip_columns(net, 25, np.array(sets))
    for accuracy in (1e-9, 1e-6):
        fields, trusted = solve_batch(operator, columns, Want.ALL, accuracy=accuracy)
        assert trusted[2]
        assert not trusted[:2].any() or factor >= 1e3 * np.finfo(float).eps / accuracy
        for row in np.flatnonzero(trusted):
            assert error(net, fields, row, sets[row]) <= accuracy


def test_a_batch_of_many_passes(monkeypatch):
    net = build_network(chain(8))
    sets = [(1, 9, 14), (14, 15, 3), (4, 5, 2), (12, 10, 7), (8, 9, 15)]
    whole = ComplianceEngine(net).solve(8, sets, Want.ALL)
    monkeypatch.setattr(trial, "_CHUNK", 2)
    parts = ComplianceEngine(net).solve(8, sets, Want.ALL)
    for name in ("edge_force", "displacement", "grip_force", "support"):
        gap = np.abs(getattr(parts, name) - getattr(whole, name)).max()
        assert gap <= 1e-12 * np.abs(getattr(whole, name)).max()


def test_grips_close_together_on_a_long_chain():
    net = build_network(chain(150))
    sets = [(296, 297, 299), (297, 298, 299), (297, 299, 295)]
    fields = ComplianceEngine(net).solve(150, sets, Want.ALL)
    for row, grips in enumerate(sets):
        assert error(net, fields, row, grips) <= 1e-12


def test_a_hundred_bricks_with_a_hinge():
    """A spring without stiffness leaves no operator."""
    net = build_network(hinged(chain(100), 50))
    fields = ComplianceEngine(net).solve(100, [(150, 199)], Want.ALL)
    assert error(net, fields, 0, (150, 199)) <= 1e-12


def test_what_double_precision_cannot_tell_from_a_mechanism_is_refused():
    net = build_network(loosened(chain(25), 1e-13, only_turning=False))
    with pytest.raises((MechanismError, SolverError)) as caught:
        ComplianceEngine(net).solve(25, [[30, 49]])
    if isinstance(caught.value, MechanismError):
        moving = np.array([np.abs(row).max() for _, row in caught.value.mode])
        assert moving[: LOOSE_AT + 1].max() < 1e-6


# when the fast engine's own answers stand, and when they are corrected


KINDS = ("translational_stiffness", "rotational_stiffness")


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
        trial, "_cancels", lambda *seen: looked.append(len(seen[0].axis)) or _cancels(*seen)
    )
    joint = scene.joints[2]
    engine = ComplianceEngine(build_network(evenly(scene, 2, kind, share)))
    for bricks in range(1, len(scene.bricks) + 1):
        engine.solve(bricks, [[scene.placed[bricks - 1].placing_node]])
    acts = 1 + max(scene.build_order.index(brick) for brick in joint.bricks)
    assert looked == ([*range(acts, len(scene.bricks) + 1)] if uneven else [])
