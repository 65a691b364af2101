"""From nothing to a picture and a page with one import: own arch, own wall, robots, both sides."""

import subprocess
import sys
import webbrowser
from importlib import import_module

import pandas as pd
import pytest

import seqopt
from seqopt._files import Page
from seqopt._registry import OFFERS, VIEWS, display
from seqopt.errors import ExtraError
from seqopt.plan.plan import Plan
from seqopt.problem.amounts import Amount
from seqopt.report._gantt import gantt_picture


def test_one_line_makes_a_plan_that_shows_itself():
    plan = seqopt.optimize("arch:span=2,rise=0.8", "free", robots=2, rules="least_grips=1")
    assert "optimal" in plan._repr_html_()
    assert len(plan.table()) > 0
    assert plan.gantt().axes
    assert len(set(plan.table()["robot"])) == 2
    with pytest.raises(seqopt.SeqoptError, match="robots"):
        plan.engine.network.scene.with_robots("left")


@pytest.mark.slow
def test_a_report_shows_plans_side_by_side():
    scene = seqopt.load_scene("wall:columns=3,courses=2")
    free, loop = seqopt.optimize(scene, "free"), seqopt.optimize(scene)
    text = free.report(loop, loop).text
    for name in ("free schedule", "overlap_dp", "overlap_dp (2)", "sequential"):
        assert f'"name":"{name}"' in text
    with pytest.raises(seqopt.SeqoptError, match="not for the same scene wall 3 x 2"):
        free.report(seqopt.optimize("wall:columns=2,courses=2"))


@pytest.mark.slow
def test_a_given_sequence_shows_itself_as_a_plan_does():
    scene = seqopt.load_scene("wall:columns=2,courses=2")
    engine = seqopt.make_engine("auto", scene)
    steps = seqopt.sequential(engine.network)
    build = seqopt.GivenSequence(engine, steps, "sequential")
    pd.testing.assert_frame_equal(build.responses(), seqopt.analyze(engine, steps), rtol=1e-9)
    assert "GivenSequence sequential of wall 2 x 2: 7 steps" in build._repr_html_()
    verdicts = build.stability("epoxy")["verdict"]
    assert len(verdicts) == len(steps)
    with pytest.raises(seqopt.SeqoptError, match="a Scene is not an engine"):
        seqopt.GivenSequence(scene, steps)
    with pytest.raises(seqopt.SeqoptError, match="is not a sequence of steps"):
        seqopt.GivenSequence(engine, scene)


WITHOUT = """
import sys
sys.modules["matplotlib"] = None  # as if it were not installed
import seqopt
scene = seqopt.load_scene("wall:columns=2,courses=2")
plan = seqopt.optimize(scene)
for value in (scene, plan.engine.network, plan.problem.schedule, plan.problem, plan):
    html = value._repr_html_()
    assert "<p>" in html and "<img" not in html, html
for draw in (scene.plot, plan.plot, plan.gantt, plan.engine.network.plot):
    try:
        draw()
    except seqopt.SeqoptError as error:
        print(error)
"""


def test_what_outer_rooms_offer_is_where_it_is_said_to_be():
    for name, module in OFFERS.items():
        found = getattr(import_module(module), name)
        assert callable(found) or isinstance(found, Amount), name
    for key, home in VIEWS.items():
        module, name = home.split(":")
        assert callable(getattr(import_module(module), name)), key
    assert display(Plan, "gantt") is gantt_picture  # as of all that are shown as builds


@pytest.mark.slow
def test_without_matplotlib_there_are_tables_and_one_line_that_says_what_to_install():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 4
    assert {*lines} == {
        "pictures need matplotlib, which is not installed: pip install 'seqopt[plot]'"
    }


def test_another_module_that_is_missing_is_not_taken_for_matplotlib(monkeypatch):
    monkeypatch.setitem(VIEWS, "Plan.nothing", "seqopt.report.nothing:any")
    with pytest.raises(ModuleNotFoundError, match=r"seqopt\.report\.nothing") as caught:
        display(Plan, "nothing")
    assert not isinstance(caught.value, ExtraError)


def test_a_page_is_framed_saved_and_opened(tmp_path, monkeypatch):
    page = Page('<p title="a & b">step</p>')
    assert '<p title="a' not in page._repr_html_()
    assert "&lt;p title=&quot;a &amp; b&quot;&gt;step" in page._repr_html_()
    assert page.save(tmp_path / "page.html").read_text("utf-8") == page.text
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    assert page.open(tmp_path / "other.html").exists()
    assert opened == [(tmp_path / "other.html").as_uri()]
    with pytest.raises(seqopt.SeqoptError, match="cannot write"):
        page.save(tmp_path / "no folder" / "page.html")
