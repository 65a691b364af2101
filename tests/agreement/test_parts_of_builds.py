"""Builds that begin and end anywhere, against every plan of small builds."""

from dataclasses import replace
from functools import cache
from itertools import permutations, product

import numpy as np
import pytest

import seqopt
from seqopt.errors import InfeasibleError, ProblemError, SolverError, StepError
from seqopt.graph._spaces import order_rules
from seqopt.graph.formulation import FormulationKind, formulations
from seqopt.judge._schedules import judge_schedule
from seqopt.plan.plan import Status
from seqopt.plan.solve import graph_of
from seqopt.problem.problem import Aim, Orders
from seqopt.scene.parts import Robot
from seqopt.scene.scene import in_order, with_robots
from seqopt.sequence.part import Part
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.steps import Site, StepKind
from tests.brute_force import ONES, best_values
from tests.builders import from_both_sides, small_arch

AIMS = ("minmax,steps", "steps,minmax", "sum", "travel,steps", "minmax,regrips,steps")
PLANS = [
    pytest.param(name, marks=[pytest.mark.slow] * (name not in ("schedule_search", "overlap_lp")))
    for name, found in formulations("goals").items()
    if found.aim is not Aim.PEAK and found.kind is not FormulationKind.HEURISTIC
]


@cache
def engine_of(count, robots):
    own = (Robot(name=f"rob{k}", payload=150.0 + 25 * (k % 2)) for k in range(1, robots + 1))
    return seqopt.make_engine("compliance", small_arch(count).with_robots(*own))


def values_of(plan):
    return tuple(plan.objective.values())


def planned(engine, rules, aim, formulation=None):
    """The values of the best plan; None where there is none."""
    try:
        plan = seqopt.solve(seqopt.pose(engine, rules, ONES, aim), formulation)
    except InfeasibleError as error:
        assert "not proven" not in str(error)  # noqa: PT017  # and there is none
        return None
    assert plan.status is Status.OPTIMAL, plan.result
    return values_of(plan)


def same(found, known):
    if found is None or known is None:
        return found is known
    return np.allclose(found, known, rtol=1e-9)


def sites(engine):
    """Some sites of a build of three bricks by two robots, such that break rules among them."""
    nodes = [n for b in engine.network.scene.placed for n in b.nodes]
    yield Site(1), "a brick that nobody holds"
    yield Site(2, (nodes[2], nodes[1])), "two grips"
    yield Site(2, (nodes[1], None)), "a grip that is not on the newest brick"
    yield Site(3, (None, nodes[4])), "all bricks"
    yield Site(2, (None, nodes[1]), (nodes[3], None)), "a robot that was elsewhere"


ENDS = (None, Site(2), Site(2, (None, None)), Site(3), "held")


@pytest.mark.slow
@pytest.mark.parametrize("aim", AIMS)
def test_builds_from_anywhere_to_anywhere_are_the_best_of_all(aim):
    engine = engine_of(3, 2)
    nodes = [n for b in engine.network.scene.placed for n in b.nodes]
    held = Site(3, (nodes[4], nodes[2]))
    found = 0
    for (begin, _), end, least in product(sites(engine), ENDS, (0, 1)):
        finish = held if end == "held" else end
        rules = FreeRules(least_grips=least, begin=begin, finish=finish)
        if finish is not None and finish.bricks < begin.bricks:
            continue
        known = best_values(engine, rules, aim)
        found += known is not None
        assert same(planned(engine, rules, aim), known), (begin, finish, least)
    assert found > 20


@cache
def best_from(begin, aim):
    return best_values(engine_of(3, 2), FreeRules(least_grips=1, begin=begin), aim)


@pytest.mark.parametrize("formulation", PLANS)
def test_every_formulation_begins_where_it_is_told(formulation):
    engine = engine_of(3, 2)
    for (begin, why), aim in zip(sites(engine), ("minmax,steps", "sum") * 3, strict=False):
        rules = FreeRules(least_grips=1, begin=begin)
        found = planned(engine, rules, aim, formulation)
        assert same(found, best_from(begin, aim)), why


@pytest.mark.parametrize("aim", ["steps,minmax", "travel,steps"])
def test_the_rest_of_the_best_plan_is_the_best_rest(aim):
    """What was done and what is left add up."""
    engine, first = engine_of(4, 3), aim.split(",")[0]
    plan = seqopt.solve(seqopt.pose(engine, FreeRules(), ONES, aim))
    for count in range(0, len(plan.steps), 3):
        begin = Site.after(plan.steps, count)
        rest = seqopt.solve(seqopt.pose(engine, FreeRules(begin=begin), ONES, aim))
        assert rest.steps[0].number == count + 1
        before = planned(engine, FreeRules(finish=begin), first)[0] if count else 0.0
        assert np.isclose(before + rest.objective[first], plan.objective[first], rtol=1e-9)


def test_parts_of_builds_are_of_the_free_schedule():
    with pytest.raises(ProblemError, match="three-robot: its steps are given; orders, parts of"):
        seqopt.optimize(small_arch(7), Part(schedule="three-robot", to=4), ONES)


@pytest.mark.parametrize(
    "aim", ["minmax", *(pytest.param(a, marks=pytest.mark.slow) for a in ("steps", "travel"))]
)
def test_orders_go_on_from_what_stands(aim):
    scene = with_robots(from_both_sides(4, "V"), 3)
    engine = seqopt.make_engine("compliance", scene)
    nodes = [n for b in scene.placed for n in b.nodes]
    begin = Site(2, (nodes[2], nodes[1], None))
    rules = FreeRules(begin=begin)
    found = seqopt.solve(seqopt.pose(engine, rules, ONES, aim, orders=Orders.TIED))
    assert {*found.order[:2]} == {*scene.build_order[:2]}
    every, allowed = [], order_rules(graph_of(found.problem)).allows
    for rest in permutations(scene.build_order[2:]):
        order = (*scene.build_order[:2], *rest)
        if allowed(order):
            own = seqopt.make_engine("compliance", in_order(scene, order))
            if (value := planned(own, rules, aim)) is not None:
                every.append(value[0])
    assert len(every) > 1
    assert np.isclose(found.objective[aim], min(every), rtol=1e-9)
    assert found.status == "optimal"
    last = FreeRules(finish=Site(3))
    with pytest.raises(seqopt.SeqoptError, match="which of them is not said"):
        seqopt.solve(seqopt.pose(engine, last, ONES, aim, orders=Orders.TIED))


def test_a_rest_that_is_not_what_is_claimed_is_refused():
    engine = engine_of(4, 3)
    rules = FreeRules()
    plan = seqopt.solve(seqopt.pose(engine, rules, ONES, "minmax,steps"))
    begin = Site.after(plan.steps, 4)
    rest = seqopt.solve(seqopt.pose(engine, FreeRules(begin=begin), ONES, "minmax,steps"))
    states, chosen = rest.states, rest.selection
    assert judge_schedule(states, chosen, rest.steps).gap == 0
    longer = replace(chosen, objective=(chosen.objective[0], chosen.objective[1] + 1))
    with pytest.raises(SolverError, match="steps is"):
        judge_schedule(states, longer, rest.steps)
    with pytest.raises(StepError, match="of a free schedule"):
        judge_schedule(states, chosen, rest.steps[1:])
    other = replace(states, rules=FreeRules(begin=Site.after(plan.steps, 3)))
    with pytest.raises(StepError, match="of a free schedule"):
        judge_schedule(other, chosen, rest.steps)


def test_what_no_rule_allows_is_named():
    scene = engine_of(3, 2).network.scene
    for begin, finish, said in (
        (Site(4), None, "site: 4 bricks"),
        (Site(2, (99, None)), None, "site: rob1 at node 99"),
        (Site(0, (1, None)), None, "none stands"),
        (Site(2), Site(1), "cannot end with 1"),
        (None, Site(3, (1, 1)), "holds it; hold another"),
    ):
        with pytest.raises(StepError, match=said):
            FreeRules(begin=begin, finish=finish).span(scene)
    three, two = with_robots(small_arch(3), 3), ("rob1", "rob2")
    with pytest.raises(StepError, match="let it take part, or let it go first"):
        FreeRules(robots=two, begin=Site(1, (None, None, 1))).span(three)
    with pytest.raises(StepError, match="rule begin"):
        FreeRules(begin=3)


def test_sites_follow_the_steps():
    engine = engine_of(4, 3)
    plan = seqopt.solve(seqopt.pose(engine, FreeRules(), ONES, "minmax,steps"))
    for count in range(1, len(plan.steps) + 1):
        site, step = Site.after(plan.steps, count), plan.steps[count - 1]
        assert (site.bricks, site.grips, site.step) == (step.bricks, step.grips, step.number)
        free = [n for n, g in zip(site.stays, site.grips, strict=True) if g is not None]
        assert free.count(None) == len(free)
        if step.kind is StepKind.PLACE:
            assert site.regrips == 0
    assert Site.after(plan.steps, 0) == Site(0)
    for wrong in (-1, len(plan.steps) + 1, 1.5):
        with pytest.raises(StepError, match="the plan has 0 to"):
            Site.after(plan.steps, wrong)
