"""The page with the step viewer; robots that are drawn."""

import base64
import gzip
import hashlib
import json
import re
import sys
from dataclasses import replace
from html import unescape
from importlib import resources

import numpy as np
import pytest
from hypothesis import given, settings

import seqopt
from seqopt._cli.main import main
from seqopt._files import Page
from seqopt.engines.interface import Want
from seqopt.engines.registry import make_engine
from seqopt.errors import ExtraError, ProblemError
from seqopt.exchange._files import csv_text
from seqopt.network.network import build_network
from seqopt.report import _robots, page
from seqopt.report._notebook import _viewer_class
from seqopt.report._pages import OVER, plan_page
from seqopt.report._robots import Cell, arm_data
from seqopt.report.page import LARGEST, Build, report_page
from seqopt.responses.table import analyze
from seqopt.scene.parts import Robot, Side, Sphere
from seqopt.sequence.methods import sequential
from tests import strategies
from tests.browser import BROWSER, PLAIN, WORDS, browsed, browses
from tests.builders import running_bond

browser = pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
SMALL = "chain:bricks=7"


@pytest.fixture(scope="module")
def builds(engine25):
    found = {}
    for method in (seqopt.sequential, seqopt.cantilever):
        steps = method(engine25.network)
        found[method.__name__] = Build(method.__name__, steps, seqopt.analyze(engine25, steps))
    return found


def unpacked(field, count):
    numbers = np.frombuffer(gzip.decompress(base64.b64decode(field["data"])), dtype="<i2")
    return numbers.reshape(count, field["width"]) * np.array(field["scale"])[:, None]


def data_of(text):
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.S)
    return json.loads(found[1])


def test_what_is_read_is_the_table_digit_by_digit(engine25, builds):
    build = builds["sequential"]
    (data,) = data_of(report_page(engine25, [build], ""))["builds"]
    lines = csv_text(build.table).splitlines()
    assert [",".join(row) for row in [data["columns"], *data["rows"]]] == lines
    assert [step["grips"] for step in data["steps"]] == [list(step.grips) for step in build.steps]
    assert {*data["forces"]} <= {*data["columns"]}


def test_what_is_drawn_is_what_the_engine_answers(engine25, builds):
    build = builds["cantilever"]
    (data,) = data_of(report_page(engine25, [build], ""))["builds"]
    count = len(build.steps)
    twist, edge = (unpacked(data[name], count) for name in ("twist", "edge"))
    for i in (0, 7, count - 1):
        step = build.steps[i]
        held = np.array([step.held], dtype=int).reshape(1, -1)
        fields = engine25.solve(step.bricks, held, Want.EDGES | Want.BRICKS)
        for found, exact in (
            (twist[i], fields.brick_twist.ravel()),
            (edge[i], fields.edge_force.ravel()),
        ):
            assert np.abs(found[: len(exact)] - exact).max() <= np.abs(exact).max() / LARGEST
            assert not found[len(exact) :].any()  # bricks that are not there yet


def test_the_structure_is_that_of_the_network(engine25, builds):
    network = engine25.network
    data = data_of(report_page(engine25, [builds["sequential"]], ""))["structure"]
    assert len(data["bricks"]) == 25
    assert len(data["edges"]) == len(network.edge_nodes)
    for brick, drawn in zip(network.scene.placed, data["bricks"], strict=True):
        corners = np.array(drawn["corners"])
        assert corners.mean(axis=0) == pytest.approx(brick.position, abs=2e-6)
        faces = np.array([corners[list(face)] for face in drawn["faces"]])
        normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 1])
        outward = (normal * (faces.mean(axis=1) - corners.mean(axis=0))).sum(axis=1)
        assert (outward > 0).all()
        volume = (normal * faces.mean(axis=1)).sum() / 3
        assert volume == pytest.approx(np.prod(brick.dimensions), rel=1e-3)


def test_a_page_is_one_file_that_asks_for_nothing(engine25, builds):
    text = report_page(engine25, list(builds.values()), "A & B <first>")
    assert "A &amp; B &lt;first&gt;" in text
    assert not re.search(r'(src|href)="(?!data:)', text)
    assert len(data_of(text)["builds"]) == 2
    assert len(text) < 2e6
    with pytest.raises(ProblemError, match="a report of nothing"):
        report_page(engine25, [], "")


def test_names_of_others_do_not_end_the_script(engine25, builds):
    wild = replace(builds["sequential"], name="</script><script>alert(1)</script>")
    text = report_page(engine25, [wild], "")
    assert "<script>alert" not in text
    assert data_of(text)["builds"][0]["name"] == wild.name


def test_fields_are_left_out_where_there_are_too_many_and_it_says_so(engine25, builds, monkeypatch):
    monkeypatch.setattr(page, "MOST", 15_000)  # numbers: enough for one of the two
    data = data_of(report_page(engine25, list(builds.values()), ""))
    assert data["note"] == f"{page.LEFT_OUT}: there are too many steps."
    assert [build["twist"] is None for build in data["builds"]] == [False, True]
    monkeypatch.undo()
    assert data_of(report_page(engine25, list(builds.values()), ""))["note"] == ""


@pytest.mark.slow
def test_commands_write_it_and_folders_are_read_again(capsys, tmp_path):
    out = tmp_path / "best"
    assert main(["optimize", SMALL, "--formulation", "overlap_dp", "--out", str(out)]) == 0
    first = data_of((out / "report.html").read_text("utf-8"))
    assert first["builds"][0]["name"] == "overlap_dp"
    plan = (out / "plan.csv").read_text("utf-8").splitlines()
    assert [",".join(row) for row in first["builds"][0]["rows"]] == plan[1:]
    assert main(["report", SMALL, str(out), "--out", str(tmp_path / "again.html")]) == 0
    again = data_of((tmp_path / "again.html").read_text("utf-8"))
    assert [build["name"] for build in again["builds"]] == ["plan"]
    assert again["builds"][0]["steps"] == first["builds"][0]["steps"]
    capsys.readouterr()
    assert main(["report", str(tmp_path)]) == 2
    assert "there is no plan in it" in capsys.readouterr().err


@pytest.fixture
def shown(tmp_path):
    """Show a page as a browser has it once its script has run, and what it said of errors."""
    if not browses():
        pytest.skip("Chromium does not run here")

    def show(path, state="", words=WORDS):
        text, said = browsed(tmp_path, f"file://{path}#{state}", words)
        return text, [line for line in said.splitlines() if "CONSOLE" in line and "error" in line]

    return show


@pytest.mark.slow
@browser
def test_a_browser_shows_the_numbers_of_the_step_that_is_asked_for(
    engine25, builds, shown, tmp_path
):
    path = tmp_path / "report.html"
    path.write_text(report_page(engine25, list(builds.values()), "Two ways."), "utf-8")
    for state, name, number, words in (
        ("step=12&build=sequential", "sequential", 12, PLAIN),
        ("step=30&build=cantilever&forces&magnify=1000", "cantilever", 30, WORDS),
    ):
        text, errors = shown(path, state, words)
        assert errors == []
        assert 'data-ready="true"' in text
        assert f"{name}, step {number} of 49" in text
        row = builds[name].table.iloc[number - 1]
        for column, unit in (("M_sup_Nm", ""), ("F_max_N", ""), ("D_max_1e-3mm", " µm")):
            assert f">{row[column]:.6g}{unit}<" in text
    table = builds["sequential"].table.assign(F_sup_N=3.33e-16)
    noise = replace(builds["sequential"], table=table)
    path.write_text(report_page(engine25, [noise], ""), "utf-8")
    text, _ = shown(path, "step=12", PLAIN)
    assert "<td>support force, N</td><td>0</td>" in text.replace(' class=""', "")
    broken = path.read_text("utf-8").replace('"steps":[', '"step":[')
    path.write_text(broken, "utf-8")
    assert 'data-ready="true"' not in shown(path, words=PLAIN)[0]  # the control


@pytest.mark.slow
@browser
def test_a_build_in_another_order_shows_its_own_bricks(engine25, builds, shown, tmp_path):
    own = seqopt.build_network(engine25.network.scene, "reversed")
    steps = seqopt.sequential(own)
    table = seqopt.analyze(seqopt.make_engine("compliance", own), steps)
    other = Build("backward", steps, table, order=own.scene.build_order)
    text = report_page(engine25, [builds["sequential"], other], "")
    data = data_of(text)
    assert data["note"].endswith("they place bricks in another order than the scene.")
    assert [build["twist"] is None for build in data["builds"]] == [False, True]
    assert [build["rank"] for build in data["builds"]] == [None, [*range(24, -1, -1)]]
    (path := tmp_path / "report.html").write_text(text, "utf-8")
    for build, brick in (("sequential", 1), ("backward", 25)):
        found, errors = shown(path, f"step=1&build={build}", PLAIN)
        assert errors == []
        assert f"Brick {brick} is placed by robot 1; 1 of 25 bricks stand." in found


FRAMED = """<!doctype html><body data-told="[]"><script type="module">
const bytes = Uint8Array.from(atob("%s"), (c) => c.charCodeAt(0)), told = [], heard = {};
const { default: widget } = await import("data:text/javascript;base64,%s");
const state = { page: new TextDecoder().decode(bytes), height: 500, step: 0, build: "", ...%s };
const model = {
  get: (name) => state[name],
  set: (name, to) => { if (state[name] !== to) { state[name] = to; heard.on(); } },
  save_changes: () => {
    told.push([state.step, state.build]);
    document.body.dataset.told = JSON.stringify(told);
    if (told.length === 1) { state.step += 3; heard.on(); }  // as Python does
  },
  on: (_, call) => { heard.on = call; },
  off: () => {},
};
widget.render({ model, el: document.body });
</script></body>"""


@pytest.mark.slow
@browser
@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({}, [[47, "sequential"], [49, "sequential"]]),
        ({"step": 12, "build": "cantilever"}, [[12, "cantilever"], [15, "cantilever"]]),
    ],
)
def test_a_widget_and_python_agree_on_the_step(engine25, builds, shown, tmp_path, asked, told):
    page = report_page(engine25, list(builds.values()), "Two ways.")
    script = (resources.files("seqopt") / "data/viewer/widget.mjs").read_bytes()
    page64, script64 = (base64.b64encode(part).decode() for part in (page.encode(), script))
    (path := tmp_path / "widget.html").write_text(FRAMED % (page64, script64, json.dumps(asked)))
    text, errors = shown(path, words=PLAIN)
    assert errors == []
    assert json.loads(unescape(re.search('data-told="(.*?)"', text)[1])) == told


def test_a_page_is_a_widget_with_traits(engine25, builds):
    pytest.importorskip("anywidget")
    page = Page(report_page(engine25, list(builds.values()), ""), height=400)
    widget = page.widget(step=7)
    state = widget.get_state()
    assert {name: state[name] for name in ("page", "height", "step", "build")} == {
        "page": page.text,
        "height": 400,
        "step": 7,
        "build": "",
    }
    assert "export default" in state["_esm"]
    with pytest.raises(Exception, match="-1"):
        widget.step = -1


def test_without_anywidget_one_line_says_what_to_install(monkeypatch):
    _viewer_class.cache_clear()
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(ExtraError, match=r"pip install 'seqopt\[notebook\]'"):
        Page("").widget()


@pytest.mark.slow
def test_what_robots_cannot_carry_is_said_first_in_the_table_and_at_the_step(engine25, builds):
    table = builds["sequential"].table.copy()
    table.loc[[3, 8], "F_rob1_N"] = [1565.0, 400.0]
    text = plan_page(
        seqopt.GivenSequence(engine25, builds["sequential"].steps, "cascade"), table=table
    )
    sentence = re.search('<p id="sentence">(.*?)</p>', text)[1]
    assert sentence.startswith("Not buildable: payload exceeded in 3 of 49 steps, first in step 4 ")
    assert "(robot 1 would hold up to 1,565 N and can hold 392.4 N)" in sentence
    assert "a robot would hold more than it can. Such steps are marked in red<" in text
    rows = re.findall(r"<tr.*?</tr>", text.split('id="data"')[0], re.S)
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t", row) for row in rows]
    at = rows[0].index(OVER)
    assert {row[0]: row[at] for row in rows[1:]}["cascade"] == "3 steps"
    assert data_of(text)["builds"][0]["decides"] == 3
    marks = data_of(text)["builds"][0]["marks"]
    assert [k for k, said in enumerate(marks) if said] == [3, 8, 46]
    assert marks[3] == "robot 1 exceeds its payload"
    assert data_of(text)["builds"][0]["bounds"] == {"F_largest": 392.4}


def test_the_policy_names_every_script_and_style_and_nothing_else(engine25, builds):
    text = report_page(engine25, [builds["sequential"]], "")
    policy = re.search('Content-Security-Policy" content="([^"]*)"', text)[1]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    parts = re.findall(r"<(?:script|style)>(.*?)</(?:script|style)>", text, re.S)
    own = {base64.b64encode(hashlib.sha256(part.encode()).digest()).decode() for part in parts}
    assert own == set(re.findall("'sha256-([^']*)'", policy))
    assert len(own) == len(page.PARTS)
    assert text.index("Content-Security-Policy") < text.index("<style>")
    assert not re.search(
        r"<[^>]* (style|on\w+)=", re.sub(r"<script.*?</script>", "", text, flags=re.S)
    )


# robots that are drawn: arms end where they hold, and stand where their reach says
FRONT = Side(toward=(0.0, -1.0, 0.0), point=(0.0, 9.0, 0.0))
ROBOTS = (
    Robot(name="left", payload=5000.0, reach=Sphere(center=(-0.3, -0.5, 0.4), radius=2.0)),
    Robot(name="front", payload=5000.0, reach=FRONT),
    Robot(name="mobile", payload=5000.0),
)
SCENE = replace(running_bond(4, 3), robots=ROBOTS)
STEPS = sequential(build_network(SCENE))


@settings(max_examples=15)
@given(scene=strategies.builds())
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
    data = arm_data(Cell(SCENE), STEPS, {"front": lines})
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


def test_builds_side_by_side_share_what_is_drawn_alike(monkeypatch):
    """A robot that holds a node is sketched once, however many builds have it so."""
    sketched = []
    own = _robots.hold
    monkeypatch.setattr(
        _robots, "hold", lambda s, r, n: sketched.append((r.name, n)) or own(s, r, n)
    )
    engine = make_engine("compliance", build_network(SCENE))
    build = Build("sequential", STEPS, analyze(engine, STEPS))
    text = report_page(engine, [build, replace(build, name="again")], "A wall.")
    first, again = (build["arms"] for build in data_of(text)["builds"])
    assert first == again
    assert len(sketched) == len({*sketched}) > 0
