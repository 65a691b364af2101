"""Robots that are drawn: arms end where they hold, and stand where their reach says."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from experiments.harness.scenes import running_bond
from seqopt.engines.registry import make_engine
from seqopt.network.build import build_network
from seqopt.report._robots import Cell, arm_data
from seqopt.report.page import Build, report_page
from seqopt.responses.table import analyze
from seqopt.scene.parts import Robot, Side, Sphere
from seqopt.sequence.methods import sequential
from tests.strategies import builds

FRONT = Side(toward=(0.0, -1.0, 0.0), point=(0.0, 9.0, 0.0))
ROBOTS = (
    Robot(name="left", payload=5000.0, reach=Sphere(center=(-0.3, -0.5, 0.4), radius=2.0)),
    Robot(name="front", payload=5000.0, reach=FRONT),
    Robot(name="mobile", payload=5000.0),
)
SCENE = replace(running_bond(4, 3), robots=ROBOTS)
STEPS = sequential(build_network(SCENE))


@settings(max_examples=15)
@given(scene=builds())
def test_an_arm_leads_from_the_ground_to_the_node(scene):
    cell, up = Cell(scene), np.array(scene.up)
    for robot in scene.robots:
        for node in scene.bricks[0].nodes:
            points = cell.arm(robot, node)
            np.testing.assert_allclose(points[-1], scene.node_position(node))
            foot, shoulder, elbow, wrist, _ = points
            assert foot @ up == pytest.approx(cell.level)
            np.testing.assert_allclose(shoulder, cell.shoulders[robot.name][0])
            links = [np.linalg.norm(elbow - shoulder), np.linalg.norm(wrist - elbow)]
            assert links[0] == pytest.approx(links[1], rel=1e-6)
            assert elbow @ up >= min(shoulder @ up, wrist @ up) - 1e-9  # it hangs never through
        assert cell.arm(robot, None)[0] @ up == pytest.approx(cell.level)  # it is idle
    assert (cell.corners @ up).min() == pytest.approx(cell.level)


def test_postures_that_are_known_are_drawn_as_they_are():
    own = np.arange(12.0).reshape(4, 3)
    lines = [None, *[own] * (len(STEPS) - 1)]
    data = arm_data(SCENE, STEPS, {"front": lines})
    drawn = [data["at"][s][1] for s in range(len(STEPS))]
    assert drawn[0] == -1
    assert [data["lines"][i] for i in drawn[1:]] == [own.tolist()] * (len(STEPS) - 1)
    assert data["at"][0][0] >= 0  # of another robot a sketch


@pytest.fixture(scope="module")
def text():
    engine = make_engine("compliance", build_network(SCENE))
    return report_page(engine, [Build("sequential", STEPS, analyze(engine, STEPS))], "A wall.")


def test_a_page_has_arms(text):
    data = json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.S)[1])
    (build,) = data["builds"]
    for step, row in zip(STEPS, build["arms"]["at"], strict=True):
        for node, place in zip(step.grips, row, strict=True):
            if node is not None:
                tip = build["arms"]["lines"][place][-1]
                assert tip == pytest.approx(SCENE.node_position(node), abs=1e-4)
