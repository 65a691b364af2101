"""What judges free schedules and Pareto sets sees what is wrong, and says what bounds rest on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt._registry import ADDED
from seqopt.errors import SolverError
from seqopt.judge._schedules import judge_schedule
from seqopt.problem import Amount
from seqopt.problem.criteria import WorstRatio
from tests.builders import small_arch

ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))


def test_weights_of_scenarios_that_prove_little_leave_a_gap():
    """Wrong weights are no error, but prove less; a wrong total, or none for a scenario, is one."""
    scene = small_arch(5)
    problem = seqopt.pose(
        *(seqopt.make_engine("compliance", scene), seqopt.FreeRules(), ONES),
        scenarios=seqopt.scenarios(scene, count=3, seed=1),
        over="worst-total",
    )
    plan = seqopt.solve(problem, "schedule_search")
    states, found = plan.states, plan.selection
    assert 0 < plan.certificate.gap < 0.02  # what labels alone close is claimed
    assert plan.status == "claimed optimal"
    worst = int(np.argmax(found.prices[0]))
    alone = tuple(float(k == (worst + 1) % 3) for k in range(3))
    less = judge_schedule(states, replace(found, prices=(alone,)), plan.steps)
    assert (less.gap > plan.certificate.gap, less.claimed_gap) == (True, 0.0)
    none = judge_schedule(states, replace(found, prices=(alone,), bound=(-np.inf,)), plan.steps)
    assert none.claimed_gap == none.gap == less.gap
    double = judge_schedule(states, replace(found, prices=((2.0, 2.0, 2.0),)), plan.steps)
    assert double.bounds[0] <= plan.objective["worst-total"] * (1 + 1e-12)
    with pytest.raises(SolverError, match="no weight for every scenario"):
        judge_schedule(states, replace(found, prices=()), plan.steps)
    with pytest.raises(SolverError, match=r"worst-total is .* as claimed"):
        judge_schedule(states, replace(found, objective=(0.9 * found.objective[0],)), plan.steps)


def held(states):
    return (states.nodes >= 0).sum(axis=1)


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setitem(ADDED, (Amount, "held_alone"), Amount("held_alone", held))


def basis(plan):
    named = {n: str(b) for n, b in zip(plan.goals, plan.certificate.rests_on, strict=False)}
    assert plan.summary()["bound_rests_on"] == named
    return [*named.values()]


def test_states_are_rebuilt_and_costs_of_choices_are_given():
    scene = seqopt.load_scene("chain:bricks=7")
    assert basis(seqopt.optimize(scene, "free", aim="minmax,steps")) == ["rebuilt", "rebuilt"]
    loop = seqopt.optimize(scene)
    assert basis(loop) == ["given"]
    assert basis(seqopt.solve(seqopt.compile_instance(loop.problem))) == ["given"]


@pytest.mark.usefixtures("registered")
def test_what_has_no_twin_is_claimed():
    plan = seqopt.optimize("chain:bricks=7", "free", aim="minmax,held_alone")
    assert basis(plan) == ["rebuilt", "claimed"]


def test_without_a_proof_nothing_is_said():
    plan = seqopt.optimize("chain:bricks=7", "free", search=seqopt.Search(proof=False))
    assert plan.summary()["bound_rests_on"] == {}
