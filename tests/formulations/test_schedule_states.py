"""States of schedules with open grips, one to four a step: all aims against brute force."""

import re
from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest

import seqopt
from formulations._search import Options, StopError, search_states
from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import DRY, find_mortar
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError, SolverError, StepError, TimeUpError
from seqopt.exchange.schedules import parse_schedule
from seqopt.graph.states import build_states, within
from seqopt.judge._schedules import judge_schedule
from seqopt.responses.quantities import CHOSEN_BY
from seqopt.scene.scene import with_robots
from seqopt.stability.assessment import verdict
from seqopt.stability.verdict import Verdict
from tests.brute_force import ONES, distance
from tests.builders import small_arch

SEARCH = "schedule_search"
FOUR_OPEN = """step,type,bricks,rob1_node,rob2_node,rob3_node,rob4_node
1,place,1,?,,,
2,place,2,?,?,,
3,place,3,?,?,?,
4,place,4,?,?,?,?
5,release,4,?,?,?,
6,reposition,4,?,?,?,?
"""


def built(name):
    """An engine and a schedule: how many grips are open at once."""
    if name == "four":
        engine = ComplianceEngine(seqopt.build_network(with_robots(small_arch(4), 4)))
        return engine, parse_schedule(engine.network, FOUR_OPEN, "four")
    engine = seqopt.make_engine("compliance", small_arch(6))
    loop = seqopt.three_robot_loop if name == "three-robot" else seqopt.modified_sequential
    return engine, loop(engine.network)


@cache
def plans_of(name):
    """The engine and schedule of a name, and all that the latter allows, found once."""
    engine, schedule = built(name)
    return engine, schedule, list(every_plan(engine, schedule))


# what shares what is found once goes to one worker
once = pytest.mark.xdist_group("plans of small schedules")


def every_plan(engine, schedule):
    """All sequences that the schedule allows, with the responses of their steps."""
    for nodes in product(*(move.candidates for move in schedule.moves)):
        try:
            steps = schedule.fill(nodes)
        except StepError:
            continue
        yield steps, seqopt.analyze(engine, steps)


def costs(table, scene):
    """What the criterion takes of every step, and the raw responses, SI."""
    forces = table[[f"F_{robot.name}_N" for robot in scene.robots]].abs().max(axis=1).fillna(0.0)
    raw = {"F_largest": forces.to_numpy(float)}
    for name in ("M_sup", "T_max", "D_max"):
        raw[name] = table[CHOSEN_BY[name].column].to_numpy(float) / CHOSEN_BY[name].scale
    return np.max([raw[name] / limit for name, limit in ONES.limits], axis=0), raw


def travel(scene, steps):
    total = 0.0
    for robot in range(len(scene.robots)):
        held = [s.grips[robot] for s in steps if s.grips[robot] is not None]
        total += sum(distance(scene, *pair) for pair in pairwise(held))
    return total


def goals(aim, scene, steps, table):
    worst, raw = costs(table, scene)
    known = {
        "minmax": worst.max(),
        "sum": worst.sum(),
        "steps": float(len(steps)),
        "T_max": raw["T_max"].max(),
        "sum(M_sup)": raw["M_sup"].sum(),
        "travel": travel(scene, steps),
    }
    return tuple(known[word] for word in aim.split(","))


@once
@pytest.mark.parametrize("name", [pytest.param("modified", marks=pytest.mark.slow), "four"])
def test_every_aim_equals_brute_force(name):
    engine, schedule, plans = plans_of(name)
    scene = engine.network.scene
    assert len(plans) > 10
    for aim in ("sum", "minmax,travel", "travel,sum(M_sup)", "T_max,steps"):
        plan = seqopt.solve(build_states(engine, schedule, ONES, aim), "schedule_search")
        best = list(plan.selection.objective)
        left = [goals(aim, scene, *each) for each in plans]
        for k, value in enumerate(best):
            least = min(each[k] for each in left)
            assert value == pytest.approx(least, rel=1e-7)
            left = [each for each in left if each[k] <= least * (1 + 1e-9)]
        assert plan.certificate.bounds == pytest.approx(best, rel=1e-6)
        assert plan.status == "optimal"
        assert plan.summary()["schedule"] == schedule.method


@once
@pytest.mark.parametrize("name", [pytest.param("three-robot", marks=pytest.mark.slow), "four"])
def test_budgets_equal_brute_force(name):
    """A worst value within one budget is exact; of sums a bound holds, and the gap is said."""
    engine, schedule, plans = plans_of(name)
    scene = engine.network.scene
    known = np.array([goals("minmax,sum,travel,sum(M_sup)", scene, *each) for each in plans])
    for cap in np.quantile(known[:, 2], [0.05, 0.4]):
        able = known[known[:, 2] <= cap]
        problem = within(build_states(engine, schedule, ONES, "minmax,sum"), {"travel": cap})
        plan = seqopt.solve(problem, "schedule_search")
        value, total, travelled = plan.selection.objective
        assert value == pytest.approx(able[:, 0].min(), rel=1e-7)
        assert travelled <= cap * (1 + 1e-9)
        least = able[able[:, 0] <= value * (1 + 1e-9), 1].min()
        bound = plan.certificate.bounds[1]
        assert bound <= least * (1 + 1e-9)
        assert total >= least * (1 - 1e-9)
        gap = plan.certificate.gap
        assert gap == pytest.approx(1 - bound / total, abs=1e-9)
        assert plan.status == ("optimal" if gap <= 1e-6 else "feasible")
        both = {"travel": cap, "sum(M_sup)": np.median(able[:, 3])}
        plan = seqopt.solve(within(build_states(engine, schedule, ONES, "minmax"), both), SEARCH)
        within_both = able[able[:, 3] <= both["sum(M_sup)"]]
        assert plan.certificate.bounds[0] <= within_both[:, 0].min() * (1 + 1e-9)
        assert plan.selection.objective[0] >= within_both[:, 0].min() * (1 - 1e-9)
        spent = dict(zip(map(str, plan.problem.goals), plan.selection.objective, strict=True))
        assert all(spent[word] <= cap * (1 + 1e-9) for word, cap in both.items())
    fewest = known[:, 3].min()
    few = within(build_states(engine, schedule, ONES, "minmax"), {"sum(M_sup)": 0.9 * fewest})
    least = re.escape(f"sum(M_sup) is at least {fewest:.6g} N m, and")
    with pytest.raises(InfeasibleError, match=least):
        seqopt.solve(few, SEARCH)


def test_the_judge_of_budgets_has_prices_of_its_own_to_check():
    """The control: a bound that is too high is seen; wrong multipliers prove no more or less."""
    engine, schedule = built("four")
    problem = within(build_states(engine, schedule, ONES, "sum"), {"travel": 3.0})
    plan = seqopt.solve(problem, SEARCH)
    proof = judge_schedule(problem, plan.selection, plan.steps)
    for prices in ((), ((1e3,),)):  # the judge finds its own
        again = judge_schedule(problem, replace(plan.selection, prices=prices), plan.steps)
        assert again.bounds == pytest.approx(proof.bounds)
    for wrong, said in (
        (replace(plan.selection, prices=((),)), "no multiplier for every budget"),
        (replace(plan.selection, bound=(2 * plan.selection.bound[0], 0.0)), "is promised below"),
    ):
        with pytest.raises(SolverError, match=said):
            judge_schedule(problem, wrong, plan.steps)
    tight = replace(problem, budgets=(0.5 * plan.selection.objective[1],))
    with pytest.raises(SolverError, match=r"travel is .*, more than the"):
        judge_schedule(tight, plan.selection, plan.steps)


@once
@pytest.mark.parametrize(
    ("name", "mortar"),
    [
        ("four", "dry"),
        pytest.param("three-robot", "bond=2e3", marks=pytest.mark.slow),
        pytest.param("three-robot", "bond=2e4", marks=pytest.mark.slow),
    ],
)
def test_what_stands_equals_brute_force(name, mortar):
    """Standing is asked of every state by the cone program; where no plan stands, none is found."""
    engine, schedule, plans = plans_of(name)
    network, known = engine.network, {}

    def stands(step):
        key = step.bricks, step.grips
        if key not in known:
            assembly = step_assembly(network, *key)
            known[key] = verdict(assembly, find_mortar(mortar)) is Verdict.STANDS
        return known[key]

    able = [
        goals("minmax,sum", network.scene, steps, table)
        for steps, table in plans
        if all(map(stands, steps))
    ]
    problem = build_states(engine, schedule, ONES, "minmax,sum", stands=mortar)
    assert bool(able) == (mortar == "bond=2e4" or name == "four")
    if able:
        found = seqopt.solve(problem, "schedule_search")
        assert found.selection.objective == pytest.approx(min(able), rel=1e-6)
        assert (found.stability(DRY if mortar == "dry" else None)["verdict"] == "stands").all()
    else:
        with pytest.raises(
            InfeasibleError, match=r"becomes possible with a bond of|no requirement"
        ):
            seqopt.solve(problem, "schedule_search")


@once
@pytest.mark.slow
def test_the_judge_sees_a_worse_plan_and_one_of_another_schedule():
    """The control: the second best is refused, and so are steps that the schedule has not."""
    engine, schedule, every = plans_of("three-robot")
    problem = build_states(engine, schedule, ONES, "sum")
    found = seqopt.solve(problem, "schedule_search")
    scene = engine.network.scene
    plans = [(goals("sum", scene, *each)[0], each[0]) for each in every]
    value, steps = sorted(plans, key=lambda each: each[0])[1]
    worse = replace(found.selection, objective=(value,), bound=(value,))
    with pytest.raises(SolverError, match="promised as the least; a plan has less"):
        judge_schedule(problem, worse, steps)
    other = list(found.steps)
    other[0] = replace(other[0], grips=(*other[0].grips[1:], other[0].grips[0]))
    with pytest.raises(StepError, match="step 1 is none of schedule three-robot"):
        judge_schedule(problem, found.selection, other)


def test_many_open_grips_at_once_are_solved_as_states():
    engine, schedule = built("four")
    plans = [seqopt.solve(seqopt.pose(engine, schedule, ONES), n) for n in (None, "minimax")]
    assert [plan.goals for plan in plans] == [("minmax",)] * 2
    assert plans[1].objective["minmax"] == pytest.approx(plans[0].objective["minmax"])
    with pytest.raises(StepError, match="at most two neighboring ones can be; take worst-ratio"):
        build_states(engine, schedule, seqopt.CRITERIA["equations-2-3"], "sum")


def test_a_search_that_ends_early_keeps_its_plan_and_a_bound_that_is_a_number():
    """No floor of its worst step is known before: that must not become a bound that is none."""
    problem, found = build_states(*built("three-robot"), ONES, "minmax"), []
    for calls in (*range(1, 30, 4), 400):
        left = iter(range(calls))

        def tell(_, left=left):
            if next(left, None) is None:
                raise StopError("time")

        with suppress(TimeUpError):
            found.append(search_states(problem, Options(2, 1.1, expensive=False), tell))
    assert {each.stopped for each in found} == {"", "time"}
    best = min(each.objective for each in found)
    assert all(each.bound[0] <= best[0] <= each.objective[0] for each in found)  # NaN is not
