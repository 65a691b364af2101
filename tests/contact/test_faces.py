"""Where the faces of bricks meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.contact.faces import step_assembly
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.sequence.methods import METHODS


def test_bricks_touch_where_their_faces_overlap(arch25):
    """The paper's joints are 116 × 53 mm; tilted bricks meet a little off."""
    net = build_network(arch25)
    last = METHODS["sequential"](net)[-1]
    whole = step_assembly(net, last.bricks, last.grips)
    assert len(whole.area) == 26
    assert np.median(whole.area) == pytest.approx(0.116 * 0.053, rel=0.02)
    assert whole.area.min() > 0.75 * 0.116 * 0.053  # at the crown, where brick 13 turns out of line
    plane = np.einsum(
        "ki,ki->k", whole.corner - net.springs.position[whole.contact], whole.normal[whole.contact]
    )
    assert np.abs(plane).max() < 1e-12


def test_a_joint_beside_its_bricks_is_named(arch25):
    joints = (
        *arch25.joints[:3],
        replace(arch25.joints[3], along=(0.0, 1.0, 0.0), across=(1.0, 0.0, 0.0)),
    )
    wrong = replace(arch25, joints=(*joints, *arch25.joints[4:]))
    with pytest.raises(SceneError, match="joint 4-5: the faces of its bricks do not overlap"):
        step_assembly(build_network(wrong), 6, (None, None, None))
