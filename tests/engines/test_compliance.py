"""When the fast engine's own answers stand, and when they are corrected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.engines.rigid import _refinement as refinement
from seqopt.engines.rigid import compliance as trial
from seqopt.engines.rigid.compliance import _EVEN, ComplianceEngine, _cancels
from seqopt.network.build import build_network
from tests.builders import from_both_sides, six_bricks
from tests.limit_scenes import chain

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
