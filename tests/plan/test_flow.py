"""A problem as a flow, by hand: arcs, balance, units, bounds; and when a budget is hopeless."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from formulations.layers.priced_paths import ACCURACY, layered_flow
from seqopt.graph.layers.interface import CostProblem

from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.layers.costs import Budget, LayeredCosts
from seqopt.judge.certificate import TOLERANCE

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
    return CostProblem(costs, tuple(Budget(f"use {i}", *taken, b) for i, b in enumerate(bounds)))


ARCS = (
    *((0, (0, 0)), (0, (0, 2))),
    *((1, (0, 0)), (1, (0, 1)), (1, (1, 0)), (1, (1, 1)), (1, (2, 0))),
    *((2, (0, 0)), (2, (0, 1)), (2, (1, 0)), (2, (1, 1))),
)  # the move, and which candidates of the one before and of it


def flow_of(choice):
    """The flow of a choice, arc by arc."""
    pairs = [*zip((0, *choice[:-1]), choice, strict=True)]
    return np.array([float(pairs[move] == arc) for move, arc in ARCS])


ALLOWED = [(0, 0, 0), (0, 0, 1), (0, 1, 0), (0, 1, 1), (2, 0, 0), (2, 0, 1)]


def test_arcs_are_the_pairs_that_are_allowed():
    flow = layered_flow(problem())
    assert flow.scale == 3003
    cost = [1001, 3003, 11, 22, 13, 24, 15, 93, 208, 109, 210]
    assert flow.cost * 3003 == pytest.approx(cost, rel=1e-14)
    assert [mask.sum() for mask in flow.allowed] == [2, 5, 4]
    assert (flow.amounts, flow.caps, flow.units, flow.names) == ((), (), (), ())
    assert flow.feasible


@pytest.mark.parametrize("choice", ALLOWED)
def test_a_choice_is_a_unit_flow_and_comes_back(choice):
    own = problem(90.0)
    flow, arcs = layered_flow(own), flow_of(choice)
    assert (flow.balance @ arcs).tolist() == flow.source.tolist() == [1, 0, 0, 0, 0, 0]
    assert flow.cost @ arcs * flow.scale == pytest.approx(own.sums.cost(choice), rel=1e-14)
    assert flow.amounts[0] @ arcs * flow.units[0] == own.budgets[0].spent(choice)
    assert flow.choice(arcs) == choice
    assert flow.choice(0.6 * arcs + 0.4 * flow_of((2, 0, 0))) == choice


def test_what_is_no_path_is_out_of_balance():
    """One unit that ends with the second move, one that starts there, two, one that jumps."""
    balance = layered_flow(problem()).balance
    whole, moves = flow_of((0, 0, 0)), np.array([move for move, _ in ARCS])
    jumps = np.where(moves == 1, flow_of((2, 0, 0)), whole)
    for arcs in (whole * (moves < 2), whole * (moves > 0), whole + flow_of((2, 0, 1)), jumps):
        assert (balance @ arcs).tolist() != [1, 0, 0, 0, 0, 0]


@pytest.mark.parametrize(
    ("factor", "unit"),
    [(1.0, 10.0), (0.2, 10.0), (0.19, 1.0), (2.0, 100.0), (1e-4, 1e-3), (-1.0, 10.0), (0.0, 1.0)],
)
def test_amounts_are_of_order_one(factor, unit):
    """The largest amount is 50; its unit is the power of ten below it, or 1 without any."""
    own = problem(1e9)
    taken = own.budgets[0]
    single, shared = (tuple(factor * a for a in part) for part in (taken.single, taken.shared))
    budget = replace(taken, single=single, shared=shared, bound=120.0)
    flow = layered_flow(replace(own, budgets=(budget,)))
    assert flow.units == pytest.approx([unit], rel=1e-12)
    assert flow.caps == pytest.approx([120.0 / unit], rel=1e-12)
    assert flow.amounts[0] * unit == pytest.approx(
        factor * np.array([30, 50, 1, 2, 0, 0, 3, 0, 0, 0, 0]), rel=1e-12
    )


def test_bounds_and_prices_are_in_the_units_of_costs_and_budgets():
    flow = layered_flow(problem(90.0, 900.0))
    assert flow.bound(0.5) == 1501.5 - ACCURACY * 3003  # by the larger of value and scale
    assert flow.bound(-0.5) == -1501.5 - ACCURACY * 3003
    assert flow.bound(4.0) == 12012 - ACCURACY * 12012
    assert flow.bound(-4.0) == -12012 - ACCURACY * 12012
    assert flow.prices([2.0, -3.0]) == {"use 0": 3003 / 10 * 2, "use 1": 3003 / 10 * -3}


def test_costs_of_nothing_have_a_scale():
    free = CostProblem(LayeredCosts(*amounts(([0, 0],), ([[0, 0]],))))
    assert np.isfinite(layered_flow(free).cost).all()


def test_when_a_choice_is_known_to_be_within_the_budgets():
    """One budget is proven by a choice that takes the least; two may each need another."""
    least = 31.0  # of the six choices
    assert min(problem(1.0).budgets[0].spent(c) for c in ALLOWED) == least
    assert layered_flow(problem(least)).feasible
    assert not layered_flow(problem(least - 1e-9)).feasible  # within what solvers leave
    assert not layered_flow(problem(99.0, 99.0)).feasible


@pytest.mark.parametrize(
    "sizes", [(3, 2), (3, 2, 3), (3, 2, 1), (4, 2, 2), (2, 2, 2), (3, 2, 2, 1)]
)
def test_a_budget_is_for_the_moves_and_candidates_of_the_problem(sizes):
    single = tuple(np.ones(size) for size in sizes)
    shared = tuple(np.ones(pair) for pair in zip((1, *sizes[:-1]), sizes, strict=True))
    with pytest.raises(ProblemError, match="budget 'other' is for other moves or candidates"):
        layered_flow(replace(problem(), budgets=(Budget("other", single, shared, 99.0),)))


@pytest.mark.parametrize(("share", "hopeless"), [(0.99, False), (1.01, True)])
def test_a_budget_that_no_choice_keeps_is_named(share, hopeless):
    """Beyond the tolerance, over what the choices take at most: 50 and 3."""
    own = problem(90.0, 31.0 - share * TOLERANCE * 53.0)
    if hopeless:
        with pytest.raises(InfeasibleError, match=r"at least 31 of 'use 1', more than 30\.9"):
            layered_flow(own)
    else:
        assert not layered_flow(own).feasible
