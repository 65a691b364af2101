"""What placement hands around are values: compared by content, read-only, short at the prompt."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from formulations.layers.priced_paths import layered_flow
from seqopt.graph.layers.interface import CostProblem

from seqopt.graph.layers.costs import Budget, LayeredCosts
from seqopt.graph.solution import Selection
from seqopt.judge.certificate import certify
from seqopt.problem.problem import Aim


def made(cost=1.0):
    """One of each kind."""
    costs = LayeredCosts((np.array([cost, 2.0, 3.0]),), (np.zeros((1, 3)),))
    budget = Budget("use", costs.single, costs.shared, 9.0)
    problem = CostProblem(costs, (budget,))
    proof = certify(problem, Selection((0,), cost), Aim.SUM)
    return costs, budget, problem, proof, layered_flow(problem)


@pytest.mark.parametrize("kind", range(5))
def test_values(kind):
    one, same, other = made()[kind], made()[kind], made(1.5)[kind]
    assert one == same
    assert hash(one) == hash(same)
    assert one != other
    assert "array(" not in repr(one)
    with pytest.raises(FrozenInstanceError):
        one.name = "other"
