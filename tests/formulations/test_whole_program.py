"""What integer programs share: how they are solved, read and bounded."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from itertools import pairwise, product

import numpy as np
import pytest
from formulations.layers.exhibits import (
    MINIMAX_LAYER,
    _flow_of_peaks,
    _largest_of_each,
    _worst_pairs,
    below,
)
from formulations.layers.overlap_flow import OVERLAP_MIP
from formulations.layers.priced_paths import ACCURACY
from seqopt.graph.layers.interface import CostProblem

from seqopt.errors import InfeasibleError
from seqopt.graph.formulation import End, Watch, exhibits
from seqopt.graph.layers.costs import LayeredCosts

PROGRAMS = {OVERLAP_MIP.name: OVERLAP_MIP, **exhibits()}


def costs_of(lowest, seed=0):
    """Random costs of three moves, some below zero if the lowest is."""
    rng = np.random.default_rng(seed)
    sizes = (3, 4, 2)
    single = tuple(rng.uniform(lowest, 9.0, size) for size in sizes)
    shared = tuple(rng.uniform(lowest, 9.0, pair) for pair in pairwise(sizes))
    return LayeredCosts(single, (np.zeros((1, sizes[0])), *shared))


@pytest.mark.parametrize("lowest", [-9.0, 1.0])
@pytest.mark.parametrize("name", PROGRAMS)
def test_the_choice_and_its_bound_are_the_least(name, lowest):
    costs, formulation = costs_of(lowest), PROGRAMS[name]
    problem, aim = CostProblem(costs), formulation.aim
    least = min(aim.value_of(costs, choice) for choice in product(*map(range, costs.sizes)))
    found = formulation.solve(problem)
    assert found.end is End.DONE
    assert aim.value_of(costs, found.choice) == found.objective == pytest.approx(least, rel=1e-9)
    assert least - 1e-4 * max(abs(least), 9.0) <= found.bound <= least
    told = []
    watch = Watch(progress=told.append)
    formulation.solve(problem, watch=watch)
    assert all(one.bound <= least for one in told)


@pytest.mark.parametrize("name", PROGRAMS)
def test_without_time_it_is_an_allowed_choice_and_what_is_known_of_the_least(name):
    costs, formulation = costs_of(-9.0), PROGRAMS[name]
    aim = formulation.aim
    least = min(aim.value_of(costs, choice) for choice in product(*map(range, costs.sizes)))
    found = formulation.solve(CostProblem(costs), watch=Watch(time_limit=0.0))
    assert found.end is End.STOPPED
    assert found.bound <= least <= found.objective == aim.value_of(costs, found.choice)


def test_a_program_is_itself_and_one_without_a_choice_is_infeasible():
    problem = CostProblem(costs_of(1.0))
    written = OVERLAP_MIP.solve.write(problem)
    with pytest.raises(FrozenInstanceError):
        written.feasible = False
    assert written != OVERLAP_MIP.solve.write(problem)  # each has variables of its own
    assert hash(written) == hash(written)
    assert MINIMAX_LAYER.solve.write(problem).feasible
    costs = costs_of(1.0)
    never = tuple(np.full(part.shape, np.inf) for part in costs.shared[1:])
    impossible = CostProblem(LayeredCosts(costs.single, (costs.shared[0], *never)))
    with pytest.raises(InfeasibleError):
        OVERLAP_MIP.solve.write(impossible)


def test_what_is_read_from_assignments():
    picks = np.array([0.1, 0.9, 0.0, 0.2, 0.8, 1.0])
    assert _largest_of_each((2, 3, 1))(picks) == (1, 2, 0)
    assert _largest_of_each((6,))(picks) == (5,)


@pytest.mark.parametrize(("scale", "least"), [(4.0, 0.0), (0.5, -3.0)])
@pytest.mark.parametrize("value", [-7.0, 0.25, 3.0])
def test_a_bound_is_lower_by_what_a_solver_may_be_off(scale, least, value):
    off = ACCURACY * max(abs(value), 1.0)
    assert below(scale, least)(value) == pytest.approx(least + scale * (value - off), rel=1e-15)
    assert below(scale)(value) == pytest.approx(scale * (value - off), rel=1e-15)


@pytest.mark.parametrize("lowest", [-9.0, 1.0])
def test_pairs_cost_the_worst_of_both(lowest):
    costs = costs_of(lowest)
    worst, least = _worst_pairs(costs)
    for part, shared, single in zip(worst, costs.shared, costs.single, strict=True):
        assert (part == np.maximum(shared, single[None, :])).all()
    assert least == min(0.0, *(part.min() for part in worst))
    flow, bound = _flow_of_peaks(CostProblem(costs))
    assert flow.cost.min() >= 0.0
    sizes = [np.concatenate([part.ravel() for part in worst])]
    assert flow.cost == pytest.approx((sizes[0] - least) / (sizes[0] - least).max(), rel=1e-12)
    assert bound(0.5) == pytest.approx(least + flow.bound(0.5), rel=1e-15)
