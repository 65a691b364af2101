"""Stiffnesses from load tests: found again where they are known, and left open where they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize

from experiments.calibration.parts import barrel_vaults as barrel
from experiments.calibration.parts.load_tests import calibrate
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene

SHIFT, TURN = 1.7, 0.4  # factors that are to be found
SLIDE, BEND = 3e7, 4e5


def bar():
    """A cantilever of five bricks whose joints are alike."""
    shape = ArchShape(
        pitch=[0.0] * 5,
        pattern="V",
        gap=0.0,
        dimensions=(0.2, 0.1, 0.05),
        closed=False,
        translational_stiffness=(SLIDE,) * 3,
        rotational_stiffness=(BEND,) * 3,
    )
    return arch_scene(shape)


def moved(brick, force):
    """How far a brick's centroid moves along a force, mm: in closed form, with both factors."""
    scene, force = bar(), np.array(force)
    arms = scene.bricks[brick - 1].position[0] - build_network(scene).springs.position[:brick, 0]
    across = force[1] ** 2 + force[2] ** 2
    work = (force @ force) * brick / (SHIFT * SLIDE) + across * (arms**2).sum() / (TURN * BEND)
    return 1e3 * work / np.linalg.norm(force)


def row(brick, force, **more):
    x, y, z = force
    return {"scene": bar(), "brick": brick, "force_x_N": x, "force_y_N": y, "force_z_N": z} | {
        "displacement_mm": moved(brick, force),
        **more,
    }


DOWN, ALONG = (0.0, 0.0, -10.0), (25.0, 0.0, 0.0)
ROWS = [row(5, DOWN), row(2, DOWN), row(4, ALONG), row(1, DOWN)]


def test_known_factors_are_found():
    fit = calibrate(pd.DataFrame(ROWS))
    assert (fit.translational, fit.rotational) == pytest.approx((SHIFT, TURN), rel=1e-6)
    assert fit.intervals[0] == pytest.approx((SHIFT, SHIFT), rel=1e-4)
    assert np.abs(fit.tests.error_percent).max() < 1e-4
    shares = [1 - 5 / (SHIFT * SLIDE) / (moved(5, DOWN) / 1e4), 0.0]
    assert fit.tests.turning_share[[0, 2]].tolist() == pytest.approx(shares, abs=1e-6)
    assert fit.fixes == "fixed: translational and rotational"


def test_errors_widen_what_is_known():
    """Ten per cent up and down: the true factors are within the intervals."""
    table = pd.DataFrame(ROWS * 4)
    table["displacement_mm"] *= np.exp(0.1 * np.random.default_rng(1).normal(size=16))
    fit = calibrate(table)
    for (low, high), true in zip(fit.intervals, (SHIFT, TURN), strict=True):
        assert low < true < high < 1.5 * low
    assert 1.01 < fit.combined[2] < 1.1


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([ROWS[2]] * 3, "fixed: translational; not fixed: rotational; joints turn for the same"),
        ([ROWS[0]] * 3, "fixed: neither alone; .*; joints turn for the same share"),
        (ROWS[:2], "fixed: neither alone; .*; as many numbers as tests"),
    ],
)
def test_what_tests_do_not_fix_is_said(rows, said):
    fit = calibrate(pd.DataFrame(rows))
    assert pd.Series(fit.fixes).str.match(said).all()
    assert (0.0, np.inf) in fit.intervals
    assert np.abs(fit.tests.error_percent).max() < 1e-4


def test_it_is_the_least_of_squares_on_tested_vaults():
    """The same sum over closed forms of three barrel vaults, by another minimizer."""
    tests = barrel.vaults()[:3]
    law = barrel.laws(tests)[barrel.BED]
    rows = []
    for vault in tests:
        scene = barrel.scene(vault, 7e10 * vault.area, 7e10 * barrel.LAWS[barrel.BED](vault))
        x = scene.grounds[0].position[0] + float(barrel.chain(vault).loads[0])
        brick = scene.bricks[sum(joint.position[0] <= x for joint in scene.joints)]
        place = {"x_m": x, "y_m": brick.position[1], "z_m": brick.position[2]}
        load = {"force_x_N": 0.0, "force_y_N": 0.0, "force_z_N": -1000.0}
        measured = {"displacement_mm": 1e6 / vault.measured}
        rows.append({"scene": scene, "brick": brick.name, **place, **load, **measured})

    def squares(logs):
        return (np.log1p(barrel.errors(law, tuple(7e10 * np.exp(logs)))) ** 2).sum()

    other = minimize(squares, np.zeros(2), method="Nelder-Mead", options={"fatol": 1e-14})
    fit = calibrate(pd.DataFrame(rows))
    own = np.log([fit.translational, fit.rotational])
    assert squares(own) == pytest.approx(squares(other.x), rel=1e-6)
    assert fit.tests.error_percent.abs().max() > 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"displacement_mm": -1.0}, "test 1: displacement_mm is -1.0; give mm along the force"),
        ({"displacement_mm": "x"}, "test 1: displacement_mm is x; give mm"),
        ({"force_z_N": 0.0}, "test 1: its force is zero; give N"),
        ({"brick": 9}, "load on brick 9: there is no brick 9"),
        ({"scene": "none"}, "scene none: no such built-in scene"),
        ({"x_m": 0.1}, "load on brick 5: position is .*; give three finite numbers"),
    ],
)
def test_what_is_no_test_is_refused(change, message):
    with pytest.raises(SceneError, match=message):
        calibrate(pd.DataFrame([{**ROWS[0], **change}]))


def test_a_table_that_lacks_columns_is_refused():
    with pytest.raises(SceneError, match="columns brick, displacement_mm are missing; give a row"):
        calibrate(pd.DataFrame(ROWS).drop(columns=["brick", "displacement_mm"]))
    with pytest.raises(SceneError, match="tests: there is none"):
        calibrate(pd.DataFrame(ROWS[:0], columns=list(ROWS[0])))


def test_what_else_loads_a_scene_is_no_part_of_a_test():
    scene = bar()
    ground = replace(scene.grounds[0], movement=(0.0, 0.0, -0.1))
    other = replace(scene, wind=(1.0, 0.0, 0.0), grounds=(ground,))
    fit = calibrate(pd.DataFrame([{**each, "scene": other} for each in ROWS]))
    assert fit.translational == pytest.approx(SHIFT, rel=1e-6)
