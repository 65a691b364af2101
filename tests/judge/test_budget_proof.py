"""What is proven of budgets: bounds, conflicts, what they cost."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seqopt.errors import InfeasibleError, ProblemError, SolverError, TimeUpError
from seqopt.graph.decision_costs import Budget, LayeredCosts
from seqopt.graph.decisions import steps_over, travel
from seqopt.graph.formulation import End, FormulationKind, formulations
from seqopt.graph.graph import Graph
from seqopt.judge import _bounds as budget_proof
from seqopt.judge._bounds import least_within
from seqopt.judge.arithmetic import budget_bounds
from seqopt.plan._infeasible import smallest_conflict
from seqopt.plan.solve import solve
from tests.layered import Costs, answer
from tests.strategies import budgeted

TAKERS = {name: found for name, found in formulations("costs").items() if found.takes_budgets}


def bounded(problem, value, claimed):
    """What the judge proves of costs, given the value of a choice and claimed multipliers."""
    compiled = problem.compiled()
    instance = compiled.instance
    limited = [(cap.column, cap.most) for cap in instance.caps]
    costs = instance.amounts[:, 0]
    prices = [max(0.0, claimed.get(cap.name, 0.0)) for cap in instance.caps]
    own = instance.graph, costs, limited, value - compiled.offset
    return least_within(*own, prices=prices, laid_down=True)[0] + compiled.offset


@pytest.mark.parametrize("most", [1, 5_000])
@given(problem=budgeted(), price=st.floats(0, 5))
def test_no_choice_costs_less_than_is_proven(problem, price, most):
    found = problem.within()
    claimed = {budget.name: price for budget in problem.budgets}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(budget_proof, "MOST", most)
        for value in {*found.values()}:
            bound = bounded(problem, value, claimed)
            assert bound <= min(found.values()) + 1e-6
            if most > 1:
                assert bound == pytest.approx(min(found.values()), abs=1e-6)


@given(problem=budgeted())
def test_the_smallest_conflict(problem):
    def within(budgets):
        return replace(problem, budgets=tuple(budgets)).within()

    if not within(()):
        return
    found = [cap.name for cap in smallest_conflict(problem.compiled().instance)]
    sizes = [
        count
        for count in range(1, len(problem.budgets) + 1)
        if any(not within(some) for some in combinations(problem.budgets, count))
    ]
    assert len(found) == (sizes[0] if sizes else 0)
    assert not found or not within(b for b in problem.budgets if b.name in found)


def tied(rng):
    """A problem of one to three moves with equal costs; a choice is exactly at its budgets.

    Or just above them, so that none may be within.
    """
    sizes = rng.integers(1, 4, rng.integers(1, 4))

    def parts(values):
        pairs = zip((1, *sizes[:-1]), sizes, strict=True)
        shared = tuple(rng.choice([0.0, *values], pair) for pair in pairs)
        return tuple(rng.choice(values, size) for size in sizes), shared

    chosen = tuple(int(rng.integers(size)) for size in sizes)
    budgets = []
    for name in ("one", "two")[: rng.integers(1, 3)]:
        budget = Budget(name, *parts([0.1, 0.2, 0.3, 1.0, 2.0]), 0.0)
        bound = budget.spent(chosen) - rng.choice([0.0, 0.0, 0.0, 0.05])
        budgets.append(replace(budget, bound=bound))
    return Costs(LayeredCosts(*parts([1.85, 3.7, 3.7, 1e-3])), tuple(budgets))


def exactly_within(problem):
    """The choices within all budgets, without rounding, and what they cost."""

    def spent(budget, choice):
        return sum(map(Fraction, LayeredCosts(budget.single, budget.shared).parts(choice)))

    return {
        choice: problem.sums.cost(choice)
        for choice in product(*map(range, problem.sums.sizes))
        if all(spent(budget, choice) <= Fraction(budget.bound) for budget in problem.budgets)
    }


@pytest.mark.parametrize("draws", [12, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", TAKERS)
def test_none_is_within_only_where_enumeration_finds_none(name, draws):
    """Prices may rise without end where costs tie; rounding must not decide what is possible."""
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(draws):
        problem = tied(rng)
        found = exactly_within(problem)
        try:
            proof = answer(problem, name).certificate
        except InfeasibleError:
            assert not found, problem
            refused += 1
        except SolverError:
            assert TAKERS[name].kind is FormulationKind.BOUND, problem
        else:
            best = min(found.values(), default=np.inf)
            assert proof.bound <= best + 1e-6
            if TAKERS[name].kind is FormulationKind.EXACT:
                assert proof.objective <= best + 1e-6
    assert refused


def test_what_rounding_puts_above_a_bound_is_not_proven_to_exceed_it():
    """0.1 + 1.1 is more than 1.2 in binary fractions; a choice that takes it counts as within."""
    pairs = (np.zeros((1, 2)), np.zeros((2, 1)))
    use = (np.array([0.1, 0.0]), np.array([1.1]))
    costs = LayeredCosts((np.array([1.0, 2.0]), np.zeros(1)), pairs)
    problem = Costs(costs, (Budget("use", use, pairs, 1.2),))
    assert problem.budgets[0].spent((0, 0)) > 1.2
    assert bounded(problem, 2.0, {}) == pytest.approx(1.0)
    assert bounded(problem, 2.0, {"use": 1e17}) <= 1.0 + 1e-6
    only = replace(problem.budgets[0], single=(np.array([0.1, 0.1]), np.array([1.1])))
    assert smallest_conflict(replace(problem, budgets=(only,)).compiled().instance) == ()
    for name in ("labels", "overlap_mip"):
        assert answer(problem, name).choice == (0, 0)


@pytest.mark.parametrize("peak", [True, False])
def test_multipliers_bound_what_is_capped_and_others_are_refused(peak):
    """The cheap way takes two of a cap of one, the dear one nothing."""
    rows, amounts = np.array([[0, 0], [1, 1]], dtype=np.int32), np.array([[1.0, 2.0], [4.0, 0.0]])
    graph = Graph(*rows, amounts, (peak, False), np.array([False, True]))
    assert budget_bounds(graph, (4.0,), (4.0,), ((1.0,), ((2.0,),))) == pytest.approx(
        (4.0 if peak else 2.0,)
    )
    (proven,) = budget_bounds(graph, (4.0,), (4.0,), ((1.0,), ((0.0,),)))
    assert proven == (-np.inf if peak else 1.0)
    for none in ((np.nan,), (np.inf,), (1.0, 1.0), ()):
        with pytest.raises(SolverError, match="where 1 numbers belong"):
            budget_bounds(graph, (4.0,), (4.0,), ((1.0,), (none,)))


def test_few_labels_stop_with_a_bound(problem25):
    capped = replace(
        problem25,
        budgets=(travel(problem25, 18.0), steps_over(problem25, "F_largest", 250.0, 18.0)),
    )
    best = solve(capped, "labels")
    assert best.ended is End.DONE
    assert best.certificate.claimed_gap <= 1e-6
    few = solve(capped, "labels", most=8)
    assert few.selection.bound[0] <= best.certificate.objective <= few.certificate.objective
    assert few.ended is End.STOPPED or few.selection.bound == few.selection.objective
    assert few.certificate.claimed_gap < 0.02
    with pytest.raises(ProblemError, match="name it in `also`"):
        steps_over(problem25, "F_rob9", 100.0, 1.0)
    tight = replace(capped, budgets=(*capped.budgets, travel(problem25, 11.4)))
    with pytest.raises(TimeUpError, match="no path within all caps was found yet"):
        solve(tight, "labels", most=1, time_limit=0)


def test_labels_prove_only_what_all_of_them_close(monkeypatch):
    """Both cheap candidates exceed the cap together; multipliers alone say half of what is left."""
    pairs = (np.zeros((1, 2)), np.zeros((2, 2)))
    costs = LayeredCosts((np.array([0.0, 1.0]), np.array([0.0, 2.0])), pairs)
    use = (np.array([1.0, 0.0]),) * 2
    problem = Costs(costs, (Budget("use", use, pairs, 1.5),))
    assert bounded(problem, 1.0, {}) == pytest.approx(1.0)
    whole = budget_proof._swept

    def spoiled(*asked):
        found = whole(*asked)
        return replace(found, kept=found.kept[:1])

    monkeypatch.setattr(budget_proof, "_swept", spoiled)
    assert bounded(problem, 1.0, {}) == pytest.approx(0.5)
