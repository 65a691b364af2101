"""What placement hands around are values: compared by content, read-only, short at the prompt."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from seqopt.graph.decision_costs import Budget, LayeredCosts
from tests.layered import Costs, answer


def made(cost=1.0):
    """One of each kind."""
    costs = LayeredCosts((np.array([cost, 2.0, 3.0]),), (np.zeros((1, 3)),))
    budget = Budget("use", costs.single, costs.shared, 9.0)
    instance = Costs(costs, (budget,)).compiled().instance
    proof = answer(Costs(costs, (budget,)), "labels").certificate
    return costs, budget, instance, instance.asked, proof


@pytest.mark.parametrize("kind", range(5))
def test_values(kind):
    one, same, other = made()[kind], made()[kind], made(1.5)[kind]
    assert one == same
    assert hash(one) == hash(same)
    assert one != other
    assert "array(" not in repr(one)
    with pytest.raises(FrozenInstanceError):
        one.name = "other"
