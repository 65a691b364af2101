"""Costs and budgets as arrays: sums, peaks, what can be continued, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.decision_costs import Budget, LayeredCosts
from tests.layered import Costs

INF = np.inf


def three_moves():
    """Costs of which every sum of three single and three shared ones is another number."""
    single = (np.array([1.0, 2.0]), np.array([10.0, 20.0, 40.0]), np.array([100.0, 200.0]))
    shared = (
        np.array([[1e3, 2e3]]),
        np.array([[1e4, 2e4, 3e4], [4e4, 5e4, 6e4]]),
        np.array([[1e5, 2e5], [3e5, 4e5], [5e5, 6e5]]),
    )
    return LayeredCosts(single, shared)


def changed(part, move, value):
    """The costs of three moves with those of a move replaced."""
    costs = three_moves()
    arrays = list(getattr(costs, part))
    arrays[move] = value
    return replace(costs, **{part: tuple(arrays)})


def test_a_choice_meets_its_own_costs_and_those_it_shares_with_the_one_before():
    costs = three_moves()
    assert costs.sizes == (2, 3, 2)
    assert costs.parts((1, 2, 0)) == [2.0, 2e3, 40.0, 6e4, 100.0, 5e5]
    assert costs.cost((1, 2, 0)) == 562142.0
    assert costs.worst((1, 2, 0)) == 5e5
    assert costs.worst((0, 0, 1)) == 2e5
    with pytest.raises(ValueError, match="zip"):
        costs.parts((1, 2))


def test_costs_are_copies_that_cannot_be_written_to():
    given_array = np.array([1.0, 2.0])
    costs = LayeredCosts((given_array,), (np.zeros((1, 2)),))
    given_array[0] = 9.0
    assert costs.single[0][0] == 1
    for array in (*costs.single, *costs.shared):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 1


@pytest.mark.parametrize(
    ("part", "move", "value", "named"),
    [
        ("single", 0, [INF, INF], "move 1: none of its 2 candidates"),
        ("shared", 1, np.full((2, 3), INF), "move 2: none of its 3 candidates"),
        ("single", 2, [INF, INF], "move 3: none of its 2 candidates"),
    ],
)
def test_the_move_that_ends_every_choice_is_named(part, move, value, named):
    with pytest.raises(InfeasibleError, match=named):
        Costs(changed(part, move, np.array(value))).compiled()


def test_a_move_without_candidates_is_named():
    with pytest.raises(ProblemError, match="move 1 has no candidates"):
        changed("single", 0, np.zeros(0))


def use(bound):
    """A budget of which the candidates of two moves take 3 and -5, 0 and 4."""
    return Budget(
        "use",
        (np.array([3.0, -5.0]), np.array([0.0, 4.0])),
        (np.zeros((1, 2)), np.array([[0.0, 1.0], [0.0, 1.0]])),
        bound,
    )


@pytest.mark.parametrize(("choice", "taken"), [((0, 0), 3.0), ((1, 1), 0.0), ((0, 1), 8.0)])
def test_what_a_choice_takes_of_a_budget(choice, taken):
    """With what the pair takes; amounts that cancel do."""
    budget = use(12.0)
    assert budget.spent(choice) == taken
    assert budget.spent(choice) == LayeredCosts(budget.single, budget.shared).cost(choice)
