"""What a notebook shows; what a page opens with; every plan says what it took."""

import base64
import io
import json
import re
from dataclasses import replace
from html import escape

import numpy as np
import pytest
from PIL import Image

import seqopt
from seqopt.problem.problem import Orders
from seqopt.problem.requirements import payload_uses
from seqopt.report.page import Build, report_page
from seqopt.report.text import _deciding_step, _headline, _in_a_sentence
from seqopt.responses.table import Departure, analyze, force_column
from seqopt.sequence.methods import sequential
from seqopt.stability.failure_map import BuildProver, BuildVerdicts
from seqopt.stability.verdict import Verdict
from tests.browser import BROWSER, browsed, browses
from tests.commands import command

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


@pytest.mark.slow
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


# what a page opens with: the step that decides, one sentence, and a summary on one sheet
STANDS, FALLS, OPEN = Verdict.STANDS, Verdict.FALLS, Verdict.UNDECIDED
browser = pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")


@pytest.fixture(scope="module")
def steps(engine25):
    return sequential(engine25.network)


@pytest.fixture(scope="module")
def table(engine25, steps):
    """A build within all payloads: what exceeds one is half of it."""
    found = analyze(engine25, steps)
    found.loc[46, "F_rob2_N"] = 196.2
    return found


def dry(*wrong, verdict=FALLS):
    """Return verdicts of a build of 49 steps, some of which do not stand."""
    found = tuple(verdict if number in wrong else STANDS for number in range(1, 50))
    first = wrong[0] if wrong and verdict is FALLS else 0
    return BuildVerdicts("dry", found, first, "7" * bool(first), "6-7" * bool(first))


def test_one_sentence_says_what_can_be_acted_on(engine25, table):
    scene = engine25.network.scene
    said = _in_a_sentence(scene, table, [dry()])
    assert said == (
        "2 robots build arch25 in 49 steps; all within payload, 95 % at most (robot 1 in step 26); "
        "every step stands, dry."
    )
    assert "; whether its steps stand was not asked." in _in_a_sentence(scene, table)
    unknown = _in_a_sentence(scene, table, [dry(3, 4, verdict=OPEN)])
    assert "of 2 steps it is not known whether they stand dry" in unknown
    assert "every step" not in unknown


@pytest.mark.parametrize(
    ("payloads", "robot", "brick", "step"),
    [(["rob2=250"], "rob2", None, 44), (["rob1=80"], "rob1", 1, 1), (["rob2=80"], "rob2", 2, 2)],
)
def test_the_largest_share_is_of_any_robot_held_or_carried(
    engine25, table, payloads, robot, brick, step
):
    scene = engine25.network.scene.with_payloads(*payloads)
    quiet = table.copy()
    if brick is not None:  # what is carried counts where grips bear little
        for each in scene.robots:
            quiet[force_column(each)] *= 0.01
    weight = {b.name: b.mass * np.linalg.norm(scene.gravity) for b in scene.bricks}
    held = table["F_rob2_N"].abs().max() if brick is None else weight[brick]
    payload = next(r.payload for r in scene.robots if r.name == robot)
    use = max(payload_uses(scene, quiet), key=lambda each: each.share)
    assert use[1:] == (robot, step, brick)
    assert use.share == pytest.approx(held / payload)
    does = "" if brick is None else f" carries brick {brick}"
    assert f"payloads used up to {100 * use.share:.3g} % ({robot}{does}, step {step}); " in (
        _headline(scene, quiet)
    )
    if use.share <= 1:
        said = _in_a_sentence(scene, quiet)
        assert f"{100 * use.share:.0f} % at most (robot {robot[-1]}{does} in step {step})" in said


def test_what_cannot_be_built_is_said_first(engine25, table):
    scene, over = engine25.network.scene, table.copy()
    over.loc[46, "F_rob2_N"] = 500.0
    said = _in_a_sentence(scene, over, [dry(9, 12)])
    assert said == (
        "Not buildable: payload exceeded in 1 of 49 steps, first in step 47 (robot 2 would hold up "
        "to 500 N and can hold 392.4 N); dry, 2 of 49 steps fall, the first is step 9 (brick 7, "
        "joint 6-7)."
    )
    known = [dry(9), BuildVerdicts("epoxy", (STANDS,) * 49)]
    said = _in_a_sentence(scene, table, known)
    assert said.startswith("2 robots build arch25 in 49 steps; ")  # with the mortar of the scene
    assert "; dry, step 9 falls (brick 7, joint 6-7); every step stands with epoxy." in said
    arms = _in_a_sentence(scene, table, known, faults=["rob1 reaches no posture (step 3)"])
    assert arms.startswith("Not buildable: rob1 reaches no posture (step 3); ")
    left = _in_a_sentence(scene, table, known, [Departure("rotation", "1 rad, too much", (3,))])
    assert left.startswith("Outside the linear range: rotation of up to 1 rad, too much (step 3).")


def test_the_step_that_decides_is_never_one_that_nobody_holds(engine25, table):
    scene = engine25.network.scene
    shares = [table[f"F_rob{k}_N"].abs().max() for k in (1, 2)]
    assert _deciding_step(scene, table, ()) == 25
    assert table.loc[25, "F_rob1_N"] == max(shares)
    assert _deciding_step(scene, table, [dry(9)]) == 8
    assert _deciding_step(scene, table, [dry(9), dry()]) == 25  # it stands with the last mortar
    left = [Departure("rotation", "1 rad, too much", (7, 8))]
    assert _deciding_step(scene, table, [dry(9)], left) == 6
    over = table.copy()
    over.loc[[3, 30], "F_rob1_N"] = 500.0
    assert _deciding_step(scene, over, [dry(9)]) == 3


@pytest.mark.slow
@browser
def test_a_browser_opens_the_step_that_decides_and_shows_every_verdict(
    engine25, steps, table, tmp_path
):
    known = [dry(9), BuildVerdicts("epoxy", (STANDS,) * 49)]
    pressed = table.assign(F_max_N=table["F_max_N"].where(table["step"] < 49, -50.0))
    build = Build("sequential", steps, pressed, known)  # in its last step all edges are pressed
    page = tmp_path / "report.html"
    page.write_text(report_page(engine25, [build], "Two robots take turns."), "utf-8")
    if not browses():
        pytest.skip("Chromium does not run here")
    text, _ = browsed(tmp_path, f"file://{page}")
    assert "sequential, step 26 of 49" in text
    assert 'src="data:image/png' in text  # what is printed
    assert "dry: 1 of 49 falls" in text
    assert "with epoxy: every step stands" in text
    rows = re.findall(r'<tr data-step="(\d+)".*?</tr>', text, re.S)
    assert rows == [str(number) for number in range(1, 50)]
    (ninth,) = re.findall(r'<tr data-step="9".*?</tr>', text, re.S)
    assert ninth.index(">falls<") < ninth.index(">stands<")
    assert "<td>robot 3</td>" in re.sub(r"<span[^>]*></span>", "", text)
    lines = re.findall(r'<polyline points="([^"]*)"', text)
    heights = [float(point.split(",")[1]) for line in lines for point in line.split()]
    assert len(lines) == 4
    assert max(heights) == 172  # on the axis, not below it


# every plan says what it took, and what had to be
SMALL = "chain:bricks=7"


@pytest.mark.slow
def test_verdicts_are_counted_once():
    plan = seqopt.optimize(SMALL, "free", aim="minmax,steps", stands="dry")
    sets = plan.spent["verdicts"]
    assert min(sets["asked"], sets["programs"]) > 0
    prover = BuildProver(plan.engine.network)
    for asked in ((plan.steps,), (plan.steps, plan.steps)):  # what is known is not proven again
        prover.of_builds(dict(enumerate(asked)))
        states = {(step.bricks, step.grips) for step in plan.steps}
        assert prover.spent["verdicts"] == 2 * len(states) >= prover.proven
    before = prover.proven
    prover.of_builds({"bare": [replace(step, grips=(None,) * 3) for step in plan.steps[1:3]]})
    assert prover.proven > before


@pytest.mark.slow
def test_the_summary_has_it(tmp_path, capsys):
    command(capsys, "optimize", SMALL, "--out", tmp_path / "plan")
    found = json.loads((tmp_path / "plan/summary.json").read_text())
    assert {*found["spent"]} == {"models", "responses", "verdicts"}
    assert min(found["spent"]["models"]["proof"], found["spent_on_showing"]["proven"]) > 0
    assert found["spent_on_showing"]["pictures"] == 0
