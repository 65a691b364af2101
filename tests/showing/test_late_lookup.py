"""The one lookup against the order of the rooms: what it names exists, what it lacks is said."""

from __future__ import annotations

import subprocess
import sys
import webbrowser
from importlib import import_module

import pytest

import seqopt
from seqopt._registry import OFFERS, VIEWS
from seqopt._showing import Page, display
from seqopt.errors import ExtraError
from seqopt.plan.plan import Plan
from seqopt.problem.amounts import Amount
from seqopt.report._gantt import gantt_picture

WITHOUT = """
import sys
sys.modules["matplotlib"] = None  # as if it were not installed
import seqopt
scene = seqopt.load_scene("wall:columns=2,courses=2")
plan = seqopt.optimize(scene)
for value in (scene, plan.engine.network, plan.problem.schedule, plan.problem, plan):
    html = value._repr_html_()
    assert "<table" in html and "<img" not in html, html
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
