"""Builds in time from any state: enumeration, rests of plans, ages of what stands, the judge."""

from __future__ import annotations

from dataclasses import replace

import pytest

import seqopt
from seqopt.errors import ProblemError, SceneError, SolverError
from seqopt.judge._schedules import judge_schedule
from seqopt.plan.plan import Status
from seqopt.problem.standing import Standing
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.steps import Site
from seqopt.times._step_check import check_cured
from seqopt.times._steps import step_times
from tests.brute_force import ONES
from tests.times.builders import RULES, engine_of, least_cured_makespan, least_makespan

ALONE = FreeRules(least_grips=1)
CURES = "5min=1"


def solved(engine, rules, **asked):
    return seqopt.solve(seqopt.pose(engine, rules, ONES, "makespan", **asked))


CASES = [
    (3, 3, ("rob3:slower=2.5",), RULES),
    (3, 3, ("speed=0.01", "rob2:speed=0.02"), FreeRules()),
    pytest.param(4, 3, ("rob3:slower=2.5", "speed=0.02"), RULES, marks=pytest.mark.slow),
    pytest.param(4, 3, (), FreeRules(ending="one-by-one", regrips=1), marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("bricks", "robots", "words", "rules"), CASES)
def test_from_every_step_the_least_is_that_of_all_builds(bricks, robots, words, rules):
    """The rest of a plan is such a build: as soon as may be it takes no less."""
    engine = engine_of(bricks, robots, *words)
    plan = solved(engine, rules)
    ends = [0.0, *plan.times()["end_s"]]
    for count, end in enumerate(ends[:-1]):
        begins = replace(rules, begin=Site.after(plan.steps, count))
        rest = solved(engine, begins)
        assert rest.makespan == pytest.approx(least_makespan(engine, begins), rel=1e-9)
        assert (rest.status, rest.certificate.bounds) == (Status.OPTIMAL, (rest.makespan,))
        left = plan.steps[count:]
        own = step_times(engine.network.scene, left, begin=begins.begin)[-1].end
        assert plan.makespan - end - 1e-9 <= own
        assert rest.makespan <= own * (1 + 1e-9)


def test_it_ends_where_it_is_told():
    engine = engine_of(4, 3, "rob3:slower=2.5")
    plan = solved(engine, RULES)
    step = next(i for i, each in enumerate(plan.steps, start=1) if each.bricks == 3)
    rules = replace(RULES, finish=Site.after(plan.steps, step), begin=Site.after(plan.steps, 1))
    part = solved(engine, rules)
    assert {*part.steps[-1].held} == {*plan.steps[step - 1].held}
    assert part.makespan == pytest.approx(least_makespan(engine, rules))
    assert part.status is Status.OPTIMAL
    with pytest.raises(ProblemError, match="take bricks away is not modeled"):
        seqopt.pose(engine, FreeRules(direction="take-down"), ONES, "makespan")


def cured(engine, rules):
    return solved(engine, rules, stands=Standing("epoxy", curing=CURES))


@pytest.mark.slow
def test_what_stands_is_as_old_as_it_is_said_to_be():
    """No age is as just placed, which never takes less; the rest of the best plan is no longer."""
    engine = engine_of(4, 2)
    plan = cured(engine, ALONE)
    site, times = Site.after(plan.steps, 2), plan.times()
    now, least = times["end_s"][1], []
    placed = times["end_s"][times["type"] == "place"][: site.bricks]
    for ages in ((), tuple(now - placed), (1e9,) * site.bricks):
        rules = replace(ALONE, begin=replace(site, ages=ages))
        rest = cured(engine, rules)
        exact = least_cured_makespan(engine, rules, CURES, rest.makespan + 1e-6)
        assert rest.makespan == pytest.approx(exact, rel=1e-9)
        assert rest.status is Status.OPTIMAL
        least.append(rest.makespan)
    assert least == sorted(least, reverse=True)
    assert least[0] > least[-1] + 200.0  # s; what waits for the last ones that stand
    assert least[1] <= plan.makespan - now + 30.0 + 1e-6  # who is free prepares from then on


@pytest.mark.slow
def test_an_age_that_is_made_up_is_refused():
    """A plan that did not wait, as what stands were old, does not pass with what is just placed."""
    engine = engine_of(4, 2)
    plan = cured(engine, ALONE)
    site = replace(Site.after(plan.steps, 2), ages=(1e9, 1e9))
    rest = cured(engine, replace(ALONE, begin=site))
    demand, starts = Standing("epoxy", curing=CURES), rest.selection.starts
    check_cured(engine.network, rest.steps, demand, starts, site)
    with pytest.raises(SolverError, match="not proven to stand with the bond"):
        check_cured(engine.network, rest.steps, demand, starts, replace(site, ages=()))
    early = replace(rest.selection, objective=(1.0,), bound=(1.0,))
    with pytest.raises(SolverError, match="as claimed"):
        judge_schedule(replace(rest.graph), early, rest.steps)


@pytest.mark.parametrize(("ages", "said"), [((-1.0,), "age"), ((1.0,) * 3, "3 ages of 2 bricks")])
def test_wrong_ages_get_a_line(ages, said):
    with pytest.raises((SceneError, seqopt.errors.StepError), match=said):
        Site(2, ages=ages)
