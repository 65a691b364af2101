"""What is proven of budgets: bounds, conflicts, what they cost."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.errors import InfeasibleError, SolverError
from seqopt.placement import budget_proof
from seqopt.placement.budget_proof import least_within
from seqopt.placement.budgets import steps_over, travel
from seqopt.placement.conflicts import smallest_conflict
from seqopt.placement.formulation import End
from seqopt.placement.interface import CostProblem
from seqopt.placement.price_curve import price_curve
from seqopt.placement.solving import solve
from tests.strategies import budgeted


def within(problem, budgets=None):
    """The allowed choices within budgets and what they cost."""
    budgets = problem.budgets if budgets is None else budgets
    return {
        choice: problem.sums.cost(choice)
        for choice in product(*map(range, problem.sums.sizes))
        if np.isfinite(problem.sums.cost(choice))
        and all(b.spent(choice) <= b.bound for b in budgets)
    }


@pytest.mark.parametrize("most", [1, 5_000])
@given(problem=budgeted(), price=st.floats(0, 5))
@settings(max_examples=60)
def test_no_choice_costs_less_than_is_proven(problem, price, most):
    found = within(problem)
    claimed = {budget.name: price for budget in problem.budgets}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(budget_proof, "MOST", most)
        for value in {*found.values()}:
            bound = least_within(problem, value, claimed, max(value, 1.0))
            assert bound <= min(found.values()) + 1e-6
            if most > 1:
                assert bound == pytest.approx(min(found.values()), abs=1e-6)


@given(problem=budgeted())
@settings(max_examples=60)
def test_the_smallest_conflict(problem):
    if not within(problem, ()):
        return
    found = smallest_conflict(problem)
    sizes = [
        count
        for count in range(1, len(problem.budgets) + 1)
        if any(not within(problem, some) for some in combinations(problem.budgets, count))
    ]
    assert len(found) == (sizes[0] if sizes else 0)
    assert not found or not within(problem, found)


def test_budgets_that_conflict_are_named(problem25):
    way, force = travel(problem25, 11.5), steps_over(problem25, "F_largest", 238.7, 8.0)
    for budget in (way, force):
        assert solve(replace(problem25, budgets=(budget,)), "labels").certificate.gap <= 1e-6
    idle = travel(problem25, 1e3)
    capped = replace(problem25, budgets=(idle, way, force))
    for name in ("labels", "overlap_mip", "lagrangian"):
        with pytest.raises(InfeasibleError) as caught:
            solve(capped, name)
        said = (
            "11.5 of 'robot travel [m]' and 8 of 'steps with F_largest over 238.7' cannot be kept"
        )
        assert said in str(caught.value)
        assert "1000" not in str(caught.value)


def test_few_labels_stop_with_a_bound(problem25):
    capped = replace(
        problem25,
        budgets=(travel(problem25, 18.0), steps_over(problem25, "F_largest", 250.0, 18.0)),
    )
    best = solve(capped, "labels")
    assert best.selection.end is End.DONE
    assert best.certificate.claimed_gap <= 1e-6
    few = solve(capped, "labels", most=8)
    assert few.selection.bound <= best.certificate.objective <= few.certificate.objective
    assert few.selection.end is End.STOPPED or few.selection.bound == few.selection.objective
    assert few.certificate.claimed_gap < 0.02
    tight = replace(capped, budgets=(*capped.budgets, travel(problem25, 10.9)))
    with pytest.raises(SolverError, match="before any choice within all budgets was found"):
        solve(tight, "labels", most=1, time_limit=0)


def test_what_a_budget_costs(problem25):
    budget = travel(problem25, np.inf)
    table = price_curve(problem25, budget, [10.0, 12.0, 16.0, 20.0, 30.0])
    assert np.isnan(table["objective"].iloc[0])
    rest = table.iloc[1:]
    assert rest["objective"].is_monotonic_decreasing
    assert (rest["spent"] <= rest["bound"]).all()
    assert (rest["gap"] <= 1e-6).all()
    assert rest["price"].iloc[-1] == 0
    assert rest["price"].is_monotonic_decreasing
    relaxed = price_curve(problem25, budget, [12.0, 16.0], "lagrangian")
    np.testing.assert_allclose(relaxed["price"], rest["price"].iloc[:2])


def test_a_budget_without_a_bound_is_none(problem25):
    free = replace(problem25, budgets=(travel(problem25, np.inf),))
    best = solve(problem25, "overlap_dp").certificate.objective
    for name in ("labels", "lagrangian"):
        assert solve(free, name).certificate.objective == pytest.approx(best)


def test_the_bound_holds_where_costs_have_both_signs():
    rng = np.random.default_rng(3)
    costs = CostProblem(_random(rng, 4, 6).sums)
    assert costs.sums.sizes == (6,) * 4
    capped = _random(rng, 4, 6)
    found = within(capped)
    plan = solve(capped, "labels")
    assert plan.certificate.objective == pytest.approx(min(found.values()))
    assert plan.certificate.gap <= 1e-6


def _random(rng, moves, size):
    from seqopt.placement.costs import Budget, LayeredCosts  # noqa: PLC0415

    def parts():
        single = tuple(rng.normal(size=size) for _ in range(moves))
        shared = (
            rng.normal(size=(1, size)),
            *(rng.normal(size=(size, size)) for _ in range(1, moves)),
        )
        return single, shared

    return CostProblem(LayeredCosts(*parts()), (Budget("use", *parts(), -2.0),))
