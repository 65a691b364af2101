"""What a notebook shows: numbers of the value, escaped, light, with pictures."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace

import pytest
from PIL import Image

import seqopt
from seqopt.problem.problem import Orders
from seqopt.report._notebook import facts
from seqopt.report.comparison import largest

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


def test_every_value_has_a_table_and_a_picture_and_is_light(values):
    for name, value in values.items():
        html = value._repr_html_()
        assert html.count("<tr>") > 4, name
        assert images(html), name
        assert len(html) < HEAVIEST, name
        assert html.count("<table") == html.count("</table>") == 1


def test_figures_are_those_of_the_plan(values):
    plan = values["Plan"]
    rows = facts(plan).rows
    found = largest(plan.engine.network.scene, plan.responses())
    assert rows["largest grip force, N"] == f"{found['F_rob']:.4g}"
    assert rows["largest support moment, N m"] == f"{found['M_sup']:.4g}"
    assert rows["largest tension, N"] == f"{found['T_max']:.4g}"
    assert rows["steps"] == len(plan.steps)
    grips = plan.grips()
    row = grips.loc[grips["largest_force_N"].idxmax()]
    assert f"{row['robot']} at node {row['node']}" in str(rows["at the largest grip force"])
    assert f"{rows['largest grip force, N']}</td>" in plan._repr_html_()


def test_names_of_others_are_escaped(values):
    wild = replace(values["Scene"], name="<script>alert(1)</script>")
    html = wild._repr_html_()
    assert "<script" not in html
    assert "&lt;script&gt;" in html
