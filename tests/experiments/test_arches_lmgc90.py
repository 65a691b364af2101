"""Partial arches for LMGC90: what it is shown is what our bed of springs stands on."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from experiments.discrete.parts import arches_lmgc90, springs_lmgc90
from experiments.discrete.parts.arch_pads import (
    SPREADS,
    STIFFER,
    Across,
    Pinch,
    bed_at_corners,
    drawn_in,
    ground_forces,
    padded,
    posed,
)
from experiments.discrete.parts.arches_lmgc90 import (
    PAD,
    asked,
    moved_by_twists,
    on_ground,
    scene_for,
    settlement,
    spread_engine,
    witness,
)
from experiments.harness.lmgc90 import python_with_lmgc90
from experiments.harness.yardstick import error, moved
from seqopt.contact.mortar import BedStiffness
from seqopt.network.network import GROUND
from seqopt.sequence.methods import sequential
from seqopt.study.published import STUDY_BED, STUDY_PADS

PYTHON = python_with_lmgc90(os.environ.get("SEQOPT_LMGC90", sys.executable))
with_lmgc90 = pytest.mark.skipif(PYTHON is None, reason="LMGC90 is not installed")


ACROSS, THROUGH = (Pinch(across, STUDY_PADS, side=PAD) for across in Across)
BOTH = pytest.mark.parametrize("pinch", [ACROSS, THROUGH], ids=["width", "thickness"])


@pytest.fixture(scope="module")
def step(engine25):
    return sequential(engine25.network)[32]


@BOTH
@pytest.mark.parametrize("flush", [True, False])
def test_pads_are_on_either_side_of_the_held_node(engine25, step, pinch, flush):
    held = padded(engine25.network, step, pinch, flush=flush)
    faces = held.corner[held.contact >= step.bricks].reshape(2, STIFFER, 4, 3)
    assert (faces == faces[:, :1]).all()
    np.testing.assert_allclose(held.area[step.bricks :], PAD**2)
    brick = engine25.network.scene.brick_of_node[step.held[0]]
    node = np.array(engine25.network.scene.node_position(step.held[0]))
    middles = faces[:, 0].mean(axis=1)
    np.testing.assert_allclose(middles.mean(axis=0), node)
    apart = middles[1] - middles[0]
    assert np.linalg.norm(apart) == pytest.approx(brick.dimensions[pinch.across])
    assert (held.bodies[step.bricks :] == [GROUND, step.bricks - 1]).all()
    inward = held.normal[[step.bricks, -1]] @ apart / np.linalg.norm(apart)
    lean = np.degrees(np.arccos(np.minimum(np.abs(inward), 1.0)))
    assert inward[0] > 0 > inward[1]
    assert lean.max() < (1e-5 if flush else 9)


def test_ground_and_pads_carry_the_weight(engine25, step):
    held = padded(engine25.network, step, ACROSS)
    _, force = bed_at_corners(held, STUDY_BED)
    total = ground_forces(held, force).sum(axis=0)
    np.testing.assert_allclose(total, -held.weight.sum(axis=0), atol=1e-6)


def test_stiffer_joints_move_less_in_proportion(engine25, step):
    held = padded(engine25.network, step, THROUGH)
    once, _ = bed_at_corners(held, STUDY_BED)
    double = BedStiffness(2 * STUDY_BED.normal, 2 * STUDY_BED.tangential)
    twice, _ = bed_at_corners(held, double)
    np.testing.assert_allclose(twice, 0.5 * once, rtol=1e-6, atol=1e-15)


@BOTH
@pytest.mark.parametrize("spread", SPREADS)
@pytest.mark.parametrize("number", [32, 46])
def test_what_lmgc90_is_shown_is_the_engine_but_for_the_lean(engine25, number, pinch, spread):
    """Flush pads give the engine's answer; leaning ones move it by a few percent at most."""
    net, step = engine25.network, sequential(engine25.network)[number]
    wanted = moved(spread_engine(net, pinch, spread), step)
    for flush, near in ((True, 1e-3), (False, 0.08)):
        twist, _ = bed_at_corners(*posed(padded(net, step, pinch, spread, flush=flush), spread))
        off = moved_by_twists(net, step, twist) - wanted
        assert np.abs(off).max() < near * wanted.max()


def test_faces_drawn_in_bend_as_an_even_bed(engine25, step):
    """A rectangle's four corners, drawn in by √3, have its second moments of area."""
    held = padded(engine25.network, step, ACROSS)
    small = drawn_in(held)
    np.testing.assert_allclose(3 * small.area, held.area)
    pad = small.corner[-4:] - small.corner[-4:].mean(axis=0)
    assert 0.25 * (pad**2).sum() == pytest.approx(2 * PAD**2 / 12)


@pytest.mark.parametrize("number", [32, 34, 44, 46])
@BOTH
@pytest.mark.parametrize("spread", SPREADS)
def test_lmgc90_is_shown_every_face_and_weight(engine25, number, pinch, spread):
    """A pad's face is a facet of its blocks; a joint's too, but for millimeters beside a pad."""
    step = sequential(engine25.network)[number]
    held, bed = posed(padded(engine25.network, step, pinch, spread), spread)
    scene = scene_for(held, bed)
    blocks, free = scene["blocks"], step.bricks
    assert [block["fixed"] for block in blocks] == [False] * free + [True] * (1 + 2 * STIFFER)
    assert sum(block["weight"] for block in blocks) == pytest.approx(-held.weight.sum())
    turned = held.corner @ arches_lmgc90.TURN.T
    for c, (first, second) in enumerate(held.bodies):
        face, normal = turned[held.contact == c], arches_lmgc90.TURN @ held.normal[c]
        ground = free + int((held.bodies[:c, 0] == GROUND).sum())
        for body, sign in ((ground if first == GROUND else first, -1), (second, 1)):
            height = sign * (np.array(blocks[body]["vertices"]) - face[0]) @ normal
            assert height.min() > (-1e-9 if c >= free else -5e-3)
            assert (np.abs(height) < 1e-5).sum() == 4
    places = np.array([block["centroid"] for block in blocks])
    apart = np.linalg.norm(places[:, None] - places, axis=2)[np.triu_indices(len(places), 1)]
    assert apart.min() > 1e-4
    assert json.loads(json.dumps(scene)) == scene


def test_a_larger_pad_moves_less(engine25, step):
    engines = [
        spread_engine(engine25.network, Pinch(Across.WIDTH, STUDY_PADS, side=side), "even")
        for side in (0.01, 0.02, 0.04)
    ]
    errors = [error(moved(engine25, step), moved(discrete, step)) for discrete in engines]
    assert errors == sorted(errors)


def test_blocks_are_closed_and_look_outward(engine25, step):
    for block in scene_for(padded(engine25.network, step, THROUGH), STUDY_BED)["blocks"]:
        assert springs_lmgc90.volume(block) > 0
        edges = {(f[i - 1], f[i]) for f in block["faces"] for i in range(3)}
        assert edges == {(b, a) for a, b in edges}


def test_the_law_is_as_stiff_as_asked():
    """In tension and in shear, spring and cohesive zone are in series."""
    friction, _, *zone = springs_lmgc90.law(STUDY_BED.normal, STUDY_BED.tangential)[:4]
    springs = springs_lmgc90.law(STUDY_BED.normal, STUDY_BED.tangential)[-2:]
    assert friction == 0.0
    series = [1 / (1 / a + 1 / b) for a, b in zip(zone, springs, strict=True)]
    np.testing.assert_allclose(series, [STUDY_BED.normal, STUDY_BED.tangential], rtol=2e-6)
    assert springs[0] == STUDY_BED.normal


def test_loads_come_to_act_smoothly_and_stay():
    time, value = springs_lmgc90.eased({"step": 0.1, "steps": 10}, 8.0, 2.0)
    assert (np.diff(time) > 0).all()
    assert (np.diff(value) <= 0).all()
    np.testing.assert_allclose(value[[0, -2, -1]], [8.0, 2.0, 2.0])
    assert time[-2] < 1.0 < time[-1]


def test_forces_on_the_ground_are_turned_to_forces_on_the_blocks():
    result = {"pair": np.array([[0, 1], [2, 0]]), "force": np.array([[0, 0, 3.0], [0, 0, 4.0]])}
    np.testing.assert_allclose(on_ground(result, 1), [[0, 0, 3.0], [0, 0, -4.0]])


def test_a_missing_or_failing_lmgc90_is_none(engine25, step, monkeypatch):
    assert witness(engine25, step, "no such python") is None
    assert asked(sys.executable, {"blocks": []}) is None

    def late(*args, **kwargs):
        raise subprocess.TimeoutExpired("lmgc90", 1.0)

    monkeypatch.setattr(subprocess, "run", late)
    assert asked(sys.executable, {"blocks": []}) is None


def test_a_program_of_the_same_answers_agrees(engine25, step, monkeypatch):
    """A stand-in for LMGC90 that answers with our own bed shows no difference."""
    held = padded(engine25.network, step, ACROSS, "corners")
    twist, force = bed_at_corners(held, STUDY_BED)
    world = np.einsum("ki,kij->kj", force, held.axes[held.contact])
    ground = np.flatnonzero(held.bodies[:, 0] == GROUND)
    first = held.bodies[:, 0].copy()
    first[ground] = 17 + np.arange(len(ground))
    answer = {
        "twist": twist,
        "pair": np.stack([held.bodies[:, 1], first], axis=1)[held.contact],
        "force": world,
        "local": force[:, [1, 0, 2]],
        "area": (held.area / 4)[held.contact],
        "sway": 0.0,
    }
    monkeypatch.setattr(arches_lmgc90, "asked", lambda python, scene: answer)
    row = arches_lmgc90.compared(engine25, step, "", Across.WIDTH, "corners")
    assert row["same_pads_off_pct"] == pytest.approx(0.0)
    assert row["lmgc90_error_pct"] == row["same_pads_error_pct"]
    assert 0 < row["engine_off_pct"] < 8  # its pads do not lean
    assert row["base_N"] == pytest.approx(row["same_base_N"])
    assert row["pads_N"] == pytest.approx(row["same_pads_N"])
    assert row["unbalanced_pct"] == pytest.approx(0.0, abs=1e-6)
    assert 0 < row["shear_used"] < 1
    lost = {**answer, "pair": answer["pair"][1:]}
    monkeypatch.setattr(arches_lmgc90, "asked", lambda python, scene: lost)
    assert arches_lmgc90.compared(engine25, step, "", Across.WIDTH, "corners") is None


@with_lmgc90
@pytest.mark.parametrize("upright", [True, False])
def test_one_brick_settles_by_its_weight_over_the_stiffness(upright):
    moved, expected = settlement(PYTHON, upright=upright)
    assert moved == pytest.approx(expected, rel=1e-3)


@with_lmgc90
def test_lmgc90_and_our_bed_agree(engine25, step):
    row = witness(engine25, step, PYTHON, ((Across.THICKNESS, "even"),)).iloc[0]
    assert abs(row["same_pads_off_pct"]) < 1.0
    assert row["same_pads_farthest_pct"] < 2.0
    assert abs(row["engine_off_pct"]) < 1.0  # across the thickness pads need not lean
    assert row["pads_N"] == pytest.approx(row["same_pads_N"], rel=0.01)
