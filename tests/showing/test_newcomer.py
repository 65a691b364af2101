"""From nothing to a picture and a page with one import: own arch, own wall, robots, both sides."""

from __future__ import annotations

import pandas as pd
import pytest

import seqopt


def test_one_line_makes_a_plan_that_shows_itself():
    plan = seqopt.optimize("arch:span=2,rise=0.8", "free", robots=2, rules="least_grips=1")
    assert "<table" in plan._repr_html_()
    assert len(plan.table()) > 0
    assert plan.gantt().axes
    assert len(set(plan.grips()["robot"])) == 2
    with pytest.raises(seqopt.SeqoptError, match="robots"):
        plan.engine.network.scene.with_robots("left")


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
