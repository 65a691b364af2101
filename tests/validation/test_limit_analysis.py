"""Textbook limits: friction, overhangs, arches, hinges and levers in closed form."""

from __future__ import annotations

from dataclasses import replace
from math import atan, cos, radians, sin, sqrt, tan

import numpy as np
import pandas as pd
import pytest

from experiments.stability.classical import CASES, FEW, faults, ladder, push, row, wall
from experiments.stability.parts.blocks import stack
from seqopt.contact.assembly import Assembly
from seqopt.contact.mortar import DRY, EPOXY, Mortar
from seqopt.stability.assessment import Verdict, assess
from tests.builders import held

ROUGH = Mortar(friction=5.0)


def inclined(angle):
    """A cube on the ground, gravity turned by an angle about y."""
    cube = stack([]).assembly(2000.0)
    size = np.linalg.norm(cube.weight)
    return replace(cube, weight=size * np.array([[sin(angle), 0.0, -cos(angle)]]))


PRINTED = [case for case in CASES if case.source != "line of thrust"]  # all in the experiment


@pytest.mark.parametrize("case", PRINTED, ids=lambda case: f"{case.name}, {case.source}")
def test_a_classical_result_is_found_again(case):
    assert faults(pd.DataFrame([row(case, FEW)])) == []


def test_less_friction_than_the_paper_has_is_seen():
    one = next(case for case in CASES if case.name == "push that fells wall 1")
    assert faults(pd.DataFrame([row(one._replace(ours=push(wall(1), 0.64)), FEW)]))


def test_the_walls_have_the_blocks_and_joints_of_the_paper():
    """Variables of frictionalblock_1 to _6 in MPECLIB: 3 a block, 7 a joint, and 2."""
    walls = [wall(k) for k in range(1, 7)]
    sizes = [2 + 3 * len(one.vertex) + 7 * len(one.contacts) for one in walls]
    assert sizes == [682, 1154, 854, 979, 1025, 2855]


@pytest.mark.parametrize("degrees", [5.0, 20.0, 35.0])
def test_a_block_slides_at_the_friction_angle(degrees):
    result = assess(inclined(radians(degrees)), DRY)
    assert result.verdict is (Verdict.STANDS if degrees < 25 else Verdict.FALLS)
    assert result.friction == pytest.approx(tan(radians(degrees)), abs=2e-4)


def test_a_cube_tips_or_slides_sideways():
    cube = stack([]).assembly(2000.0)
    for mortar, angle in ((DRY, radians(25.0)), (ROUGH, atan(1.0))):
        result = assess(cube, mortar)
        assert atan(result.pull.min()) == pytest.approx(angle, abs=1e-5)
        assert 0.98 * tan(angle) <= tan(result.tilt) <= tan(angle) + 1e-5  # safe between directions


def test_the_overhanging_block_needs_a_bond_and_goes_first():
    """Moments about the edge: weight times excess = bond times face times half its length."""
    excess = 0.1
    leaning = stack([0.5 + excess]).assembly(2000.0)
    face = 0.5 - excess
    weight = 2000.0 * 9.81
    result = assess(leaning, DRY)
    assert result.bond == pytest.approx(weight * excess / (face * face / 2), rel=1e-4)
    assert (result.first_block, result.first_contact) == ("2", "1-2")
    assert np.isnan(result.tilt)
    strong = replace(DRY, tensile_strength=1.01 * result.bond, cohesion=2 * result.bond)
    assert assess(leaning, strong).verdict is Verdict.STANDS
    weak = replace(DRY, tensile_strength=0.99 * result.bond, cohesion=2 * result.bond)
    assert assess(leaning, weak).verdict is Verdict.FALLS


@pytest.mark.parametrize(("half_span", "height"), [(1.0, 1.0), (1.0, 2.5), (2.0, 1.5)])
def test_three_hinges(half_span, height):
    """Friction under the feet, and the sideways pull at which a foot or the crown slides.

    By moments about the hinges, with 1 N in the middle of each bar.
    """
    bars = ladder(half_span, height)
    slope = half_span / height
    result = assess(bars, Mortar(friction=2.0))
    assert result.friction == pytest.approx(slope / 2, abs=2e-4)
    windward = (2.0 + slope / 2) / (1 + 1 / slope)
    leeward = (2.0 - slope / 2) / (1 - 1 / slope) if slope > 1 else np.inf
    crown = 2.0 * slope**2
    expected = min(windward, leeward, crown)
    assert result.pull[0] == pytest.approx(expected, rel=1e-4)
    assert result.pull[0] == pytest.approx(result.pull[4], rel=1e-4)


def test_a_robot_carries_what_the_lever_says():
    """A block beside its support, held at a point: the robot takes the moment about the edge."""
    leaning = stack([0.6]).assembly(2000.0)
    weight = 2000.0 * 9.81
    hand = held(leaning, 0.3 * weight, (1.6, 0.5, 1.5))
    lever = 1.6 - 1.0  # from the edge of the block below
    result = assess(hand, ROUGH)
    assert result.verdict is Verdict.STANDS
    least = weight * 0.1 / sqrt(lever**2 + 0.5**2)  # at right angles to the lever
    assert result.grip == pytest.approx(least, rel=1e-3)
    assert assess(held(leaning, 0.99 * least, (1.6, 0.5, 1.5)), ROUGH).verdict is Verdict.FALLS


def test_a_block_that_only_a_robot_holds():
    """No bond and no friction helps; the grip must be above or below the centroid."""
    alone = Assembly(
        block_name=(1,),
        centroid=np.zeros((1, 3)),
        weight=np.array([[0.0, 0.0, -10.0]]),
        contact_name=(),
        bodies=np.empty((0, 2), dtype=np.int64),
        normal=np.empty((0, 3)),
        corner=np.empty((0, 3)),
        contact=np.empty(0, dtype=np.int64),
        grip_block=np.array([0]),
        grip_position=np.array([[0.0, 0.0, 0.5]]),
        payload=np.array([10.1]),
    )
    assert assess(alone, EPOXY).verdict is Verdict.STANDS
    assert assess(alone, EPOXY).grip == pytest.approx(10.0, rel=1e-4)
    beside = assess(held(alone, 100.0, (0.2, 0.0, 0.0)), EPOXY)
    assert beside.verdict is Verdict.FALLS
    assert beside.bond == beside.friction == beside.grip == np.inf
    assert beside.first_block == "1"
    weak = assess(held(alone, 9.9, (0.0, 0.0, 0.5)), EPOXY)
    assert weak.verdict is Verdict.FALLS
    assert weak.grip == pytest.approx(10.0, rel=1e-4)
