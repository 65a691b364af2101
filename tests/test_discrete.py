"""Beds of springs over contact faces, and blocks on them, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from experiments import discrete_arches
from experiments.arch_pads import AtCorners, pads_at_corners
from experiments.arches_lmgc90 import error, moved
from experiments.blocks import stack
from experiments.discrete_arches import (
    CORNERS,
    STEPS,
    Reading,
    best_sides,
    largest_fall,
    missing,
    readings,
    row_of,
    stresses,
    within_limits,
    witness_rows,
)
from experiments.plotting import RESULTS
from seqopt.contact.quadrature import face_quadrature
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.discrete.pads import Across, Pinch, pad_stiffness
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.two_robots import sequential
from seqopt.study.presets import STUDY_BED, STUDY_PADS
from seqopt.study.tables import printed
from tests.test_fidelity import HERE, block

NORMAL, TANGENTIAL = STUDY_BED.normal, STUDY_BED.tangential


@pytest.fixture(scope="module")
def engine():
    return ComplianceEngine(build_network(load_scene("arch25")))


@pytest.fixture(scope="module")
def step(engine):
    return sequential(engine.network)[STEPS[17] - 1]


@pytest.mark.parametrize("size", [(1.0, 0.5, 0.2), (0.3, 0.9, 2.0)])
def test_a_bed_has_the_moments_of_its_face(size):
    length, width, _ = size
    assembly = stack([], size).assembly(2000.0)
    bed = face_quadrature(assembly)
    away = bed.point - assembly.corner.mean(axis=0)
    assert bed.area.sum() == pytest.approx(length * width)
    assert bed.area @ away[:, 0] ** 2 == pytest.approx(width * length**3 / 12)
    assert bed.area @ away[:, 1] ** 2 == pytest.approx(length * width**3 / 12)
    assert bed.area @ (away[:, 0] * away[:, 1]) == pytest.approx(0, abs=1e-12)
    assert set(bed.face) == {0}


def twist_of(scene, kind=DiscreteEngine):
    """How a block moves and turns on the study's bed, and its weight."""
    net = build_network(scene)
    return kind(net, bed=STUDY_BED).solve(1, HERE, Want.ALL).brick_twist[0, 0], -net.weight[0, 2]


@pytest.mark.parametrize("lean", [0.0, math.pi])
def test_a_block_on_the_ground_or_below_a_ceiling_settles_by_its_weight(lean):
    twist, weight = twist_of(block((0.4, 0.3, 0.5), lean))
    assert twist[2] == pytest.approx(-weight / (NORMAL * 0.4 * 0.3))
    assert twist[[0, 1, 3, 4, 5]] == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize(("kind", "stiffer"), [(DiscreteEngine, 1), (AtCorners, 3)])
def test_a_block_on_a_wall_hangs_and_leans_as_springs_say(kind, stiffer):
    """The control: springs at the corners alone are three times too stiff in turning."""
    length, width, height = size = 0.4, 0.3, 0.5
    twist, weight = twist_of(block(size, math.pi / 2), kind)
    tilt = weight * height / 2 / (NORMAL * width * length**3 / 12) / stiffer
    assert twist[4] == pytest.approx(tilt)
    assert twist[2] == pytest.approx(-weight / (TANGENTIAL * length * width) - tilt * height / 2)
    assert twist[[1, 3, 5]] == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize("across", list(Across))
def test_even_pads_can_stand_for_pads_at_corners(engine, across):
    """They hold as stiffly against motion, and three times so against turning about themselves."""
    pinch, brick = Pinch(across, STUDY_PADS, side=0.02), engine.network.scene.placed[16]
    center, axis = np.array(brick.position), np.array(brick.width_axis)
    if across == Across.THICKNESS:
        axis = np.cross(brick.length_axis, axis)
    even, corners = (
        pad_stiffness(engine.network, 16, center, p) for p in (pinch, pads_at_corners(pinch))
    )
    np.testing.assert_allclose(corners[:3, :3], even[:3, :3], atol=1e-6)
    turning = 2 * pinch.stiffness.tangential * pinch.side**4 / 6
    assert axis @ even[3:, 3:] @ axis == pytest.approx(turning)
    assert axis @ corners[3:, 3:] @ axis == pytest.approx(3 * turning)


def test_the_pads_of_all_readings_are_named_and_found_again(engine):
    names = {(r.grip, 1e3 * r.pinch.side if r.pinch else 0.0, r.joint) for r in readings()}
    assert len(names) == len(readings()) == 28
    for name in names:
        reading = Reading.of(*name)
        assert (reading.grip, reading.joint) == (name[0], name[2])
        assert isinstance(reading.engine(engine.network), AtCorners) == (name[2] == CORNERS)


def test_softer_joints_move_more_and_a_node_lets_the_brick_turn(engine, step):
    pinch = Pinch(Across.WIDTH, STUDY_PADS, side=0.02)
    whole, half, node = (
        moved(reading.engine(engine.network), step).max()
        for reading in (Reading(pinch=pinch), Reading("halves in series", pinch), Reading())
    )
    assert node > half > whole


def test_nothing_breaks_or_slips_and_a_bond_too_weak_would_tell(engine, step):
    tension, shear = stresses(Reading().engine(engine.network), step)
    assert 0 < tension < 3e6
    assert 0 < shear < 1
    table = pd.DataFrame([row_of(engine, step, Reading())])
    assert table["shear_used"][0] == shear
    assert within_limits(table)
    assert not within_limits(table.assign(shear_used=-0.1))  # tension beyond all shear
    assert not within_limits(table.assign(tension_MPa=3.1))


def test_errors_are_those_of_the_first_model():
    assert error(np.array([2.0, 1.0]), np.array([1.0, 2.0])) == pytest.approx(25.0)


def test_the_best_pads_are_the_least_far_from_print():
    study = pd.Series({17: 20.0, 23: -10.0})
    rows = [("pads, width", 10.0, "a", 20.0, 0.0), ("pads, width", 12.0, "a", 19.0, -5.0),
            ("pads, width", 14.0, "b", 20.0, -9.0)]  # fmt: skip
    table = pd.DataFrame(rows, columns=["grip", "side_mm", "joint", 17, 23])
    best = best_sides(table.set_index(["grip", "side_mm", "joint"]), study)
    assert list(best.index.get_level_values("side_mm")) == [14.0, 12.0]


def test_the_largest_fall_is_between_the_arches_where_print_falls():
    rows = [("pads, width", 10.0, "a", 9.0, 2.0), ("pads, width", 12.0, "b", 1.0, 8.0)]
    table = pd.DataFrame(rows, columns=["grip", "side_mm", "joint", 17, 23])
    text = largest_fall(table.set_index(["grip", "side_mm", "joint"]), pd.Series({17: 20, 23: -10}))
    assert text.startswith("from 17 to 23 bricks print falls by 30.0 points, of 2 readings none by")
    assert text.endswith("more than 7.0: pads, width, 10 mm, a")


def test_stored_rows_are_called_stored_and_missing_ones_are_named(
    monkeypatch, tmp_path, engine, step
):
    monkeypatch.setattr(discrete_arches, "RESULTS", tmp_path)
    empty, source = witness_rows(engine, [step], None)
    assert (len(empty), source) == (0, "no rows are stored")
    assert len(missing(empty, [step])) == 4
    row = {"bricks": 17, "pads": "width", "spread": "even"}
    monkeypatch.setattr(discrete_arches, "witness", lambda *_: pd.DataFrame([row]))
    assert witness_rows(engine, [step], "some python")[1] == "asked now"
    table, source = witness_rows(engine, [step], None)
    assert source.startswith("stored rows")
    assert missing(table, [step]) == [
        "17 bricks, pads width, corners",
        "17 bricks, pads thickness, corners",
        "17 bricks, pads thickness, even",
    ]


def test_the_stored_witness_rows_stand_beside_the_engine_as_it_is(engine, step):
    """Rows of LMGC90 that were stored with another engine would show here."""
    rows = pd.read_csv(RESULTS / "arches_lmgc90.csv")
    for row in rows[rows["bricks"] == 17].itertuples():
        joint = CORNERS if row.spread == "corners" else "as printed"
        reading = Reading(
            joint, Pinch(Across[row.pads.upper()], STUDY_PADS, side=1e-3 * row.side_mm)
        )
        assert row_of(engine, step, reading)["error_pct"] == pytest.approx(
            row.engine_error_pct, rel=1e-3
        )


def test_the_study_compares_as_many_nodes(engine):
    study = printed("de_validation").set_index("bricks")["nodes"]
    for bricks, number in STEPS.items():
        step = sequential(engine.network)[number - 1]
        assert len(moved(engine, step)) == study[bricks]
