"""What becomes of a plan where something has changed."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import seqopt
from seqopt.errors import InfeasibleError, ProblemError, StepError
from seqopt.plan.pose import states_of
from seqopt.plan.replan import compared, goes_on
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule_file import without
from seqopt.sequence.steps import Site
from tests.brute_force import ONES
from tests.builders import small_arch


def held_arch(count=6, robots=3):
    more = (seqopt.Robot(name=f"rob{k}", payload=150.0) for k in range(1, robots + 1))
    return small_arch(count).with_robots(*more)


SCENE = held_arch()
ENGINE = seqopt.make_engine("compliance", SCENE)
PLAN = seqopt.solve(seqopt.pose(ENGINE, FreeRules(), ONES, "minmax,steps"))


@given(
    st.integers(0, len(PLAN.steps)),
    st.sets(st.sampled_from(["rob1", "rob2", "rob3"])),
    st.sets(st.sampled_from(SCENE.build_order)),
)
def test_what_is_gone_is_gone_and_all_else_stays(count, lost, missing):
    site = Site.after(PLAN.steps, count)
    scene, after = without(SCENE, site, [*lost], [*missing])
    stood = [b for b in SCENE.build_order[: site.bricks] if b not in missing]
    assert [*scene.build_order[: after.bricks]] == stood
    assert sorted(scene.build_order) == sorted(SCENE.build_order)
    again = {*SCENE.build_order[: site.bricks]} & missing
    assert {*scene.build_order[len(stood) : len(stood) + len(again)]} == again
    for robot, was, now in zip(SCENE.robots, site.holds(SCENE), after.holds(scene), strict=True):
        gone = robot.name in lost or (was and SCENE.brick_of_node[was].name in missing)
        assert now == (None if gone else was)
    if not lost and not missing:
        assert (scene, after.grips) == (SCENE, site.holds(SCENE))


def test_what_hangs_on_a_missing_brick_waits_for_it():
    site = Site.after(PLAN.steps, next(s.number for s in PLAN.steps if s.bricks == 2))
    scene, _ = without(SCENE, site, missing=[3])
    ends = {ground.brick for ground in SCENE.grounds}
    assert scene.build_order == (1, 2, 6, 5, 4, 3) if 6 in ends else (1, 2, 3, 4, 5, 6)


def test_the_old_rest_goes_on_where_nothing_changed():
    site = Site.after(PLAN.steps, 4)
    problem = seqopt.pose(ENGINE, FreeRules(begin=site), ONES, "minmax,steps")
    rest, old = seqopt.solve(problem), PLAN.steps[4:]
    values = goes_on(states_of(problem), old)
    assert values["steps"] == len(old)
    assert rest.objective["minmax"] <= values["minmax"] * (1 + 1e-9)
    facts = compared(rest, old)
    assert facts["broken"] == ""
    assert facts["steps_before"] == len(old)
    assert compared(rest, rest.steps)["differs"] is None
    first = compared(replace(rest, steps=rest.steps[:-1]), rest.steps)
    assert first["differs"] == rest.steps[-1].number


def test_the_old_rest_is_asked_for_its_margins():
    """Of what goes on nobody claims a margin: it is what is proven of its steps."""
    problem = seqopt.pose(
        seqopt.make_engine("compliance", small_arch(4)), FreeRules(), ONES, "friction,steps"
    )
    plan = seqopt.solve(problem)
    values = goes_on(plan.states, plan.steps)
    assert values["friction"] > 0
    assert values == pytest.approx(plan.objective, rel=0.02)
    assert compared(plan, plan.steps)["as_planned"] == values


def test_what_the_old_rest_breaks_is_named():
    site, old = Site.after(PLAN.steps, 4), PLAN.steps[4:]
    lost = next(r.name for r, n in zip(SCENE.robots, old[0].grips, strict=True) if n is not None)
    scene, after = without(SCENE, site, [lost])
    left = tuple(r.name for r in scene.robots if r.name != lost)
    rules = FreeRules(robots=left, least_grips=1, begin=after)
    two = seqopt.pose(seqopt.make_engine("compliance", scene), rules, ONES, "minmax,steps")
    with pytest.raises(StepError, match="of a free schedule"):
        goes_on(states_of(two), old)
    weak = SCENE.with_robots(*(replace(robot, payload=20.0) for robot in SCENE.robots))
    engine = seqopt.make_engine("compliance", weak)
    lame = seqopt.pose(engine, FreeRules(begin=site), ONES, "minmax,steps")
    with pytest.raises(StepError, match="payload exceeded"):
        goes_on(states_of(lame), old)
    for wrong in ({"lost": ["rob9"]}, {"missing": [99]}):
        with pytest.raises(StepError, match="does not exist"):
            without(SCENE, site, **wrong)


def test_props_are_none_where_a_robot_holds():
    weak = SCENE.with_robots(*(replace(robot, payload=1.0) for robot in SCENE.robots))
    assert 5 in {prop.node for prop in SCENE.with_centering().props}
    rules = FreeRules(robots=("rob1",), least_grips=1, begin=Site(3, (5, None, None)))
    with pytest.raises(InfeasibleError, match="is never placed"):
        seqopt.solve(seqopt.pose(seqopt.make_engine("compliance", weak), rules, ONES))
    beside = seqopt.make_engine("compliance", SCENE.with_props(seqopt.Prop(node=5)))
    with pytest.raises(StepError, match="a robot holds node 5 of a prop; leave one out"):
        seqopt.solve(seqopt.pose(beside, rules, ONES))


def test_a_build_that_has_ended_leaves_nothing_to_plan():
    ended = FreeRules(begin=Site(6, (None, None, None)))
    with pytest.raises(ProblemError, match="nothing is left to plan"):
        seqopt.solve(seqopt.pose(ENGINE, ended, ONES))
