"""Textbook limits: friction, overhangs, arches, hinges and levers in closed form."""

from dataclasses import replace
from math import acos, atan, cos, radians, sin, sqrt, tan

import numpy as np
import pandas as pd
import pytest

from experiments.stability.classical import CASES, FEW, faults, ladder, push, row, wall
from experiments.stability.parts.blocks import stack
from formulations.contact.held_equilibrium import compile_held
from seqopt.contact.assembly import Assembly, step_assembly
from seqopt.contact.mortar import DRY, EPOXY, Mortar
from seqopt.network.network import build_network
from seqopt.scene.parts import Robot
from seqopt.stability._screens import FALLS, STANDS, Margins, Screen, _decided
from seqopt.stability.assessment import assess
from seqopt.stability.limit_analysis import EXACT, NEAR
from seqopt.stability.verdict import Verdict
from tests.builders import block, held, lacking

ROUGH = Mortar(friction=5.0)


def inclined(angle):
    """A cube on the ground, gravity turned by an angle about y."""
    cube = stack([]).assembly(2000.0)
    size = np.linalg.norm(cube.weight)
    return replace(cube, weight=size * np.array([[sin(angle), 0.0, -cos(angle)]]))


PRINTED = [case for case in CASES if case.source != "line of thrust"][::2]  # others: experiment


@pytest.mark.parametrize("case", PRINTED, ids=lambda case: f"{case.name}, {case.source}")
def test_a_classical_result_is_found_again(case):
    assert faults(pd.DataFrame([row(case, FEW)])) == []


def test_less_friction_than_the_paper_has_is_seen():
    one = next(case for case in CASES if case.name == "push that fells wall 1")
    assert faults(pd.DataFrame([row(one._replace(ours=push(wall(1), 0.64)), FEW)]))


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


# textbook limits of screens and their margins in closed form
NOBODY = np.zeros((1, 0), dtype=int), np.zeros((1, 0))
WEIGHT = 2000.0 * 9.81


def stands(assembly, mortar, places=NOBODY[0], payload=NOBODY[1]):
    """Whether it is proven to stand; an open answer is a failure here."""
    low, high = lacking(assembly, mortar, compile_held).bracket(places, payload, _decided)[0]
    assert high <= EXACT or low > EXACT
    return high <= EXACT


@pytest.mark.parametrize("across", [0.0, 0.6, np.pi / 2])
def test_linear_programs_know_the_friction_angle(across):
    """Whichever way the incline falls: the cone is round though it is spanned by directions."""
    cube, friction = stack([]).assembly(2000.0), 0.5
    for factor, expected in ((0.9999, True), (1.0001, False)):
        slope = np.arctan(factor * friction)
        way = (sin(slope) * cos(across), sin(slope) * sin(across), -cos(slope))
        inclined = replace(cube, weight=WEIGHT * np.array([way]))
        assert stands(inclined, Mortar(friction=friction)) is np.bool_(expected)


def test_linear_programs_know_the_lever():
    """At a point above the edge, at right angles to the lever: the ball is round as well."""
    leaning = stack([0.6]).assembly(2000.0)
    c, s = cos(0.4), sin(0.4)
    about = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    hand = held(leaning, 1.0, (1.6, 0.5, 1.5))
    hand = replace(
        hand,
        centroid=hand.centroid @ about.T,
        corner=hand.corner @ about.T,
        normal=hand.normal @ about.T,
        grip_position=hand.grip_position @ about.T,
    )
    lever = sqrt((1.6 - 1.0) ** 2 + 0.5**2)
    least = WEIGHT * 0.1 / lever
    rough, places = Mortar(friction=5.0), np.array([[0]])
    assert stands(hand, rough, places, np.array([[1.0001 * least]]))
    assert not stands(hand, rough, places, np.array([[0.9999 * least]]))


@pytest.mark.parametrize("wind", [0.0, 0.1, 0.3])
def test_wind_keeps_its_force_where_a_block_is_tilted(wind):
    """It tips where cos t = 5/3 (sin t + wind); a pull by tan t would count wind as less."""
    scene = replace(block((0.3, 0.5, 0.5)), wind=(wind, 0.0, 0.0))
    tips = acos(0.5 * wind / sqrt(0.3**2 + 0.5**2)) - atan(0.5 / 0.3)
    tilt = assess(step_assembly(build_network(scene), 1, (None,) * len(scene.robots)), ROUGH).tilt
    assert (1 - NEAR) * tips <= tilt <= tips * (1 + 1e-4)
    assert tan(tips) + wind < 0.6 * (1 - NEAR) or not wind  # the control
    stands = [Screen(scene, ROUGH, share * tips).stands(1, [[0]])[0] for share in (0.997, 1.001)]
    assert stands == [STANDS, FALLS]


def test_margins_of_a_brick_on_the_ground():
    """A robot above it need not lift; where the ground leans, it slides."""
    scene = replace(block(), robots=(Robot(name="rob1", payload=100.0),))
    assert Margins(scene, DRY).grip(1, [[1]])[0] == pytest.approx(0.0, abs=1e-6)
    leaning = block(lean=radians(20))
    friction = Margins(leaning, DRY).friction(1, [[0]], step=1e-4)[0]
    assert friction[0] <= tan(radians(20)) <= friction[1]
    assert Screen(leaning, DRY).stands(1, [[0]]) == STANDS
