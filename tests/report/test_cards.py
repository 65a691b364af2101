"""What a notebook shows: what a value says, escaped, light, with pictures."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from html import escape

import pytest
from PIL import Image

import seqopt
from seqopt.problem.problem import Orders
from seqopt.responses.table import force_column

HEAVIEST = 60_000  # letters of HTML


@pytest.fixture(scope="module")
def values():
    scene = seqopt.load_scene("wall:columns=2,courses=3")
    plan, free = seqopt.optimize(scene, criterion="worst-ratio"), seqopt.optimize(scene, "free")
    posed = plan.problem
    robust = posed.but(scenarios=seqopt.scenarios(scene, count=2, seed=1).scenes)
    found = [plan, free, posed, free.problem, free.problem.but(orders=Orders.TIED), robust]
    found += [posed.schedule, scene]
    return {type(value).__name__: value for value in found}


def images(html):
    found = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    return [Image.open(io.BytesIO(base64.b64decode(text))) for text in found]


def test_every_value_says_what_it_is_with_a_picture_and_is_light(values):
    for name, value in values.items():
        html = value._repr_html_()
        assert f"<p>{escape(repr(value))}</p>" in html, name
        assert images(html), name
        assert len(html) < HEAVIEST, name


def test_a_plan_says_what_its_robots_hold(values):
    plan = values["Plan"]
    said = plan._repr_html_()
    scene = plan.engine.network.scene
    most = max(
        float(plan.responses()[force_column(robot)].max()) / robot.payload for robot in scene.robots
    )
    assert f"{100 * most:.0f} % at most" in said


def test_names_of_others_are_escaped(values):
    wild = replace(values["Scene"], name="<script>alert(1)</script>")
    html = wild._repr_html_()
    assert "<script" not in html
    assert "&lt;script&gt;" in html
