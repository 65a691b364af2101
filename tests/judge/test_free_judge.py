"""What judges free schedules and Pareto sets sees what is wrong with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import ProblemError, SolverError, StepError
from seqopt.graph.states.states import build_states, within
from seqopt.judge._schedules import judge_schedule
from seqopt.network.build import build_network
from seqopt.plan.solve import solve
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import Limit
from seqopt.problem.standing import slack
from seqopt.sequence.rules import FreeRules
from tests.builders import small_arch

ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))


def posed(aim="minmax,steps", rules=None, limits=()):
    engine = ComplianceEngine(build_network(small_arch(5)))
    return build_states(engine, rules or FreeRules(), ONES, aim, limits)


@pytest.fixture(scope="module")
def plan():
    return solve(posed(), "schedule_search")


@pytest.mark.parametrize("aim", ["minmax", "steps", "travel"])
def test_a_plan_that_is_not_the_best_is_seen(aim):
    """One that is best for the opposite order, judged by a goal at which it loses."""
    rules = FreeRules(regrips=1)
    other = solve(posed("M_sup" if aim != "minmax" else "steps,T_max", rules), "schedule_search")
    problem = posed(aim, rules)
    best = solve(problem, "schedule_search").certificate.values[0]
    from seqopt.judge._schedules import plan_values  # noqa: PLC0415

    value = plan_values(problem, other.steps)[0]
    claimed = replace(other.selection, objective=(value,), bound=(value,))
    if value > best * (1 + 1e-9):
        with pytest.raises(SolverError, match="is promised as the least; a plan has less"):
            judge_schedule(problem, claimed, other.steps)
    else:
        assert judge_schedule(problem, claimed, other.steps).gap == 0
        assert aim in ("steps", "regrips")  # others do tell the two apart


def test_a_step_against_the_rules_is_seen(plan):
    strict = replace(plan.problem, rules=FreeRules(least_grips=3))
    with pytest.raises(StepError, match="fewer than least_grips=3"):
        judge_schedule(strict, plan.selection, plan.steps)


def test_a_limit_that_is_exceeded_is_seen(plan):
    worst = plan.responses()["M_sup_Nm"].max()
    capped = replace(plan.problem, limits=(Limit("M_sup", 0.99 * worst),))
    with pytest.raises(SolverError, match="exceeds the limit on M_sup"):
        judge_schedule(capped, plan.selection, plan.steps)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"goals": "fast"}, "aim 'fast' does not exist"),
        ({"goals": "steps,steps"}, "aim steps: it is listed twice"),
        ({"goals": ()}, "give goals, or their names"),
        ({"limits": [Limit("F_move", 3.0)]}, "a state of a free schedule has no F_move"),
        ({"criterion": seqopt.CRITERIA["equations-2-3"]}, "it ranks the choices of a move"),
    ],
)
def test_what_cannot_be_posed_gets_one_line(arguments, said):
    engine = ComplianceEngine(build_network(small_arch(4)))
    given = {"criterion": ONES} | arguments
    with pytest.raises(ProblemError, match=said) as caught:
        build_states(engine, FreeRules(), **given)
    assert "\n" not in str(caught.value)


def test_weights_of_scenarios_that_prove_little_leave_a_gap():
    """Wrong weights are no error, but prove less; a wrong total, or none for a scenario, is one."""
    scene = small_arch(5)
    problem = seqopt.pose(
        *(seqopt.make_engine("compliance", scene), FreeRules(), ONES),
        scenarios=seqopt.scenarios(scene, count=3, seed=1),
        over="worst-total",
    )
    plan = solve(problem, "schedule_search")
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


@pytest.mark.slow
def test_a_margin_within_a_budget_is_proven_to_its_width():
    """The margin comes first, and the budget holds beside it."""
    problem = within(posed("friction,minmax"), {"travel": 1.0})
    plan = solve(problem, "schedule_search")
    alone = solve(posed("friction"), "schedule_search")
    friction, travel = plan.objective["friction"], plan.objective["travel"]
    width = slack("friction", friction)
    assert travel <= 1.0
    assert alone.certificate.bounds[0] - width <= plan.certificate.bounds[0] <= friction
    with pytest.raises(SolverError, match="no multiplier for every budget and goal"):
        judge_schedule(plan.states, replace(plan.selection, prices=()), plan.steps)
    objective = (0.5 * friction, *plan.selection.objective[1:])
    with pytest.raises(SolverError):
        judge_schedule(plan.states, replace(plan.selection, objective=objective), plan.steps)
