"""A proven optimum of a sum, given back as a budget, has a plan; less than it has none.

However plans are found: only a search that looked at everything says that there is none.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

import seqopt
from formulations.states._search import exact_best, narrow
from seqopt.errors import InfeasibleError, NothingFoundError
from seqopt.graph._explore import Explorer
from seqopt.graph.formulation import FormulationKind, find_formulation
from seqopt.graph.states._visits import StateSpace
from seqopt.graph.states.states import build_states, within
from seqopt.sequence.rules import FreeRules
from tests.brute_force import ONES
from tests.builders import small_arch
from tests.times.builders import engine_of

FACTORS = (1.0, 1.02)
UP, DOWN = FreeRules(), FreeRules(direction="take-down")
slow = pytest.mark.slow


@cache
def posed(bricks, moves, orders=None):
    """A problem of a small arch, by rules or the name of a schedule."""
    scene = small_arch(bricks)
    engine = seqopt.make_engine("compliance", scene)
    found = moves if isinstance(moves, FreeRules) else seqopt.three_robot_loop(engine.network)
    return seqopt.pose(engine, found, ONES, "minmax", orders=orders)


def words(name, cap):
    return f"{name}={cap!r}{'m' if name == 'travel' else 's' if name == 'makespan' else ''}"


def check(problem, name, formulation):
    """The optimum is a budget that a plan keeps; a tenth less is one that none does."""
    best = seqopt.solve(problem.but(goals=name))
    assert best.status == "optimal"
    least = best.objective[name]
    for factor in FACTORS:
        capped = problem.but(budgets=words(name, factor * least))
        plan = seqopt.solve(capped, formulation)
        assert plan.objective[name] <= factor * least * (1 + 1e-6)
    if least > 0:
        with pytest.raises(InfeasibleError):
            seqopt.solve(problem.but(budgets=words(name, 0.9 * least)), formulation)


@pytest.mark.parametrize(
    ("bricks", "moves", "name", "formulation"),
    [
        (4, UP, "sum(T_max)", "schedule_search"),
        pytest.param(4, UP, "travel", "schedule_search", marks=slow),
        pytest.param(4, UP, "regrips", "schedule_search", marks=slow),
        (4, UP, "sum(T_max)", "path_beam"),
        (4, DOWN, "steps", "schedule_search"),
        pytest.param(5, "loop", "sum(M_sup)", "schedule_search", marks=slow),
    ],
)
def test_states_have_a_plan_within_every_optimum(bricks, moves, name, formulation):
    check(posed(bricks, moves), name, formulation)


@pytest.mark.parametrize(
    ("name", "formulation"),
    [
        ("regrips", "order_search"),
        pytest.param("steps", "path_beam", marks=slow),
        pytest.param("travel", "order_search", marks=slow),
    ],
)
def test_orders_have_a_plan_within_every_optimum(name, formulation):
    check(posed(3, UP, "tied"), name, formulation)


@pytest.mark.parametrize(
    ("name", "formulation"),
    [
        pytest.param("makespan", "makespan_labels", marks=slow),
        ("sum(T_max)", "makespan_labels"),
        ("regrips", "makespan_flow"),
    ],
)
def test_builds_in_time_have_a_plan_within_every_optimum(name, formulation):
    engine = engine_of(3, 3)
    problem = seqopt.pose(engine, FreeRules(), ONES, "makespan")
    least = seqopt.solve(problem.but(goals=name)).objective[name]
    for factor in FACTORS:
        aim = "minmax" if name == "makespan" else "makespan"
        capped = problem.but(goals=aim, budgets=words(name, factor * least))
        try:
            plan = seqopt.solve(capped, formulation)
        except NothingFoundError:  # of a bound alone
            assert find_formulation(formulation).kind is FormulationKind.BOUND
            continue
        assert plan.objective[name] <= factor * least * (1 + 1e-6)


def test_pairs_of_optima_have_the_plans_that_they_are_of():
    """What two sums take of one plan is kept by it, whatever mixtures of others do."""
    problem = posed(4, UP)
    one = seqopt.solve(problem.but(goals="sum(T_max),sum(M_sup)")).objective
    for factor in FACTORS:
        caps = [words(name, factor * value) for name, value in one.items()]
        plan = seqopt.solve(problem.but(budgets=caps))
        assert all(plan.objective[n] <= factor * v * (1 + 1e-6) for n, v in one.items())


def test_a_narrow_search_finds_none_and_says_no_more():
    """The states of least worst step have no plan within the budget; others have."""
    problem = posed(6, UP)
    least = seqopt.solve(problem.but(goals="sum(T_max)")).objective["sum(T_max)"]
    capped = within(
        build_states(problem.engine, UP, ONES, "minmax"), {"sum(T_max)": 1.000001 * least}
    )
    few = Explorer(StateSpace(capped, regrips=False), width=2)
    assert few.rise()
    with pytest.raises(NothingFoundError) as caught:
        exact_best(few, capped.budgets)
    assert not isinstance(caught.value, InfeasibleError)
    assert narrow(capped, 2, lambda _: None) is None
    every = Explorer(StateSpace(capped))
    assert every.rise()
    assert exact_best(every, capped.budgets)[1].values[1] <= 1.000002 * least
    tight = replace(capped, budgets=(0.9 * least,))
    with pytest.raises(InfeasibleError):
        exact_best(every, tight.budgets)
    low = Explorer(StateSpace(capped))
    assert low.rise(1.01 * seqopt.solve(problem).objective["minmax"])
    with pytest.raises(NothingFoundError):  # states above the threshold were left out
        exact_best(low, tight.budgets)
