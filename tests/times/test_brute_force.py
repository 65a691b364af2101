"""The least makespan is that of every order of acts by named robots, and is proven."""

from __future__ import annotations

import pytest

import seqopt
from seqopt.errors import ProblemError
from seqopt.plan.plan import Status
from seqopt.sequence.rules import FreeRules
from tests.brute_force import ONES
from tests.times.builders import RULES, engine_of, least_makespan

LONG = (pytest.mark.slow, pytest.mark.long)
CASES = [
    (3, 2, (), FreeRules(ending="held", least_grips=1)),
    (3, 3, ("rob3:slower=2.5",), RULES),
    (3, 3, ("speed=0.01", "rob2:speed=0.02"), FreeRules()),
    pytest.param(4, 3, ("rob1:fetch=75,approach=25",), RULES, marks=pytest.mark.slow),
    pytest.param(4, 3, ("rob2:speed=0.02", "rob3:slower=0.5"), RULES, marks=pytest.mark.slow),
    pytest.param(4, 3, ("speed=0.01",), FreeRules(), marks=pytest.mark.slow),
    pytest.param(
        5,
        3,
        ("rob2:fetch=7,release=1",),
        FreeRules(ending="one-by-one", regrips=1),
        marks=pytest.mark.slow,
    ),
    pytest.param(6, 3, ("rob3:slower=2.5",), RULES, marks=LONG),
    pytest.param(6, 4, ("rob4:fetch=75,approach=25",), RULES, marks=LONG),
]


def solved(engine, rules, aim, formulation=None, **asked):
    problem = seqopt.pose(engine, rules, ONES, aim, **asked)
    return seqopt.solve(problem, formulation)


@pytest.mark.parametrize(("bricks", "robots", "words", "rules"), CASES)
def test_the_least_is_that_of_all_builds(bricks, robots, words, rules):
    engine = engine_of(bricks, robots, *words)
    plan = solved(engine, rules, "makespan")
    assert plan.makespan == pytest.approx(least_makespan(engine, rules), rel=1e-9)
    assert plan.status is Status.OPTIMAL
    assert plan.certificate.bounds == pytest.approx(plan.certificate.values)
    best = solved(engine, rules, "minmax,makespan")
    most = best.objective["minmax"]
    assert best.makespan == pytest.approx(least_makespan(engine, rules, most), rel=1e-9)
    assert best.status is Status.OPTIMAL


@pytest.mark.parametrize("aim", ["makespan,steps", "makespan,regrips,minmax"])
def test_goals_after_the_makespan_keep_it(aim):
    engine = engine_of(4, 3, "rob3:slower=2.5")
    plan = solved(engine, RULES, aim)
    assert plan.status is Status.OPTIMAL
    assert plan.makespan == pytest.approx(least_makespan(engine))
    if "minmax" in aim:
        better = plan.objective["minmax"] * (1 - 1e-6)
        regrips = plan.regrips if "regrips" in aim else None
        assert least_makespan(engine, most=better, regrips=regrips) > plan.makespan + 1e-6


@pytest.mark.slow
def test_budgets_are_kept_and_exact():
    engine = engine_of(4, 3, "rob3:slower=2.5")
    free = solved(engine, RULES, "makespan")
    plan = solved(engine, RULES, "makespan", budgets="regrips=0")
    assert plan.regrips == 0
    assert plan.status is Status.OPTIMAL
    assert plan.makespan == pytest.approx(least_makespan(engine, regrips=0))
    in_time = solved(engine, RULES, "minmax", budgets=f"makespan={free.makespan}s")
    after = solved(engine, RULES, "makespan,minmax")
    assert in_time.objective["minmax"] == pytest.approx(after.objective["minmax"])
    assert in_time.status is Status.OPTIMAL


@pytest.mark.slow
def test_a_flow_that_shares_the_time_of_robots_is_a_bound():
    engine = engine_of(3, 3, "rob3:slower=2.5")
    plan = solved(engine, RULES, "makespan", "makespan_flow")
    least = least_makespan(engine)
    assert plan.certificate.bounds[0] <= least * (1 + 1e-9)
    assert plan.selection.bound[0] <= least * (1 + 1e-6)
    assert plan.makespan >= least * (1 - 1e-9)


def test_nothing_is_assumed_silently():
    engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
    with pytest.raises(ProblemError, match=r"makespan: .* rob1, rob2, rob3 take; give durations"):
        seqopt.pose(engine, FreeRules(), ONES, "makespan")
    timed = engine_of(3, 3)
    with pytest.raises(ProblemError, match="found in one order"):
        seqopt.pose(timed, FreeRules(), ONES, "makespan", orders="tied")
