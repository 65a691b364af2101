"""Textbook limits of screens and their margins in closed form."""

from __future__ import annotations

from dataclasses import replace
from math import cos, radians, sin, sqrt, tan

import numpy as np
import pytest

from experiments.stability.parts.blocks import stack
from formulations.contact.held_equilibrium import compile_held
from seqopt.contact.mortar import DRY, Mortar
from seqopt.scene.parts import Robot
from seqopt.stability._held_states import HeldStates
from seqopt.stability._prover import sideways
from seqopt.stability._screens import STANDS, Margins, Screen, _decided, _narrow
from seqopt.stability.assessment import bonded
from seqopt.stability.limit_analysis import EXACT
from tests.builders import block, held, lacking

NOBODY = np.zeros((1, 0), dtype=int), np.zeros((1, 0))
WEIGHT = 2000.0 * 9.81


def stands(assembly, mortar, places=NOBODY[0], payload=NOBODY[1]):
    """Whether it is proven to stand; an open answer is a failure here."""
    low, high = lacking(assembly, mortar, compile_held).bracket(places, payload, _decided)[0]
    assert high <= EXACT or low > EXACT
    return high <= EXACT


@pytest.mark.parametrize("friction", [0.5])
@pytest.mark.parametrize("across", [0.0, 0.6, np.pi / 2])
def test_a_block_slides_at_the_friction_angle(friction, across):
    """Whichever way the incline falls: the cone is round though it is spanned by directions."""
    cube = stack([]).assembly(2000.0)
    for factor, expected in ((0.9999, True), (1.0001, False)):
        slope = np.arctan(factor * friction)
        way = (sin(slope) * cos(across), sin(slope) * sin(across), -cos(slope))
        inclined = replace(cube, weight=WEIGHT * np.array([way]))
        assert stands(inclined, Mortar(friction=friction)) is np.bool_(expected)


@pytest.mark.parametrize("blocks", [2, 6])
def test_the_leaning_stack_is_harmonic(blocks):
    limit = [0.5 / i for i in range(blocks - 1, 0, -1)]
    for factor, expected in ((0.9999, True), (1.0001, False)):
        leaning = stack([factor * x for x in limit]).assembly(1800.0)
        assert stands(leaning, DRY) is np.bool_(expected)


def test_the_overhanging_block_needs_a_bond():
    """Moments about the edge: weight times excess = bond times face times half its length."""
    excess, face = 0.1, 0.4
    leaning = stack([0.5 + excess]).assembly(2000.0)
    states = HeldStates(leaning, bonded(leaning, Mortar(friction=DRY.friction)), compile_held)
    low, high = states.bracket(*NOBODY, _narrow)[0] * leaning.stress_scale
    exact = WEIGHT * excess / (face * face / 2)
    assert low * (1 - 1e-9) <= exact <= high * (1 + 1e-9)
    assert high - low < 2e-3 * exact


@pytest.mark.parametrize("turn", [0.4])
def test_a_robot_carries_what_the_lever_says(turn):
    """At a point above the edge, at right angles to the lever: the ball is round as well."""
    leaning = stack([0.6]).assembly(2000.0)
    c, s = cos(turn), sin(turn)
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


def test_a_cube_slides_or_tips_when_it_is_tilted():
    cube = stack([]).assembly(2000.0)
    for friction, expected in ((0.3, 0.3), (5.0, 1.0)):
        fixed = replace(bonded(cube, Mortar(friction=friction)), tension=(0, 0), cohesion=(0, 0))
        for case in sideways(fixed, (0.0, 0.0, 1.0))[::2]:
            low, high = HeldStates(cube, case, compile_held).bracket(*NOBODY, _narrow)[0]
            assert low <= expected * (1 + 1e-9)
            assert expected <= high * (1 + 1e-9)
            assert high - low < 2e-3


def test_margins_of_a_brick_on_the_ground():
    """It tips over its lower edge, or slides; a robot above it need not lift."""
    scene = replace(block(), robots=(Robot(name="rob1", payload=100.0),))
    margins = Margins(scene, Mortar(friction=0.5))
    size = scene.bricks[0].dimensions
    tilt = margins.tilt(1, [[0]])[0]
    assert tilt[0] <= np.arctan(0.5) + 1e-9 <= tilt[1] + 2e-9
    assert size[1] / size[2] > 0.5  # it slides before it tips
    assert margins.grip(1, [[1]])[0] == pytest.approx(0.0, abs=1e-6)
    leaning = block(lean=radians(20))
    friction = Margins(leaning, DRY).friction(1, [[0]], step=1e-4)[0]
    assert friction[0] <= tan(radians(20)) <= friction[1]
    assert Screen(leaning, DRY).stands(1, [[0]]) == STANDS
