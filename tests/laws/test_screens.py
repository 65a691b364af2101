"""Laws of screens: more grips, payload, friction or bond never hurt; scale does not count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from seqopt.contact.mortar import DRY, Mortar, bond_mortar
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.stability._screens import FALLS, OPEN, STANDS, Screen
from tests.builders import about_vertical, moved, scaled
from tests.strategies import arches


@st.composite
def questions(draw, grips=2):
    """A small arch, a brick count and a few grip sets, as places from 1."""
    scene = draw(arches(max_bricks=5, min_bricks=2))
    bricks = draw(st.integers(2, len(scene.bricks)))
    place = st.integers(0, 2 * bricks)
    row = st.lists(place, min_size=grips, max_size=grips, unique=True)
    return scene, bricks, np.array(draw(st.lists(row, min_size=4, max_size=4)))


def asked(scene, bricks, held, mortar=DRY, payload=150.0):
    """Verdicts found one by one, without what one set says of another."""
    out = []
    for row in held:
        try:
            out.append(Screen(scene, mortar).stands(bricks, [row], payload)[0])
        except SceneError:  # rolled so far that faces miss each other
            reject()
    return np.array(out)


def never_hurts(before, after):
    assert not ((before == STANDS) & (after == FALLS)).any()


@pytest.mark.slow
@settings(max_examples=15)
@given(questions(), st.integers(1, 10), st.floats(0.1, 1.0), st.floats(10.0, 200.0))
def test_more_never_hurts(question, extra, friction, payload):
    scene, bricks, held = question
    mortar = Mortar(friction=friction)
    before = asked(scene, bricks, held, mortar, payload)
    another = np.full((len(held), 1), min(extra, 2 * bricks))
    another[(held == another).any(axis=1)] = 0
    never_hurts(before, asked(scene, bricks, np.hstack([held, another]), mortar, payload))
    never_hurts(before, asked(scene, bricks, held, mortar, 2 * payload))
    never_hurts(before, asked(scene, bricks, held, Mortar(friction=friction + 0.3), payload))
    never_hurts(before, asked(scene, bricks, held, bond_mortar(2e3, friction), payload))


@settings(max_examples=5)
@given(questions(grips=3))
def test_what_is_learned_changes_no_verdict(question):
    """Together and one by one; and whichever robot holds which node."""
    scene, bricks, held = question
    alone = asked(scene, bricks, held)
    together = Screen(scene, DRY).stands(bricks, held, 150.0)
    swapped = Screen(scene, DRY).stands(bricks, held[:, ::-1], 150.0)
    settled = (alone != OPEN) & (together != OPEN) & (swapped != OPEN)
    assert (alone[settled] == together[settled]).all()
    assert (alone[settled] == swapped[settled]).all()


@settings(max_examples=5)
@given(questions(), st.floats(-1, 1), st.floats(-2, 2), st.floats(0, 3))
def test_units_place_and_scale_change_nothing(question, length, density, angle):
    """Weights and payloads grow alike; the arch is turned, moved, larger and of other matter."""
    scene, bricks, held = question
    size, heavy = 10.0**length, 10.0**density
    turn = about_vertical(angle)
    other = moved(scaled(scene, size, density=heavy), lambda p: turn @ p + [3.0, -2.0, 1.0])
    here = asked(scene, bricks, held)
    there = asked(other, bricks, held, payload=150.0 * heavy * size**3)
    settled = (here != OPEN) & (there != OPEN)
    assert (here[settled] == there[settled]).all()
    assert settled.any()


def test_a_law_that_is_broken_is_seen():
    with pytest.raises(AssertionError):
        never_hurts(np.array([STANDS, FALLS]), np.array([FALLS, FALLS]))
    assert replace(DRY, friction=0.1) != DRY


@pytest.mark.parametrize("tilt", [0.1])
def test_less_tilt_never_hurts(arch25, tilt):
    network, sets = build_network(arch25), np.array([[a, 24] for a in range(2, 24, 3)])
    sets = np.vstack([sets, sets - [0, 1]])
    upright, tilted = (Screen(network, DRY, x).stands(12, sets) for x in (0.0, tilt))
    assert (tilted == STANDS).any()
    never_hurts(tilted, upright)
