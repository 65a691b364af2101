"""The least makespan is that of every order of acts by named robots, and is proven."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import seqopt
from formulations.times._search import plan_in_time
from seqopt.errors import ProblemError, SceneError, SolverError
from seqopt.graph.formulation import Formulation, FormulationKind, LabelProof, find_formulation
from seqopt.judge._schedules import judge_schedule
from seqopt.plan.plan import Status
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.steps import Site
from seqopt.stability.standing import Standing
from seqopt.times._step_check import check_cured
from seqopt.times._steps import step_times
from tests.brute_force import ONES
from tests.times.builders import (
    RULES,
    SLOW,
    engine_of,
    judged,
    least_cured_makespan,
    least_makespan,
)

LONG = (pytest.mark.slow, pytest.mark.long)
CASES = [
    (3, 3, (SLOW,), RULES),
    (3, 3, ("speed=0.01", "rob2:speed=0.02"), FreeRules()),
    pytest.param(4, 3, ("rob1:fetch=75,approach=25",), RULES, marks=pytest.mark.slow),
    pytest.param(
        4,
        3,
        ("rob2:speed=0.02", "rob3:fetch=15,place=5,approach=5,grip=2.5,release=2.5"),
        RULES,
        marks=pytest.mark.slow,
    ),
    pytest.param(4, 3, ("speed=0.01",), FreeRules(), marks=pytest.mark.slow),
    pytest.param(
        5,
        3,
        ("rob2:fetch=7,release=1",),
        FreeRules(ending="one-by-one", regrips=1),
        marks=pytest.mark.slow,
    ),
    pytest.param(6, 3, (SLOW,), RULES, marks=LONG),
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
    engine = engine_of(4, 3, SLOW)
    plan = solved(engine, RULES, aim)
    assert plan.status is Status.OPTIMAL
    assert plan.makespan == pytest.approx(least_makespan(engine))
    if "minmax" in aim:
        better = plan.objective["minmax"] * (1 - 1e-6)
        regrips = plan.regrips if "regrips" in aim else None
        assert least_makespan(engine, most=better, regrips=regrips) > plan.makespan + 1e-6


@pytest.mark.slow
def test_budgets_are_kept_and_exact():
    engine = engine_of(4, 3, SLOW)
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
    engine = engine_of(3, 3, SLOW)
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


# builds in time from any state: enumeration, rests of plans, ages of what stands, the judge
ALONE = FreeRules(least_grips=1)
CURES = "5min=1"


def soonest(engine, rules, **asked):
    return seqopt.solve(seqopt.pose(engine, rules, ONES, "makespan", **asked))


RESTS = [
    pytest.param(3, 3, (SLOW,), RULES, marks=pytest.mark.slow),
    (3, 3, ("speed=0.01", "rob2:speed=0.02"), FreeRules()),
    pytest.param(4, 3, (SLOW, "speed=0.02"), RULES, marks=pytest.mark.slow),
    pytest.param(4, 3, (), FreeRules(ending="one-by-one", regrips=1), marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("bricks", "robots", "words", "rules"), RESTS)
def test_from_every_step_the_least_is_that_of_all_builds(bricks, robots, words, rules):
    """The rest of a plan is such a build: as soon as may be it takes no less."""
    engine = engine_of(bricks, robots, *words)
    plan = soonest(engine, rules)
    ends = [0.0, *plan.times()["end_s"]]
    for count, end in enumerate(ends[:-1]):
        begins = replace(rules, begin=Site.after(plan.steps, count))
        rest = soonest(engine, begins)
        assert rest.makespan == pytest.approx(least_makespan(engine, begins), rel=1e-9)
        assert (rest.status, rest.certificate.bounds) == (Status.OPTIMAL, (rest.makespan,))
        left = plan.steps[count:]
        own = step_times(engine.network.scene, left, begin=begins.begin)[-1].end
        assert plan.makespan - end - 1e-9 <= own
        assert rest.makespan <= own * (1 + 1e-9)


def test_it_ends_where_it_is_told():
    engine = engine_of(4, 3, SLOW)
    plan = soonest(engine, RULES)
    step = next(i for i, each in enumerate(plan.steps, start=1) if each.bricks == 3)
    rules = replace(RULES, finish=Site.after(plan.steps, step), begin=Site.after(plan.steps, 1))
    part = soonest(engine, rules)
    assert {*part.steps[-1].held} == {*plan.steps[step - 1].held}
    assert part.makespan == pytest.approx(least_makespan(engine, rules))
    assert part.status is Status.OPTIMAL
    with pytest.raises(ProblemError, match="take bricks away is not modeled"):
        seqopt.pose(engine, FreeRules(direction="take-down"), ONES, "makespan")


def cured(engine, rules):
    return soonest(engine, rules, stands=Standing("epoxy", curing=CURES))


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


# the judge of builds in time: what is wrong is refused, what is not proven is claimed
@pytest.fixture(scope="module")
def plan():
    problem = seqopt.pose(engine_of(4, 3, SLOW), RULES, ONES, "makespan")
    return seqopt.solve(problem)


def test_what_is_claimed_is_proven_by_labels(plan):
    proof = judged(plan)
    assert proof.gap == 0
    assert len(plan.selection.proofs[0].labels) > 0


def test_a_slower_plan_is_not_the_least(plan):
    """The plan with robots that do not take turns well is refused as the least."""
    twin = replace(plan.graph)
    steps = seqopt.solve(seqopt.pose(twin.engine, RULES, ONES, "minmax,steps")).steps
    value = seqopt.GivenSequence(twin.engine, steps).makespan
    assert value > plan.makespan
    claimed = replace(plan.selection, objective=(value,), bound=(value,))
    with pytest.raises(SolverError, match="labels do not prove"):
        judge_schedule(twin, claimed, steps)


@pytest.mark.parametrize("change", ["one less", "later", "freer", "none"])
def test_labels_that_do_not_close_are_seen(plan, change):
    states, labels, prices = plan.selection.proofs[0]
    labels, first = labels.copy(), int(np.flatnonzero(states[:, 0] == 1)[0])
    if change == "one less":
        states, labels = states[1:], labels[1:]
    elif change == "later":
        labels[first:, 0] += 1.0
    elif change == "freer":
        labels[first:, 1:] += 30.0
    else:
        states, labels = states[:0], labels[:0]
    proof = (LabelProof(states, labels, prices),)
    if change == "none":  # prices alone prove less
        assert judged(plan, proofs=proof).gap > 0
        return
    with pytest.raises(SolverError, match="labels do not prove"):
        judged(plan, proofs=proof)


def test_without_the_twin_of_a_room_the_certificate_says_claimed(plan):
    goals = tuple(replace(goal, twin=None) for goal in plan.graph.goals)
    proof = judge_schedule(replace(plan.graph, goals=goals), plan.selection, plan.steps)
    assert proof.values == plan.selection.objective
    assert (proof.bounds, proof.gap) == ((-np.inf,), np.inf)


def told(**wrong):
    """A formulation that changes fields of what the search found, by functions of its answer."""

    def solve(problem, **_):
        found = find_formulation("makespan_labels").solve(problem)
        return replace(found, **{name: of(found) for name, of in wrong.items()})

    return Formulation("liar", "says so", FormulationKind.EXACT, None, solve, answers=("time",))


def test_without_labels_it_is_claimed(plan):
    found = seqopt.solve(plan.problem, told(proofs=lambda _: ()))
    assert found.status is Status.CLAIMED
    assert found.certificate.gap == np.inf  # nothing is proven


def test_other_grips_than_those_of_the_states_are_refused(plan):
    with pytest.raises(SolverError, match="robots hold other nodes"):
        seqopt.solve(plan.problem, told(grips=lambda found: found.grips[::-1]))


def test_a_search_that_ends_early_leaves_a_plan_and_a_proven_bound(plan):
    """What multipliers say of the first path, before any label is set."""
    early = partial(plan_in_time, least=lambda _, __, first, *___: first._replace(late=True))
    formulation = Formulation("early", "x", FormulationKind.EXACT, None, early, answers=("time",))
    found = seqopt.solve(plan.problem, formulation)
    assert (found.status, found.stopped) == (Status.FEASIBLE, "time")
    bound = found.certificate.bounds[0]
    assert 0 < bound < plan.makespan <= found.makespan
    assert found.gap == pytest.approx(1 - bound / found.makespan)
    assert found.summary()["bound"] == {"makespan": bound}
