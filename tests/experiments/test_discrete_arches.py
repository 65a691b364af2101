"""Pads and springs of the discrete arches: readings, errors, stored rows of the witness."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from experiments.discrete.discrete_arches import row_of, stresses, within_limits
from experiments.discrete.parts.arch_pads import (
    CORNERS,
    Across,
    AtCorners,
    PaddedEngine,
    Pinch,
    Reading,
    pad_stiffness,
    pads_at_corners,
    readings,
)
from experiments.harness.yardstick import STEPS, moved
from seqopt.engines.interface import Want
from seqopt.sequence.methods import sequential
from seqopt.study.published import STUDY_BED, STUDY_PADS


@pytest.fixture(scope="module")
def step(engine25):
    return sequential(engine25.network)[STEPS[17] - 1]


def test_pads_let_a_brick_turn_and_balance(engine25):
    net, pinch = engine25.network, Pinch(Across.WIDTH, STUDY_PADS, side=0.03)
    found = PaddedEngine(net, bed=STUDY_BED, pinch=pinch).solve(10, [[19]], Want.ALL)
    assert np.abs(found.brick_twist[0, 9]).max() > 0
    total = found.grip_force[0].sum(axis=0) + found.support[0, :, :3].sum(axis=0)
    weight = -net.weight[:10].sum(axis=0)
    assert total == pytest.approx(weight, abs=1e-6 * np.abs(weight).max())


@pytest.mark.parametrize("across", list(Across))
def test_even_pads_can_stand_for_pads_at_corners(engine25, across):
    """They hold as stiffly against motion, and three times so against turning about themselves."""
    pinch, brick = Pinch(across, STUDY_PADS, side=0.02), engine25.network.scene.placed[16]
    center, axis = np.array(brick.position), np.array(brick.width_axis)
    if across == Across.THICKNESS:
        axis = np.cross(brick.length_axis, axis)
    even, corners = (
        pad_stiffness(engine25.network, 16, center, p) for p in (pinch, pads_at_corners(pinch))
    )
    np.testing.assert_allclose(corners[:3, :3], even[:3, :3], atol=1e-6)
    turning = 2 * pinch.stiffness.tangential * pinch.side**4 / 6
    assert axis @ even[3:, 3:] @ axis == pytest.approx(turning)
    assert axis @ corners[3:, 3:] @ axis == pytest.approx(3 * turning)


def test_the_pads_of_all_readings_are_named_and_found_again(engine25):
    names = {(r.grip, 1e3 * r.pinch.side if r.pinch else 0.0, r.joint) for r in readings()}
    assert len(names) == len(readings()) == 28
    for name in names:
        reading = Reading.of(*name)
        assert (reading.grip, reading.joint) == (name[0], name[2])
        assert isinstance(reading.engine(engine25.network), AtCorners) == (name[2] == CORNERS)


def test_softer_joints_move_more_and_a_node_lets_the_brick_turn(engine25, step):
    pinch = Pinch(Across.WIDTH, STUDY_PADS, side=0.02)
    whole, half, node = (
        moved(reading.engine(engine25.network), step).max()
        for reading in (Reading(pinch=pinch), Reading("halves in series", pinch), Reading())
    )
    assert node > half > whole


def test_nothing_breaks_or_slips_and_a_bond_too_weak_would_tell(engine25, step):
    tension, shear = stresses(Reading().engine(engine25.network), step)
    assert 0 < tension < 3e6
    assert 0 < shear < 1
    table = pd.DataFrame([row_of(engine25, step, Reading())])
    assert table["shear_used"][0] == shear
    assert within_limits(table)
    assert not within_limits(table.assign(shear_used=-0.1))  # tension beyond all shear
    assert not within_limits(table.assign(tension_MPa=3.1))
