"""Plans with props; what becomes of a plan where something has changed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import seqopt
from seqopt import Prop
from seqopt.errors import InfeasibleError, ProblemError, SolverError, StepError
from seqopt.judge._rule_moves import check_free
from seqopt.judge._schedules import check_props, judge_schedule
from seqopt.judge._states import props_that_hold
from seqopt.plan.replan import compared, goes_on
from seqopt.plan.solve import graph_of
from seqopt.responses.quantities import PROP_EXCESS
from seqopt.sequence.part import without
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.steps import Site, StepKind
from tests.brute_force import ONES, best_values
from tests.builders import small_arch

UP = (0.0, 0.0, 1.0)
LOOSE = seqopt.FreeRules(least_grips=1)


def posed(scene, rules=LOOSE, aim="minmax,steps", **words):
    engine = seqopt.make_engine("compliance", scene)
    return seqopt.pose(engine, rules, ONES, aim, **words)


def weak(count, payload, robots=2):
    """An arch whose robots carry little, each reaching all."""
    scene = small_arch(count)
    return scene.with_robots(*(replace(r, payload=payload) for r in scene.robots[:robots]))


@pytest.mark.parametrize(
    ("rules", "nodes"), [(LOOSE, (5,)), (seqopt.FreeRules(newest="free"), (3,))]
)
def test_the_best_plan_with_props_is_that_of_brute_force(rules, nodes):
    scene = weak(4, 300.0).with_props(*(Prop(node=node) for node in nodes))
    engine = seqopt.make_engine("compliance", scene)
    best = best_values(engine, rules, "minmax,steps")
    if best is None:
        with pytest.raises(InfeasibleError):
            seqopt.solve(posed(scene, rules))
        return
    plan = seqopt.solve(posed(scene, rules))
    assert plan.certificate.values == pytest.approx(best)
    assert plan.certificate.gap == 0


def test_rules_count_props_as_grips():
    scene = small_arch(4).with_props(Prop(node=3))
    network = seqopt.build_network(scene)
    plan = seqopt.solve(posed(scene, seqopt.FreeRules(newest="free")))
    check_free(network, seqopt.FreeRules(newest="free"), plan.steps)
    alone = [s for s in plan.steps if len(s.held) == 1 and s.bricks >= 2]
    assert alone  # a robot and the prop are two grips
    bare = seqopt.build_network(scene.with_props())
    with pytest.raises(StepError, match="fewer than least_grips=2"):
        check_free(bare, seqopt.FreeRules(newest="free"), plan.steps)


def test_a_plan_whose_prop_is_missing_is_refused():
    scene = weak(5, 120.0).with_props(Prop(node=5))
    plan = seqopt.solve(posed(scene))
    states = graph_of(posed(scene.with_props()))
    with pytest.raises((SolverError, StepError)):
        judge_schedule(states, plan.selection, plan.steps)
    judge_schedule(graph_of(posed(scene)), plan.selection, plan.steps)  # the control


def test_a_plan_whose_prop_pulls_is_refused_where_it_may_only_push():
    scene = small_arch(5)
    problem = posed(scene.with_props(Prop(node=5)))
    plan = seqopt.solve(problem)
    force = plan.props()["largest_force_N"][0]
    up = [Prop(node=5, direction=UP)]
    pull = [scene.with_props(Prop(node=5, direction=tuple(-x for x in UP)))]
    pull += [scene.with_props(*up)]
    engines = [seqopt.make_engine("compliance", each) for each in pull]
    least = [seqopt.GivenSequence(each, plan.steps).props()["least_push_N"][0] for each in engines]
    assert min(least) < -1e-2 * force  # it pulls in one of the ways
    at = int(np.argmin(least))
    with pytest.raises(SolverError, match="may only push"):
        check_props(engines[at], plan.steps)
    with pytest.raises(SolverError, match="may only push"):
        judge_schedule(graph_of(posed(pull[at])), plan.selection, plan.steps)
    weakest = seqopt.make_engine("compliance", scene.with_props(Prop(node=5, capacity=0.5)))
    with pytest.raises(SolverError, match=r"bears .* N of 0\.5 N"):
        check_props(weakest, plan.steps)


@pytest.mark.parametrize("loop", [False, True])
def test_plans_keep_props_to_what_they_may_bear(loop):
    """A limit of the states, and of candidates; without it the best plan does not keep to it."""
    scene = small_arch(6)
    node = next(n for n in scene.placed[3].nodes if n != scene.placed[3].placing_node)
    found = {}
    for way in (None, UP, (0.0, 0.0, -1.0)):
        engine = seqopt.make_engine("compliance", scene.with_props(Prop(node=node, direction=way)))
        moves = seqopt.three_robot_loop(engine.network) if loop else LOOSE
        problem = seqopt.pose(engine, moves, ONES, () if loop else "minmax")
        assert [limit.response for limit in problem.limits] == [PROP_EXCESS] * (way is not None)
        try:
            plan = seqopt.solve(problem)
        except InfeasibleError:
            continue
        found[way] = plan
        assert plan.responses()["prop_excess_N"].max() < 1e-2
        check_props(engine, plan.steps)
    assert found.keys() - {None}  # a plan keeps to it
    assert all(plan.certificate.gap <= 1e-9 for plan in found.values())


def test_the_judge_finds_the_props_that_hold_by_itself():
    scene = small_arch(5).with_props(Prop(node=7, stiffness=1e6), Prop(node=4, capacity=80.0))
    for bricks in range(1, 6):
        for robots in (0, 1):
            own = [number for number, _ in props_that_hold(scene, bricks, robots)]
            assert own == [*scene.prop_numbers(bricks, held=bool(robots))]


def test_props_make_plans_stand_dry():
    scene = small_arch(5)
    plan = seqopt.solve(posed(scene.with_props(Prop(node=5)), stands="dry"))
    assert {verdict.value for verdict in plan.verdicts("dry")} == {"stands"}
    assert np.isfinite(plan.certificate.bounds).all()


# what becomes of a plan where something has changed
SCENE = small_arch(6).with_robots(*(seqopt.Robot(name=f"rob{k}", payload=150.0) for k in (1, 2, 3)))
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
    values = goes_on(graph_of(problem), old)
    assert values["steps"] == len(old)
    assert rest.objective["minmax"] <= values["minmax"] * (1 + 1e-9)
    facts = compared(rest, old)
    assert facts["broken"] == ""
    assert facts["steps_before"] == len(old)
    assert compared(rest, rest.steps)["differs"] is None
    first = compared(replace(rest, steps=rest.steps[:-1]), rest.steps)
    assert first["differs"] == rest.steps[-1].number


def test_what_is_gone_is_named_where_the_old_rest_cannot_go_on():
    at = next(step.number for step in PLAN.steps if step.bricks == 2)
    told = seqopt.replan(PLAN, at, missing=[4]).changes
    place = next(s.number for s in PLAN.steps if (s.kind, s.bricks) == (StepKind.PLACE, 4))
    assert told["broken"] == f"step {place}: brick 4 is missing, and comes later"
    told = seqopt.replan(PLAN, at, missing=[1]).changes
    assert told["broken"] == f"step {at + 1}: brick 1 is missing, and comes first"
    holds = next(s for s in PLAN.steps[at:] if s.grips[2] is not None)
    told = seqopt.replan(PLAN, at, lost=["rob3"]).changes
    assert told["broken"] == f"step {holds.number}: rob3 is lost"


@pytest.mark.slow
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
        goes_on(graph_of(two), old)
    weak = SCENE.with_robots(*(replace(robot, payload=20.0) for robot in SCENE.robots))
    engine = seqopt.make_engine("compliance", weak)
    lame = seqopt.pose(engine, FreeRules(begin=site), ONES, "minmax,steps")
    with pytest.raises(StepError, match="payload exceeded"):
        goes_on(graph_of(lame), old)
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
