"""Laws that every verdict obeys."""

from __future__ import annotations

from dataclasses import replace
from math import radians, sin

import numpy as np
import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st

from experiments.stability.parts.blocks import ring, stack
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY, Mortar, bond_mortar
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability._screens import FALLS, OPEN, STANDS, Screen
from seqopt.stability.assessment import Verdict, assess, bonded
from seqopt.stability.limit_analysis import Prover
from tests.builders import about_vertical, held, moved, scaled
from tests.strategies import arches


@settings(max_examples=6)
@given(
    length=st.floats(-3, 3),
    force=st.floats(-3, 3),
    offset=st.floats(0.05, 0.9),
    blocks=st.integers(2, 5),
)
def test_units_change_no_verdict(length, force, offset, blocks):
    """Lengths, and forces by density, gravity or unit, scaled by up to a thousand either way."""
    offset = offset / blocks
    assume(abs(0.5 * blocks * offset - 0.5) > 1e-3)
    plain = stack([offset] * (blocks - 1)).assembly(2000.0)
    size, pull = 10.0**length, 10.0**force
    scaled = replace(
        plain,
        centroid=plain.centroid * size,
        corner=plain.corner * size,
        weight=plain.weight * pull,
    )
    a, b = assess(plain, DRY), assess(scaled, DRY)
    assert a.verdict is b.verdict is not Verdict.UNDECIDED
    assert b.bond * size**2 / pull == pytest.approx(a.bond, rel=1e-3, abs=1e-2)
    assert b.friction == pytest.approx(a.friction, abs=2e-4)
    np.testing.assert_allclose(b.pull, a.pull, rtol=2e-3, atol=1e-5)
    assert (a.first_block, a.first_contact) == (b.first_block, b.first_contact)


@pytest.mark.parametrize("density", [1e-3, 1e6])
@pytest.mark.parametrize(
    ("half_angle", "verdict"), [(90.0, Verdict.STANDS), (120.0, Verdict.FALLS)]
)
def test_density_does_not_flip_an_arch(density, half_angle, verdict):
    """25 blocks, thickness 1 on span 10."""
    radius = 5.0 / sin(radians(min(half_angle, 90.0)))
    arch = ring(25, radius, 1.0, radians(half_angle)).assembly(density)
    assert assess(arch, Mortar(friction=0.7)).verdict is verdict


@settings(max_examples=6)
@given(arches(), st.integers(0, 1))
def test_where_the_scene_stands_changes_nothing(scene, grips):
    turn = about_vertical(0.7)
    last = scene.placed[-1].nodes[1]
    step = Step(1, StepKind.PLACE, len(scene.bricks), (last if grips else None, None, None))
    try:
        here = step_assembly(build_network(scene), step.bricks, step.grips)
    except SceneError:  # rolled so far that faces miss each other
        reject()
    there = step_assembly(
        build_network(moved(scene, lambda p: turn @ p + [3.0, -2.0, 1.0])), step.bricks, step.grips
    )
    a, b = (Prover(x, compile_equilibrium)(bonded(x, DRY)).value for x in (here, there))
    assert a == pytest.approx(b, rel=2e-3, abs=1e-5)


@pytest.mark.slow
@settings(max_examples=15)
@given(st.lists(st.floats(-0.6, 0.6), min_size=1, max_size=4), st.floats(0.1, 1.0))
def test_more_friction_bond_or_payload_never_hurts(offsets, friction):
    leaning = stack([x or 0.1 for x in offsets]).assembly(2000.0)
    low, high = (assess(leaning, Mortar(friction=f)) for f in (friction, friction + 0.3))
    assert high.bond <= low.bond * (1 + 1e-3) + 1e-2
    end = leaning.corner[-1] + [0.0, 0.0, 1.0]
    a, b = (assess(held(leaning, p, end), DRY).bond for p in (1e2, 1e4))
    assert b <= a * (1 + 1e-3) + 1e-2


# laws of screens: more grips, payload, friction or bond never hurt; scale does not count


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
