"""What exact formulations share: how programs are solved, read and bounded, costs of any sign."""

from __future__ import annotations

from itertools import pairwise

import cvxpy as cp
import numpy as np
import pytest

from formulations import rank_search
from formulations.flow import OVERLAP_MIP
from formulations.solvers import minimize_by_highs
from seqopt.errors import ProblemError
from seqopt.graph.decision_costs import LayeredCosts
from seqopt.graph.formulation import Watch, exhibits, find_formulation
from seqopt.graph.graph import Graph
from seqopt.problem.problem import Aim
from tests.layered import Costs, answer

PROGRAMS = {OVERLAP_MIP.name: OVERLAP_MIP, **exhibits()}
EXACT = PROGRAMS | {n: find_formulation(n) for n in ("overlap_dp", "overlap_lp", "minimax")}


def costs_of(lowest, seed=0):
    """Random costs of three moves, some below zero if the lowest is."""
    rng = np.random.default_rng(seed)
    sizes = (3, 4, 2)
    single = tuple(rng.uniform(lowest, 9.0, size) for size in sizes)
    shared = tuple(rng.uniform(lowest, 9.0, pair) for pair in pairwise(sizes))
    return LayeredCosts(single, (np.zeros((1, sizes[0])), *shared))


@pytest.mark.parametrize("lowest", [-9.0, 1.0])
@pytest.mark.parametrize("name", EXACT)
def test_the_choice_and_its_bound_are_the_least(name, lowest):
    costs, aim, told = Costs(costs_of(lowest)), EXACT[name].aim, []
    least = costs.best(aim)
    found = answer(costs, name, progress=told.append)
    assert not found.stopped
    assert costs.worth(found.choice, aim) == pytest.approx(found.objective, rel=1e-12)
    assert found.objective == pytest.approx(least, rel=1e-9)
    assert least - 1e-4 * max(abs(least), 9.0) <= found.bound <= least + 1e-12 * abs(least)
    assert all(one.bound <= least + 1e-12 * abs(least) for one in told)


@pytest.mark.parametrize("name", PROGRAMS)
def test_without_time_it_is_an_allowed_choice_and_what_is_known_of_the_least(name):
    costs, aim = Costs(costs_of(-9.0)), PROGRAMS[name].aim
    found = answer(costs, name, time_limit=0.0)
    assert found.stopped == "time"
    assert found.bound <= costs.best(aim) + 1e-9
    assert costs.best(aim) <= found.objective + 1e-9
    assert costs.worth(found.choice, aim) == pytest.approx(found.objective, rel=1e-12)


def test_an_assignment_needs_a_state_of_every_level():
    source, target = np.array([0, 0, 1]), np.array([1, 2, 2])
    ends = np.array([False, False, True])
    for name in ("assignment_tight", "assignment_loose", "minimax_layer", "minimax_big_m"):
        peak = PROGRAMS[name].aim is Aim.PEAK
        graph = Graph(source, target, np.ones((3, 1)), (peak,), ends)
        with pytest.raises(ProblemError, match="an assignment chooses a state of every level"):
            PROGRAMS[name].solve.choose(graph, Watch())


def test_how_much_is_enumerated_at_once(monkeypatch):
    free = tuple(np.zeros(2) for _ in range(3))
    problem = Costs(LayeredCosts(free, (np.zeros((1, 2)), np.eye(2), np.eye(2))))
    monkeypatch.setattr(rank_search, "MOST", 8)
    assert answer(problem, "rank_search", horizon=9).choice == (0, 1, 0)
    monkeypatch.setattr(rank_search, "MOST", 7)
    assert answer(problem, "rank_search", horizon=2).choice == (0, 1, 0)
    with pytest.raises(ProblemError, match=r"8 combinations of 3 moves; .*\(at most 7e\+00 are"):
        answer(problem, "rank_search", horizon=9)


def boxed_program():
    """The least is 5 - 2 + 1 - 0.5: with the offset, a bound below and one below zero."""
    x, y = cp.Variable(2, boolean=True), cp.Variable(bounds=[-0.5, 2.0])
    z = cp.Variable()
    rules = [x[0] + x[1] == 1, z >= 1.0, z <= 3.0]
    return cp.Problem(cp.Minimize(5.0 - 2.0 * x[0] - x[1] + y + z), rules)


def test_programs_keep_their_offset_bounds_and_equations(capfd):
    found = minimize_by_highs(boxed_program(), feasible=True)
    assert found.value == pytest.approx(3.5)
    assert found.bound == pytest.approx(3.5)
    assert not found.stopped
    assert 0 <= found.compile_seconds < 600
    assert capfd.readouterr().out == ""  # the solver keeps quiet
