"""Take-downs: rules in plain words against an enumeration of one's own, plans, files, refusals."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

import seqopt
from experiments.placement.parts.staged import analyze_staged
from seqopt.errors import ProblemError, SolverError, StepError
from seqopt.graph._orders import among_orders, order_rules
from seqopt.graph.states.states import build_states
from seqopt.judge._rule_moves import check_free
from seqopt.judge._schedules import judge_schedule
from seqopt.plan.plan import Status
from seqopt.sequence.schedule_file import parse_plan
from seqopt.sequence.steps import Site, Step, StepKind, check_sequence
from tests.brute_force import ONES, allowed, best_values
from tests.builders import turned_round
from tests.quality.fuzz_cases import plan_text

ARCH = seqopt.ArchShape(pitch=(1.2, 0.4, -0.4, -1.2), pattern="V")
DOWN = seqopt.FreeRules(direction="take-down")


def arch():
    return seqopt.make_engine("compliance", seqopt.arch_scene(ARCH))


def small_wall():
    scene = seqopt.load_scene("wall:columns=2,courses=2")
    return seqopt.make_engine("compliance", scene)


def posed(engine, aims, rules=DOWN):
    return seqopt.pose(engine, rules, ONES, aims)


@pytest.mark.slow
@pytest.mark.parametrize("aim", ["minmax", "sum", "steps"])
@pytest.mark.parametrize("made", [arch, small_wall])
@pytest.mark.parametrize("least", [1, 2])
def test_best_take_down_is_that_of_all(made, aim, least):
    engine, rules = made(), replace(DOWN, least_grips=least)
    plan = seqopt.solve(posed(engine, aim, rules))
    assert plan.status == "optimal"
    assert plan.selection.objective[0] == pytest.approx(
        best_values(engine, rules, aim)[0], rel=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["arch25", "wall:columns=3,courses=3", "vault:span=0.6,rise=0.2,columns=2"]
)
def test_take_downs_are_proven(name):
    engine = seqopt.make_engine("compliance", seqopt.load_scene(name))
    plan = seqopt.solve(seqopt.pose(engine, DOWN, seqopt.CRITERIA["worst-ratio"], "minmax,steps"))
    assert plan.status == "optimal"
    assert plan.certificate.bound == pytest.approx(plan.selection.objective[0], rel=1e-9)
    assert [s.bricks for s in plan.steps if s.kind is StepKind.REMOVE] == [
        *range(len(engine.network.scene.bricks))[::-1]
    ]


@pytest.mark.parametrize("made", [arch, small_wall])
def test_take_down_is_worth_what_its_build_is_in_reverse(made):
    """With one robot after the other at the finished structure, both pass the same states."""
    engine = made()
    one = seqopt.FreeRules(ending="one-by-one")
    build, down = (seqopt.solve(posed(engine, "minmax,steps", rules)) for rules in (one, DOWN))
    bare = peak_of(engine, [build.steps[-1]])  # counts in builds: it is where take-downs begin
    reverse = turned_round(engine.network.scene, build.steps)
    check_free(engine.network, DOWN, reverse)
    assert down.selection.objective[0] == pytest.approx(peak_of(engine, down.steps))
    assert max(bare, down.selection.objective[0]) == pytest.approx(build.selection.objective[0])
    assert len(down.steps) == len(build.steps) == len(reverse)


def peak_of(engine, steps):
    """The worst step, each solved alone."""
    scales = np.array([scale for _, scale in ONES.limits])
    worst = [allowed(engine, DOWN, s.bricks, s.grips) for s in steps if s.bricks]
    return float((np.array(worst) / scales).max())


@pytest.mark.slow
def test_best_order_is_that_of_all():
    engine = small_wall()
    scene, criterion = engine.network.scene, seqopt.CRITERIA["worst-ratio"]
    found = seqopt.solve(seqopt.pose(engine, DOWN, criterion, "minmax", orders="tied"))
    among = among_orders(build_states(engine, DOWN, found.problem.criterion, "minmax"), "tied")
    orders = [*filter(order_rules(among).allows, permutations(scene.build_order))]
    values = [seqopt.solve(among.at(order)).objective["minmax"] for order in orders]
    assert len(orders) > 1
    assert found.objective["minmax"] == pytest.approx(min(values), rel=1e-9)
    assert found.summary()["status"] == found.status == Status.OPTIMAL
    steps = seqopt.solve(seqopt.pose(engine, DOWN, criterion, "minmax,steps", orders="tied"))
    least = min(
        seqopt.solve(replace(among, goals=steps.graph.goals).at(o)).objective["steps"]
        for o, value in zip(orders, values, strict=True)
        if value <= min(values) * 1.000001
    )
    assert steps.status == Status.OPTIMAL
    assert steps.objective["steps"] == len(steps.steps) == least
    assert found.steps[-1].bricks == 0
    assert max(values) > min(values) * 1.01  # orders differ


def test_judge_refuses_what_is_no_take_down():
    engine = arch()
    problem = build_states(engine, DOWN, ONES, "minmax")
    plan = seqopt.solve(posed(engine, "minmax"))
    claimed = plan.selection
    judge_schedule(problem, claimed, plan.steps)
    better = replace(claimed, objective=(0.9 * claimed.objective[0],), bound=(0.0,))
    with pytest.raises(SolverError, match="as claimed"):
        judge_schedule(problem, better, plan.steps)
    short = plan.steps[:-1]
    with pytest.raises(StepError, match="does not end there"):
        check_free(engine.network, DOWN, short)
    wrong = Step(2, StepKind.RELEASE, 4, (None,) * 3)
    with pytest.raises(StepError, match="step 2"):
        check_free(engine.network, DOWN, [plan.steps[0], wrong])


@pytest.mark.parametrize(
    ("who", "match"),
    [((0, 1), r"\(remove\): .* one robot alone holds brick 4"), ((0,), "brick 4 is not placed")],
)
def test_removal_is_by_who_alone_holds(who, match):
    scene = arch().network.scene
    newest, first = scene.placed[-1].nodes, scene.placed[0].nodes
    free = [n for n in (*newest, *first) if n not in scene.blocked_nodes]
    before = Step(1, StepKind.REPOSITION, 4, (free[0], free[-1], None))
    check_sequence(scene, [Step(2, StepKind.REMOVE, 3, (None, free[-1], None))], before)
    two = Step(1, StepKind.REPOSITION, 4, (newest[0], newest[1], None))
    held = tuple(None if r in who else n for r, n in enumerate(two.grips))
    with pytest.raises(StepError, match=match):
        check_sequence(scene, [Step(2, StepKind.REMOVE, 3, held)], two)


def test_plans_are_read_back():
    scene = seqopt.load_scene("arch25")
    down = turned_round(scene, seqopt.sequential(seqopt.build_network(scene)))
    assert parse_plan(scene, plan_text(scene, down), "down") == down
    table = seqopt.analyze(seqopt.make_engine("auto", scene), down)
    assert table["bricks"].iloc[-1] == 0
    assert not table[["F_max_N", "D_max_1e-3mm"]].iloc[-1].any()


def test_what_a_take_down_has_not():
    engine = arch()
    with pytest.raises(ProblemError, match="orders of a take-down are not searched"):
        among_orders(build_states(engine, DOWN, ONES, "minmax"), "tied")
    with pytest.raises(StepError, match="cannot end with 4; give fewer"):
        replace(DOWN, finish=Site(4)).span(engine.network.scene)
    with pytest.raises(StepError, match="did you mean take-down"):
        seqopt.FreeRules(direction="takedown")
    plan = seqopt.solve(posed(engine, "steps"))
    with pytest.raises(StepError, match="a take-down: what was locked in"):
        analyze_staged(engine.network, plan.steps)
