"""The page of a scene: its bricks by name, its nodes, and what robots reach."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest

import seqopt
from seqopt.report._scene_page import scene_page
from tests.browser import BROWSER, browsed
from tests.commands import command


@pytest.fixture(scope="module")
def scene():
    """Return an arch with a robot on a base, one beside it, and one that may be anywhere."""
    arch = seqopt.load_scene("arch:span=1.2,rise=0.5")
    ball = seqopt.Sphere(center=(0.1, -0.4, 0.3), radius=0.5)
    own = replace(arch.robots[0], reach=ball)
    return arch.with_robots(own, *arch.robots[1:])


def marks(page):
    data = re.search(r'type="application/json">(.*?)</script>', page, re.DOTALL)
    return json.loads(data[1])["structure"]["marks"]


def test_nodes_are_marked_by_who_reaches_them(scene):
    found = marks(scene_page(scene))
    free = [n for brick in scene.placed for n in brick.nodes if n not in scene.blocked_nodes]
    assert len(found["nodes"]) == len(free)
    sphere, side = found["reaches"]
    assert (sphere["center"], sphere["radius"]) == ([0.1, -0.4, 0.3], 0.5)
    assert all(abs(y - scene.robots[1].reach.point[1]) < 1e-6 for _, y, _ in side["plane"])
    alone = scene.with_robots(scene.robots[0])
    colors = [node["color"] for node in marks(scene_page(alone))["nodes"]]
    reached = sum(map(len, alone.within_reach(alone.robots[0])))
    assert 0 < reached < len(free)
    assert colors.count("") == len(free) - reached  # nobody reaches the others


@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
def test_a_browser_shows_a_scene_without_an_error(scene, tmp_path):
    path = tmp_path / "scene.html"
    path.write_text(scene_page(scene), encoding="utf-8")
    text, said = browsed(tmp_path, path.as_uri())
    assert 'data-ready="true"' in text
    assert "Uncaught" not in said
    count = len(scene.placed)
    assert f"step {count} of {count}" in text  # it opens with all bricks
    assert "build" not in text.partition('id="sentence"')[2].partition("</p>")[0]  # of no plan
    assert re.search(r'id="now"[^>]*display: none', text)


def test_the_command_names_the_page_by_the_scene(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, _ = command(capsys, "scene", "wall:columns=2,courses=2", "--view")
    assert (status, "written to wall-2-x-2.html; open it in a browser" in out) == (0, True)
    assert "Bricks, in the order of the build" in (tmp_path / "wall-2-x-2.html").read_text("utf-8")
