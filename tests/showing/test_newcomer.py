"""From nothing to a picture and a page with one import: own arch, own wall, robots, both sides."""

from __future__ import annotations

import pandas as pd
import pytest

import seqopt

BUILDS = {
    "own arch": ("arch:span=2,rise=0.8", {}),
    "own arch, free": ("arch:span=2,rise=0.8", {"schedule": "free"}),
    "own wall": ("wall:columns=3,courses=2", {}),
    "two robots": (
        "arch:span=2,rise=0.8",
        {"schedule": "free", "robots": 2, "rules": "least_grips=1"},
    ),
    "from both sides": ("arch:span=2,rise=0.8", {"schedule": "free", "order": "ends"}),
}


QUICK = ("own arch", "own wall")


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in BUILDS]
)
def test_one_line_makes_a_plan_that_shows_itself(name):
    scene, given = BUILDS[name]
    plan = seqopt.optimize(scene, **given)
    assert "<table" in plan._repr_html_()
    assert len(plan.table()) > 0
    assert plan.gantt().axes
    used = set(plan.grips()["robot"])
    assert len(used) == given.get("robots", 3)
    if "order" in given:
        first = plan.engine.network.scene.build_order[:2]
        assert {*first} == {ground.brick for ground in plan.engine.network.scene.grounds}


def test_own_robots_build_the_same_scene():
    scene = seqopt.load_scene("wall:columns=2,courses=2")
    near = seqopt.Sphere(center=(0.0, 0.0, 0.0), radius=5.0)
    pair = [seqopt.Robot(name=name, payload=300.0, reach=near) for name in ("left", "right")]
    own = scene.with_robots(*pair)
    assert (own.robots, own.bricks) == (tuple(pair), scene.bricks)
    plan = seqopt.optimize(own, "free", rules="least_grips=1")
    assert set(plan.grips()["robot"]) == {"left", "right"}
    with pytest.raises(seqopt.SeqoptError, match="robots"):
        scene.with_robots("left")


def test_a_report_shows_plans_side_by_side():
    scene = seqopt.load_scene("wall:columns=3,courses=2")
    free, loop = seqopt.optimize(scene, "free"), seqopt.optimize(scene)
    text = free.report(loop, loop).text
    for name in ("free schedule", "overlap_dp", "overlap_dp (2)", "sequential"):
        assert f'"name":"{name}"' in text
    with pytest.raises(seqopt.SeqoptError, match="not for the same scene wall 3 x 2"):
        free.report(seqopt.optimize("wall:columns=2,courses=2"))


def test_rules_can_be_given_one_by_one_or_as_a_value():
    one = seqopt.optimize("wall:columns=2,courses=2", "free", rules="newest=placing")
    rules = seqopt.FreeRules(newest="placing")
    assert one.steps == seqopt.optimize("wall:columns=2,courses=2", "free", rules=rules).steps
    assert one.problem.moves == rules
    with pytest.raises(seqopt.SeqoptError, match="rules: only the free schedule has them"):
        seqopt.optimize("wall:columns=2,courses=2", rules=rules)


def test_a_given_sequence_shows_itself_as_a_plan_does():
    scene = seqopt.load_scene("wall:columns=2,courses=2")
    engine = seqopt.make_engine("auto", scene)
    steps = seqopt.sequential(engine.network)
    build = seqopt.GivenSequence(engine, steps, "sequential")
    pd.testing.assert_frame_equal(build.responses(), seqopt.analyze(engine, steps), rtol=1e-9)
    pd.testing.assert_frame_equal(build.table(), build.grips(), rtol=1e-9)
    assert "given, not optimized" in build._repr_html_()
    verdicts = build.stability("epoxy")["verdict"]
    assert len(verdicts) == len(steps)
    with pytest.raises(seqopt.SeqoptError, match="a Scene is not an engine"):
        seqopt.GivenSequence(scene, steps)
    with pytest.raises(seqopt.SeqoptError, match="is not a sequence of steps"):
        seqopt.GivenSequence(engine, scene)
