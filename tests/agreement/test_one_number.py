"""One question has one number, whoever is asked: what formulations minimize, goals, instances.

A sum and a worst value are over every step for which the criterion is defined: responses in all of
them, ranks where a grip is open. Travel is that of all robots, from every grip to the next.
"""

from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import seqopt
from seqopt.errors import InfeasibleError, StepError
from seqopt.graph.formulation import FormulationKind, exhibits, formulations
from seqopt.instances.compiled import compile_instance
from seqopt.judge._schedules import plan_values
from seqopt.plan.solve import graph_of
from seqopt.problem import Amount, Filter
from seqopt.problem.criteria import StepCost, WeightedSum
from seqopt.problem.problem import Aim
from seqopt.responses.quantities import RESPONSES
from seqopt.sequence import methods as three_robots
from seqopt.sequence.rules import FreeRules
from seqopt.study import EQUATIONS
from tests.brute_force import ONES
from tests.builders import small_arch

SCHEDULES = ("three-robot", "modified-sequential", "two-robot")
WEIGHED = WeightedSum("weighed", (("T_max", 1.0, 10.0), ("F_largest", 2.0, 50.0)))
BY_BRICKS = StepCost("by bricks", ("M_sup", "T_max"), lambda r, b: b * r["M_sup"] + r["T_max"])
CRITERIA = {"ratio": ONES, "weighed": WEIGHED, "by bricks": BY_BRICKS}
GOALS = {Aim.SUM: "sum", Aim.PEAK: "minmax"}
PAIRED = (Aim.SUM, Aim.PEAK, Aim.SUM)  # with schedules and criteria


@cache
def posed(schedule, criterion="ratio", bricks=5):
    """A problem without goals: the formulation says what is minimized."""
    engine = seqopt.make_engine("compliance", small_arch(bricks))
    moves = three_robots.SCHEDULES[schedule](engine.network)
    return seqopt.pose(engine, moves, CRITERIA.get(criterion, EQUATIONS))


def exact(aim=None):
    """Every formulation that promises the least, of costs with an aim or of states."""
    every = formulations("goals") | exhibits()
    found = [n for n, f in every.items() if f.aim is aim and f.kind is FormulationKind.EXACT]
    return found + (["overlap_lp", "lagrangian"] if aim is Aim.SUM else [])


def by_aims(problem, aim):
    """What a problem without goals says, by every exact formulation, and by two made exact."""
    for name in exact(aim):
        yield name, seqopt.solve(problem, name).certificate.objective
    if aim is Aim.SUM:
        size = max(len(move.candidates) for move in problem.schedule.moves)
        yield "beam", seqopt.solve(problem, "beam", options={"width": size}).certificate.objective
        yield "instance", seqopt.solve(compile_instance(problem)).certificate.objective
    else:
        told = compile_instance(problem, aim=Aim.PEAK)
        yield "instance", seqopt.solve(told).certificate.objective


def by_goals(problem, aim):
    """What the same problem with a goal says, by every exact formulation."""
    asked = problem.but(goals=GOALS[aim])
    for name in exact():
        yield name, seqopt.solve(asked, name).objective[GOALS[aim]]
    yield "instance", seqopt.solve(compile_instance(asked)).objective[GOALS[aim]]


def of_table(table, name):
    """A response of every step of a table, SI units."""
    return table[RESPONSES[name].column].to_numpy(float) / RESPONSES[name].scale


def of_steps(problem, aim):
    """What the steps of the best plan cost, from their table alone."""
    plan = seqopt.solve(problem, "overlap_dp" if aim is Aim.SUM else "minimax")
    table = plan.responses()
    found = {name: of_table(table, name) for name in ("T_max", "M_sup", "D_max")}
    forces = table[[c for c in table if c.startswith("F_rob")]].abs().max(axis=1)
    found["F_largest"] = forces.fillna(0.0).to_numpy(float)
    rows = [{n: v[k : k + 1] for n, v in found.items()} for k in range(len(plan.steps))]
    each = [
        float(problem.criterion.costs(row, step.bricks, 1)[0])
        for row, step in zip(rows, plan.steps, strict=True)
    ]
    yield "steps", sum(each) if aim is Aim.SUM else max(each)


@pytest.mark.parametrize(
    ("schedule", "criterion", "aim"),
    [
        pytest.param(*each, marks=[pytest.mark.slow] * (k > 0))
        for k, each in enumerate(zip(SCHEDULES, CRITERIA, PAIRED, strict=True))
    ],
)
def test_sums_and_worst_values_of_responses_are_one_number(schedule, criterion, aim):
    problem = posed(schedule, criterion)
    found = dict(of_steps(problem, aim))
    for ask in (by_aims, by_goals):
        found |= {f"{ask.__name__}, {name}": value for name, value in ask(problem, aim)}
    assert len(found) >= 10
    assert found == pytest.approx(dict.fromkeys(found, found["steps"]), rel=1e-6)


def test_ranks_are_of_open_grips_alone():
    """Other steps have no candidates: no rank of one out of one is added."""
    problem, asks = posed(SCHEDULES[0], "ranks"), (by_aims, by_goals)
    found = {f"{ask.__name__}, {n}": v for ask in asks for n, v in ask(problem, Aim.SUM)}
    assert found == pytest.approx(dict.fromkeys(found, next(iter(found.values()))), rel=1e-6)
    graph = graph_of(problem, Aim.SUM)
    given = [graph.values(level, state) for level, state in graph.space.without_choice()]
    assert given
    assert all(within.all() and not values.any() for values, within in given)


@pytest.mark.parametrize(
    "formulation",
    [
        "overlap_dp",
        *(pytest.param(n, marks=pytest.mark.slow) for n in ("overlap_mip", "schedule_search")),
    ],
)
def test_the_least_sum_of_ranks_of_the_arch_is_one_number(formulation):
    plan = seqopt.optimize("arch25", criterion="equations-2-3", formulation=formulation, aim="sum")
    assert plan.objective == {"sum": pytest.approx(657.4645627239565, rel=1e-12)}
    assert plan.status == "optimal"


def test_a_given_step_that_the_criterion_forbids_leaves_no_plan():
    """With one brick no grip is open."""

    def several(responses, bricks):
        return np.full_like(responses["F_largest"], 1.0 if bricks > 1 else np.inf)

    problem = posed("three-robot")
    assert problem.schedule.steps[0].bricks == 1
    assert not problem.schedule.steps[0].moves
    problem = problem.but(criterion=StepCost("several", ("F_largest",), several))
    for asked, name in ((problem, "overlap_dp"), (problem.but(goals="sum"), None)):
        with pytest.raises(InfeasibleError, match="schedule: criterion several allows no plan"):
            seqopt.solve(asked, name)


def ways(scene, steps):
    """How far robots go straight from one grip to the next, m."""
    total = 0.0
    for grips in zip(*(step.grips for step in steps), strict=True):
        held = [np.array(scene.node_position(n)) for n in grips if n is not None]
        total += sum(float(np.linalg.norm(b - a)) for a, b in pairwise(held))
    return total


@pytest.mark.slow
@pytest.mark.parametrize("schedule", ["modified-sequential", "two-robot"])
def test_travel_is_one_number(schedule):
    """The least that a goal says, and what a budget says that each plan goes."""
    problem = posed(schedule)
    scene, goes = problem.scene, graph_of(problem.but(goals="travel"))
    least = seqopt.solve(problem.but(goals="travel"))
    assert ways(scene, least.steps) == pytest.approx(least.objective["travel"])
    capped = problem.but(budgets=f"travel={least.objective['travel']!r}m")
    for name in ("labels", "overlap_mip"):
        plan = seqopt.solve(capped, name)
        assert plan.objective["travel"] == pytest.approx(least.objective["travel"], rel=1e-6)
        assert ways(scene, plan.steps) == pytest.approx(plan.objective["travel"])
        assert plan_values(goes, plan.steps)[0] == pytest.approx(plan.objective["travel"])
    rng, seen = np.random.default_rng(1), 0
    while seen < 5:  # any choice, whatever it costs
        nodes = [int(rng.choice(move.candidates)) for move in problem.schedule.moves]
        with suppress(StepError):  # two robots at one node
            steps = problem.schedule.fill(nodes)
            assert plan_values(goes, steps)[0] == pytest.approx(ways(scene, steps))
            seen += 1


@pytest.mark.slow
@pytest.mark.parametrize("schedule", SCHEDULES[1:2])
def test_steps_over_a_level_are_those_of_the_plan(schedule):
    """Steps without an open grip count, as in the table of the plan."""
    problem = posed(schedule)
    known = of_table(seqopt.solve(problem, "overlap_dp").responses(), "T_max")
    apart = np.unique(np.round(known, 3))
    for k in (0, len(apart) // 2):
        level = float(0.5 * (apart[k] + apart[k + 1]))  # far from any value
        budget, many = f"steps_over:T_max={level:g}", int((known > level).sum())
        for name in ("labels", "overlap_mip"):
            free = seqopt.solve(problem.but(budgets=f"{budget}:{many}"), name)
            assert (of_table(free.responses(), "T_max") > level).sum() == free.objective[budget]
            with suppress(InfeasibleError):
                plan = seqopt.solve(problem.but(budgets=f"{budget}:{many - 1}"), name)
                over = of_table(plan.responses(), "T_max") > level
                assert plan.objective[budget] == over.sum() <= many - 1


# one question in other words: as a criterion, a response, an amount or a filter of one's own
def largest_force(states):
    return states.responses["F_largest"]


FORCE = StepCost("force", ("F_largest",), lambda responses, bricks: responses["F_largest"])
OWN = {
    Aim.SUM: Amount("own", largest_force, responses=("F_largest",), twin=largest_force),
    Aim.PEAK: Amount(
        "own", largest_force, is_peak=True, responses=("F_largest",), twin=largest_force
    ),
}
RULES = FreeRules(ending="held")


def in_scene(free, payload=None):
    """A loop of five bricks, or the free schedule of three."""
    scene = small_arch(3 if free else 5)
    if payload is not None:
        scene = scene.with_robots(*(replace(robot, payload=payload) for robot in scene.robots))
    engine = seqopt.make_engine("compliance", scene)
    return seqopt.pose(engine, RULES if free else seqopt.three_robot_loop(engine.network), FORCE)


@pytest.mark.parametrize(("free", "aim"), [(False, Aim.SUM), (True, Aim.PEAK)])
def test_a_response_is_one_number_in_all_words(free, aim):
    problem = in_scene(free)
    words = {Aim.SUM: "sum(F_largest)", Aim.PEAK: "F_largest"}[aim]
    found = {
        f"{name}, {goals}": seqopt.solve(problem.but(goals=goals), name).certificate.values[0]
        for goals in (GOALS[aim], words, (OWN[aim],))
        for name in exact()[: None if goals == words else 1]
    }
    if not free:
        found |= dict(by_aims(problem, aim))
    assert len(found) >= 5
    assert found == pytest.approx(dict.fromkeys(found, next(iter(found.values()))), rel=1e-6)


@pytest.mark.parametrize("free", [False, True])
def test_a_largest_force_is_one_bound_in_all_words(free):
    """As a limit, a filter, infinite costs, and where grips keep payloads as a payload."""
    problem = in_scene(free).but(goals="D_max")
    forces = seqopt.solve(problem).responses().filter(regex="F_rob").abs()
    most = 0.99 * float(forces.max(axis=None))

    def kept(states):
        return states.responses["F_largest"] <= most

    def broken(states):
        return states.responses["F_largest"] > most

    def forbidden(responses, bricks):
        return np.where(responses["F_largest"] <= most, responses["D_max"], np.inf)

    own = Filter("own", kept, ("F_largest",), twin=broken)
    costs = StepCost("costs", ("F_largest", "D_max"), forbidden)
    asked = {
        "limit": problem.but(limits=(seqopt.Limit("F_largest", most),)),
        "words": problem.but(limits=f"F_largest={most!r}"),
        "filter": problem.but(limits=[own]),
        "costs": problem.but(criterion=costs, goals="minmax"),
    }
    if free:
        asked["payload"] = in_scene(free, most).but(goals="D_max")
    else:
        asked["no goals"] = problem.but(criterion=costs, goals=())
    found = {
        name: seqopt.solve(each, "minimax" if name == "no goals" else None).certificate.objective
        for name, each in asked.items()
    }
    assert found == pytest.approx(dict.fromkeys(found, found["limit"]), rel=1e-6)
    assert found["limit"] > seqopt.solve(problem).certificate.objective
