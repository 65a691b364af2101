"""What a formulation claims is recomputed: false answers, broken promises, bounds."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from seqopt.graph.layers.interface import CostProblem

from seqopt.errors import SolverError
from seqopt.graph.formulation import Formulation, FormulationKind, On, formulations
from seqopt.graph.layers.costs import Budget, LayeredCosts
from seqopt.graph.layers.layers import travel
from seqopt.graph.solution import Selection
from seqopt.judge.certificate import TOLERANCE, certify, judge, least_peak, least_sum
from seqopt.plan.solving import solve
from seqopt.problem.problem import Aim
from tests.strategies import problems

ALL = formulations(On.LAYERS)


FAULTS = {
    "zeros": lambda s: replace(s, choice=(0,) * len(s.choice)),
    "too short": lambda s: replace(s, choice=s.choice[:-1]),
    "out of range": lambda s: replace(s, choice=(99, *s.choice[1:])),
    "negative": lambda s: replace(s, choice=(-1, *s.choice[1:])),
    "false objective": lambda s: replace(s, objective=0.9 * s.objective),
    "not a number": lambda s: replace(s, objective=float("nan")),
    "false bound": lambda s: replace(s, bound=1.1 * s.objective),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_false_answer_is_caught(problem25, fault):
    good = ALL["overlap_dp"].solve(problem25)
    certify(problem25, good, Aim.SUM)
    with pytest.raises(SolverError):
        certify(problem25, FAULTS[fault](good), Aim.SUM)


def test_promises_are_held(problem25):
    """A heuristic that calls itself exact is refused, and so is a bound above the optimum."""
    cascade = ALL["cascade"]
    with pytest.raises(SolverError, match="promises the optimum"):
        solve(problem25, replace(cascade, kind=FormulationKind.EXACT))
    poor = cascade.solve(problem25)
    with pytest.raises(SolverError, match="claimed bound"):
        certify(problem25, replace(poor, bound=poor.objective), Aim.SUM)


def test_within_a_budget_the_certificate_proves_the_optimum_itself(problem25):
    capped = replace(problem25, budgets=(travel(problem25, 20.0),))
    for name in ("overlap_mip", "labels"):
        certificate = solve(capped, ALL[name]).certificate
        assert certificate.gap <= 1e-6
        assert certificate.bound > solve(problem25, "overlap_dp").certificate.bound + 1.0


def test_within_a_budget_a_poor_answer_is_seen_and_prices_need_not_be_believed(problem25):
    capped = replace(problem25, budgets=(travel(problem25, 20.0),))
    best = solve(capped, "labels")
    poor = min(
        (
            (*best.selection.choice[:k], other, *best.selection.choice[k + 1 :])
            for k, size in enumerate(problem25.sums.sizes)
            for other in range(size)
            if other != best.selection.choice[k]
        ),
        key=lambda c: (capped.budgets[0].spent(c) > 20.0, problem25.sums.cost(c)),
    )
    value = problem25.sums.cost(poor)
    for prices in ({}, best.selection.prices, {"robot travel [m]": 1e9}, {"robot travel [m]": -1}):
        proof = certify(capped, Selection(poor, value, prices=prices), Aim.SUM)
        assert proof.gap == pytest.approx((value - best.certificate.objective) / value, abs=1e-9)
        assert proof.gap > 1e-5


def test_a_choice_that_is_not_allowed_is_caught():
    problem = CostProblem(LayeredCosts((np.array([0.0, np.inf]),), (np.zeros((1, 2)),)))
    with pytest.raises(SolverError, match="not allowed"):
        certify(problem, Selection((1,), 0.0), Aim.SUM)


def enumerated(costs):
    """The least sum and the least peak of all choices."""
    choices = [*product(*(range(size) for size in costs.sizes))]
    return min(map(costs.cost, choices)), min(map(costs.worst, choices))


@given(problem=problems())
def test_the_least_of_any_choice_is_that_of_enumeration(problem):
    """Infinite where no choice is allowed."""
    assert (least_sum(problem.sums), least_peak(problem.sums)) == enumerated(problem.sums)


@pytest.mark.parametrize("seed", range(20))
def test_the_least_is_found_among_costs_of_any_size_and_sign(seed):
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 5, size=4)
    single = tuple(rng.normal(size=size) for size in sizes)
    shared = tuple(rng.normal(size=pair) for pair in zip((1, *sizes[:-1]), sizes, strict=True))
    costs = LayeredCosts(single, shared)
    total, peak = enumerated(costs)
    assert least_sum(costs) == pytest.approx(total, rel=1e-12)
    assert least_peak(costs) == peak


@pytest.mark.parametrize("others", [(), (7.0,), (7.0, 9.0), (7.0, 9.0, np.inf)])
def test_the_least_peak_may_be_the_lowest_or_the_highest_of_all_costs(others):
    costs = LayeredCosts((np.array([5.0, *others]),), (np.full((1, 1 + len(others)), 5.0),))
    assert least_peak(costs) == 5
    high = LayeredCosts((np.array([5.0, *others]), np.array([11.0])), (
        costs.shared[0], np.full((1 + len(others), 1), 6.0)))  # fmt: skip
    assert least_peak(high) == 11


def signed(*bounds):
    """Four choices: (0, 0) is worth 2, (0, 1) -2, (1, 0) 7 and (1, 1) 3. All take 1."""
    single, none = (np.array([-3.0, 2.0]), np.array([5.0, 1.0])), (np.zeros((1, 2)), np.eye(2) * 0)
    amounts = (np.ones(2), np.zeros(2))
    budgets = tuple(Budget(f"use {bound:g}", amounts, none, bound) for bound in bounds)
    return CostProblem(LayeredCosts(single, none), budgets)


BEST = (0, 1)  # of the sum and of the peak
VALUES = {Aim.SUM: -2.0, Aim.PEAK: 1.0}
SIZES = {Aim.SUM: 4.0, Aim.PEAK: 3.0}  # of its costs -3, 0, 1 and 0, signs aside
within = pytest.mark.parametrize("aim", Aim)


@within
@pytest.mark.parametrize("sign", [-1, 1])
def test_how_far_a_claim_may_be_off(aim, sign):
    """By the tolerance, over the size of the costs that the choice meets."""
    value, size = VALUES[aim], SIZES[aim]
    for share, good in ((0.99, True), (1.01, False)):
        off = value + sign * share * TOLERANCE * size
        if good:
            assert certify(signed(), Selection(BEST, off), aim).objective == value
        else:
            with pytest.raises(SolverError, match="as claimed"):
                certify(signed(), Selection(BEST, off), aim)


@within
def test_how_high_a_claimed_bound_may_be(aim):
    value, size = VALUES[aim], SIZES[aim]
    near = Selection(BEST, value, bound=value + 0.99 * TOLERANCE * size)
    proof = certify(signed(), near, aim)
    assert (proof.gap, proof.claimed_gap, proof.bound) == (0, 0, value)
    for bound in (value + 1.01 * TOLERANCE * size, np.inf, np.nan):
        with pytest.raises(SolverError, match=r"claimed bound .* exceeds"):
            certify(signed(), replace(near, bound=bound), aim)


def test_gaps_are_shares_of_what_the_choice_meets():
    worse = Selection((1, 1), 3.0)
    proof = certify(signed(), worse, Aim.SUM)
    assert (proof.objective, proof.bound) == (3, -2)
    assert proof.gap == proof.claimed_gap == 5 / 3
    peak = certify(signed(), Selection((1, 1), 2.0), Aim.PEAK)
    assert (peak.bound, peak.gap) == (1, 1 / 2)


def test_with_budgets_a_bound_may_lie_above_the_least_but_not_above_the_value():
    claimed = Selection((1, 1), 3.0, bound=2.5)
    with pytest.raises(SolverError, match=r"bound 2\.5 exceeds -2"):
        certify(signed(), claimed, Aim.SUM)
    proof = certify(signed(1.0, 2.0), claimed, Aim.SUM)
    assert (proof.gap, proof.claimed_gap) == (5 / 3, 0.5 / 3)
    assert proof.spent == {"use 1": 1.0, "use 2": 1.0}
    with pytest.raises(SolverError, match="exceeds 3"):
        certify(signed(1.0), replace(claimed, bound=3.1), Aim.SUM)


def test_how_far_a_budget_may_be_exceeded():
    selection = Selection(BEST, -2.0)
    certify(signed(9.0, 1 - 0.99 * TOLERANCE), selection, Aim.SUM)
    with pytest.raises(SolverError, match=r"the choice takes 1 of use 0\.9"):
        certify(signed(9.0, 1 - 2 * TOLERANCE), selection, Aim.SUM)


@pytest.mark.parametrize(("share", "good"), [(0.99, True), (1.01, False)])
def test_a_least_value_above_the_value_of_the_choice(monkeypatch, share, good):
    """Within the tolerance it is rounding, and the gap is zero."""
    found = -2.0 + share * TOLERANCE * 4.0
    monkeypatch.setattr("seqopt.judge.certificate.least", lambda *_: found)
    if good:
        assert certify(signed(), Selection(BEST, -2.0), Aim.SUM).gap == 0
    else:
        with pytest.raises(SolverError, match="lies above that of the choice"):
            certify(signed(), Selection(BEST, -2.0), Aim.SUM)


def level(*amounts):
    """A choice worth 0 of costs 0.5 and -0.5, and one worth less by the tolerance."""
    single = (np.array([0.5, 0.0]), np.array([-0.5, -TOLERANCE]))
    pairs = (np.zeros((1, 2)), np.array([[0.0, 9.0], [9.0, 0.0]]))
    budgets = tuple(Budget("use", single, pairs, amount) for amount in amounts)
    return CostProblem(LayeredCosts(single, pairs), budgets)


@pytest.mark.parametrize("sign", [-1, 1])
def test_what_is_off_by_the_tolerance_itself_is_kept(monkeypatch, sign):
    certify(level(), Selection((0, 0), sign * TOLERANCE), Aim.SUM)
    certify(level(-TOLERANCE), Selection((0, 0), 0.0), Aim.SUM)
    high = Selection((0, 0), 0.0, bound=TOLERANCE)
    formulation = replace(ALL["overlap_dp"], solve=lambda problem: None)
    assert judge(level(), replace(high, bound=-1.0), formulation).gap == TOLERANCE
    monkeypatch.setattr("seqopt.judge.certificate.least", lambda *_: 0.0)
    certify(level(), high, Aim.SUM)
    monkeypatch.setattr("seqopt.judge.certificate.least", lambda *_: TOLERANCE)
    certify(level(), high, Aim.SUM)


def test_choices_that_cost_nothing_have_no_gap():
    free = CostProblem(LayeredCosts((np.zeros(2),), (np.zeros((1, 2)),)))
    for aim in Aim:
        assert certify(free, Selection((0,), 0.0), aim).gap == 0
        with pytest.raises(SolverError, match="as claimed"):
            certify(free, Selection((0,), 1e-300), aim)


@pytest.mark.parametrize(
    ("choice", "named"),
    [
        ((0,), "names 1 candidates for 2 moves"),
        ((0, 1, 0), "names 3 candidates for 2 moves"),
        ((2, 0), "candidate 2 of 2 for move 1"),
        ((0, 2), "candidate 2 of 2 for move 2"),
        ((0, -1), "candidate -1 of 2 for move 2"),
    ],
)
def test_what_is_no_choice_is_named(choice, named):
    with pytest.raises(SolverError, match=named):
        certify(signed(), Selection(choice, 0.0), Aim.SUM)


@pytest.mark.parametrize("kind", FormulationKind)
@pytest.mark.parametrize("bounds", [(), (1.0,)])
@pytest.mark.parametrize(("excess", "kept"), [(0.99 * TOLERANCE, True), (1.01 * TOLERANCE, False)])
def test_who_promises_the_optimum_reaches_it(kind, bounds, excess, kept):
    """Budgets aside, whoever is no heuristic does."""
    none = (np.array([[1.0, 1.0]]),)
    costs = LayeredCosts((np.array([0.0, excess / (1 - excess)]),), none)
    budgets = tuple(Budget("use", (np.zeros(2),), (np.zeros((1, 2)),), b) for b in bounds)
    formulation = Formulation("own", "", kind, Aim.SUM, lambda problem: None)
    given_up = Selection((1,), costs.cost((1,)))
    if kept or bounds or kind is FormulationKind.HEURISTIC:
        gap = judge(CostProblem(costs, budgets), given_up, formulation).gap
        assert gap == pytest.approx(excess, rel=1e-6)
    else:
        with pytest.raises(
            SolverError, match="own promises the optimum 1, but the value of its choice"
        ):
            judge(CostProblem(costs, budgets), given_up, formulation)
