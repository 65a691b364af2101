"""A problem as a flow, by hand: arcs, balance, units, bounds; and when a budget is hopeless."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.decision_costs import Budget, LayeredCosts
from seqopt.graph.paths import TIED
from tests.layered import Costs, answer

INF = np.inf


def amounts(single, shared):
    return (
        tuple(np.array(s, dtype=float) for s in single),
        tuple(np.array(s, dtype=float) for s in shared),
    )


def problem(*bounds):
    """Three moves; the second candidate of the first and one pair of the second are not allowed."""
    costs = LayeredCosts(
        *amounts(
            ([1, INF, 3], [10, 20], [100, 200]),
            ([[1000, 2000, 3000]], [[1, 2], [3, 4], [5, INF]], [[-7, 8], [9, 10]]),
        )
    )
    taken = amounts(
        ([30, 0, 50], [0, 0], [0, 0]), ([[0, 0, 0]], [[1, 2], [0, 0], [3, 0]], [[0, 0], [0, 0]])
    )
    return Costs(costs, tuple(Budget(f"use {i}", *taken, b) for i, b in enumerate(bounds)))


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_multipliers_are_costs_over_amounts(unit):
    """What costs 1 takes 4, what costs 3 takes 2: a unit more of the budget would save 1."""
    one = (np.zeros((1, 2)),)
    costs = LayeredCosts((np.array([1.0, 3.0]),), one)
    budget = Budget("use", (unit * np.array([4.0, 2.0]),), one, unit * 2.5)
    for name in ("overlap_lp", "lagrangian"):
        found = answer(Costs(costs, (budget,)), name)
        assert found.bound == pytest.approx(2.5, rel=1e-6)
        assert found.prices["use"] == pytest.approx(1.0 / unit, rel=1e-5)


@pytest.mark.parametrize("sizes", [(3, 2), (4, 2, 2), (3, 2, 1)])
def test_a_budget_is_for_the_moves_and_candidates_of_the_problem(sizes):
    single = tuple(np.ones(size) for size in sizes)
    shared = tuple(np.ones(pair) for pair in zip((1, *sizes[:-1]), sizes, strict=True))
    with pytest.raises(ProblemError, match="budget 'other' is for other moves or candidates"):
        replace(problem(), budgets=(Budget("other", single, shared, 99.0),)).compiled()


@pytest.mark.parametrize(("less", "hopeless"), [(0.9 * TIED, False), (1e-4, True)])
@pytest.mark.parametrize("name", ["labels", "lagrangian", "overlap_lp", "overlap_mip"])
def test_a_budget_that_no_choice_keeps_is_named(name, less, hopeless):
    """The least that a choice takes is 31; what is closer than rounding keeps the budget."""
    own = problem(90.0, 31.0 * (1 - less))
    if hopeless:
        with pytest.raises(InfeasibleError, match=r"at least 31 of 'use 1', more than 30\.9"):
            answer(own, name)
    else:
        assert own.budgets[1].spent(answer(own, name).choice) == 31.0


def test_a_program_that_is_too_large_says_its_size(monkeypatch):
    name = "overlap_lp"
    monkeypatch.setattr("formulations.flow.MOST_ARCS", 9)
    assert answer(problem(), name).choice == (0, 0, 0)
    monkeypatch.setattr("formulations.flow.MOST_ARCS", 8)
    with pytest.raises(ProblemError, match=r"of 9 moves between 5 states is too large .* path_dp"):
        answer(problem(), name)
