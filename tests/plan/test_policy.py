"""The table of best moves: it leads where a search from every state leads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.errors import FileError, InfeasibleError, ProblemError, SolverError, StepError
from seqopt.judge._policy import check_policy
from seqopt.plan.policy import Policy, find_policy
from seqopt.plan.solving import states_of
from seqopt.problem.requirements import Limit
from seqopt.sequence.rules import FreeRules, with_robots
from seqopt.sequence.site import Site
from seqopt.sequence.steps import StepKind
from tests.brute_force import ONES
from tests.builders import site_of, small_arch


@pytest.fixture(scope="module")
def engine():
    return seqopt.make_engine("compliance", with_robots(small_arch(3), 2))


@pytest.mark.parametrize(
    ("aim", "rules"),
    [
        ("minmax,steps", FreeRules(least_grips=1)),
        ("steps,minmax", FreeRules(least_grips=1)),
        ("sum", FreeRules(least_grips=1, ending="one-by-one")),
        ("minmax,travel,steps", FreeRules(least_grips=1)),
        ("regrips,minmax", FreeRules(least_grips=1, regrips=1, ending="held")),
    ],
)
def test_from_every_state_it_leads_to_what_a_search_finds(engine, aim, rules):
    policy = find_policy(seqopt.pose(engine, rules, ONES, aim))
    assert policy.checked > 0
    rows = np.random.default_rng(0).permutation(len(policy.bricks))[:8]
    ends = 0
    for row in rows:
        site = site_of(policy, row, 2)
        try:
            advice = policy.best(site)
        except StepError:
            ends += 1
            problem = seqopt.pose(engine, replace(rules, begin=site), ONES, aim)
            with pytest.raises(seqopt.SeqoptError, match=r"never placed|cannot end|no plan"):
                seqopt.solve(problem)
            continue
        if advice.kind is None:
            continue
        plan = seqopt.solve(seqopt.pose(engine, replace(rules, begin=site), ONES, aim))
        found = [plan.objective[name] for name in aim.split(",")]
        assert np.allclose(found, [*advice.values.values()], rtol=1e-9)
    assert ends < len(rows)


def test_followed_from_the_start_it_is_the_best_plan(engine, tmp_path):
    problem = seqopt.pose(engine, FreeRules(least_grips=1), ONES, "minmax,steps")
    path = find_policy(problem).save(tmp_path / "policy.npz")
    policy, plan = Policy.load(path), seqopt.solve(problem)
    site, kinds, worst = Site(0), [], 0.0
    while (advice := policy.best(site)).kind is not None:
        kinds.append(advice.kind)
        worst = max(worst, advice.values["minmax"])
        site = advice.site
        assert str(advice)
    assert len(kinds) == len(plan.steps) == plan.objective["steps"]
    assert kinds.count(StepKind.PLACE) == 3
    assert worst == pytest.approx(plan.objective["minmax"], rel=1e-12)
    assert policy.values.shape == (len(policy.bricks), 2)


def test_states_without_an_end_are_named(engine):
    forces = seqopt.solve(seqopt.pose(engine, FreeRules(least_grips=1), ONES, "F_largest"))
    tight = Limit("F_largest", forces.objective["F_largest"] * 1.0001)
    problem = seqopt.pose(engine, FreeRules(least_grips=1), ONES, "minmax,steps", [tight])
    policy = find_policy(problem)
    stuck = np.flatnonzero(np.isinf(policy.values[:, 0]))
    assert policy.dead_ends == len(stuck) > 0
    with pytest.raises(StepError, match="no end is reached"):
        policy.best(site_of(policy, stuck[0], 2))
    with pytest.raises(StepError, match="no build by these rules"):
        policy.best(Site(2, (1, None)) if policy.bricks.max() > 9 else Site(3, (1, None), (), 7))


def test_a_table_that_is_wrong_is_refused(engine):
    problem = seqopt.pose(engine, FreeRules(least_grips=1), ONES, "minmax")
    states, policy = states_of(problem), find_policy(problem)
    table = [policy.bricks, policy.held, policy.values[:, 0].copy(), policy.following.copy()]
    assert check_policy(states, *table) == policy.checked
    for factor, said in ((1.01, "a move leads to less"), (0.99, "do not lead to an end")):
        wrong = table[2].copy()
        wrong[policy.following >= 0] *= factor
        with pytest.raises(SolverError, match=said):
            check_policy(states, *table[:2], wrong, table[3])
    with pytest.raises(SolverError, match="left out"):
        check_policy(states, *(each[:-1] for each in table))


def test_what_has_no_policy_says_why(engine, tmp_path):
    for more, said in (
        ({"budgets": "steps=9"}, "no budgets"),
        ({"stands": "epoxy", "goals": "bond"}, "no margins"),
        ({"goals": "minmax,M_sup"}, "one aim that is a worst step"),
    ):
        asked = {"goals": "minmax", **more}
        with pytest.raises(ProblemError, match=said):
            find_policy(seqopt.pose(engine, FreeRules(least_grips=1), ONES, **asked))
    path = tmp_path / "policy.npz"
    path.write_text("no table")
    with pytest.raises(FileError, match="it is no policy"):
        Policy.load(path)


@pytest.mark.parametrize("direction", ["build", "take-down"])
def test_where_there_is_no_plan_it_says_what_the_search_says(engine, direction):
    rules = FreeRules(least_grips=1, direction=direction)
    tight = Limit("F_largest", 1e-3)
    problem = seqopt.pose(engine, rules, ONES, "minmax", [tight])
    with pytest.raises(InfeasibleError) as searched:
        seqopt.solve(problem)
    for proof in (True, False):
        with pytest.raises(InfeasibleError) as found:
            find_policy(problem, proof=proof)
        assert str(found.value) == str(searched.value)
        assert "it becomes possible with" in str(found.value)
