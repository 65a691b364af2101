"""Pads and springs of the discrete arches: readings, errors, stored rows of the witness."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from experiments.discrete.discrete_arches import row_of, stresses, within_limits
from experiments.discrete.parts.arch_pads import Across, PaddedEngine, Pinch, Reading
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
