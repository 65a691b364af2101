"""Formulations against the programs that their own texts display, written out by enumeration."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formulations import beam, rank_search
from formulations.solvers import minimize_by_highs
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.decision_costs import LayeredCosts
from seqopt.graph.formulation import Watch
from seqopt.problem.problem import Aim
from tests.layered import Costs, answer
from tests.strategies import problems

INF = np.inf


def conditional(costs, move, before):
    """What a search of one move is charged for pairs, as ranks among its own candidates are."""
    row = np.nan_to_num(costs.shared[move][before], posinf=1.0)
    return (7 * row + 3 * move) % 5


def ranked(problem):
    """The problem as one of ranks, or None if no choice is allowed."""
    costs = problem.sums
    if np.isinf(costs.least(Aim.SUM)):
        return None
    rows = [
        np.array([conditional(costs, k, i) for i in range(len(shared))])
        for k, shared in enumerate(costs.shared)
    ]
    return replace(problem, alone=LayeredCosts(costs.single, (costs.shared[0], *rows[1:])))


def later(costs, k, i):
    """Whether a candidate is allowed and leads on to the last move."""
    if not np.isfinite(costs.single[k][i]):
        return False
    if k + 1 == len(costs.single):
        return True
    ahead = range(costs.sizes[k + 1])
    return any(np.isfinite(costs.shared[k + 1][i, j]) and later(costs, k + 1, j) for j in ahead)


def charged(problem, k, before, i):
    """What move k answers for in the step that it shares with the one before; None if blocked."""
    shared = problem.sums.shared[k][before[-1] if before else 0, i]
    if not (np.isfinite(shared) and later(problem.sums, k, i)):
        return None
    return problem.alone.shared[k][before[-1], i] if before else shared


def first_of_least(worth):
    """The first of those candidates that are worth least, None being worth nothing."""
    return min((value, i) for i, value in enumerate(worth) if value is not None)[1]


def cascaded(problem, charge):
    costs, choice = problem.sums, []
    for k, size in enumerate(costs.sizes):
        worth = [charged(problem, k, choice, i) for i in range(size)]
        for i in range(size):
            if worth[i] is not None and charge == "earlier":
                last = k + 1 == len(costs.sizes)
                ahead = [] if last else range(costs.sizes[k + 1])
                allowed = [j for j in ahead if later(costs, k + 1, j)]
                worth[i] = 0.0 if last else min(costs.shared[k + 1][i, j] for j in allowed)
            if worth[i] is not None:
                worth[i] += costs.single[k][i]
        choice.append(first_of_least(worth))
    return tuple(choice)


def searched(problem, horizon):
    costs, choice = problem.sums, []
    while len(choice) < len(costs.sizes):
        k, worth = len(choice), {}
        for ahead in product(*(range(size) for size in costs.sizes[k : k + horizon])):
            total = charged(problem, k, choice, ahead[0])
            if total is None or not all(later(costs, k + n, i) for n, i in enumerate(ahead)):
                continue
            total += sum(costs.single[k + n][i] for n, i in enumerate(ahead))
            total += sum(costs.shared[k + n + 1][p] for n, p in enumerate(pairwise(ahead)))
            if np.isfinite(total):
                worth[ahead] = total
        best = min(worth, key=lambda ahead: (worth[ahead], ahead))
        choice += best if k + horizon >= len(costs.sizes) else best[:1]
    return tuple(choice)


def beamed(problem, width):
    costs, kept = problem.sums, [(0.0, ())]
    for k, size in enumerate(costs.sizes):
        found = []
        for i in range(size):
            before = [
                (c + costs.shared[k][p[-1] if p else 0, i], n) for n, (c, p) in enumerate(kept)
            ]
            total, n = min(before)
            if later(costs, k, i) and np.isfinite(total):
                found.append((total + costs.single[k][i], (*kept[n][1], i)))
        kept = sorted(found, key=lambda pair: pair[0])[:width]
        if not kept:
            return cascaded(problem, "later")
    return min(kept[0][1], cascaded(problem, "later"), key=costs.cost)


@given(problem=problems(), data=st.data())
@settings(max_examples=40)
def test_heuristics_do_what_they_display(problem, data):
    """Also where the shared step, once the choice before is made, is ranked otherwise."""
    own = ranked(problem)
    if own is None:
        return
    charge = data.draw(st.sampled_from(["later", "earlier"]))
    number = data.draw(st.integers(1, 4))
    for name, options, choice in (
        ("cascade", {"charge": charge}, cascaded(own, charge)),
        ("beam", {"width": number}, beamed(own, number)),
        ("rank_search", {"horizon": number}, searched(own, number)),
    ):
        found = answer(own, name, **options)
        assert (name, found.choice) == (name, choice)
        assert (found.objective, found.bound) == (own.sums.cost(choice), -INF)


@given(problem=problems())
def test_exact_ones_take_the_best_and_of_equal_ones_the_first(problem):
    costs = problem.sums
    choices = [*product(*(range(size) for size in costs.sizes))]
    if not np.isfinite([costs.cost(c) for c in choices]).any():
        for name in ("overlap_dp", "minimax"):
            with pytest.raises(InfeasibleError):
                answer(problem, name)
        return
    best = min(choices, key=lambda c: (costs.cost(c), c))
    found = answer(problem, "overlap_dp")
    assert (found.choice, found.objective, found.bound) == (best, *[costs.cost(best)] * 2)
    flat = min(choices, key=lambda c: (costs.worst(c), costs.cost(c)))
    found = answer(problem, "minimax")
    assert costs.cost(found.choice) == costs.cost(flat)
    assert found.objective == found.bound == costs.worst(found.choice) == costs.worst(flat)


@pytest.mark.parametrize("seed", range(4))
def test_exact_ones_on_costs_of_any_sign(seed):
    rng = np.random.default_rng(seed)
    sizes = rng.integers(2, 5, size=4)
    single = tuple(rng.integers(-9, 9, size=size).astype(float) for size in sizes)
    pairs = zip((1, *sizes[:-1]), sizes, strict=True)
    costs = LayeredCosts(single, tuple(rng.integers(-9, 9, size=p).astype(float) for p in pairs))
    choices = [*product(*(range(size) for size in costs.sizes))]
    problem = Costs(costs)
    total, worst = min(map(costs.cost, choices)), min(map(costs.worst, choices))
    assert answer(problem, "overlap_dp").objective == total
    assert answer(problem, "minimax").objective == worst
    for name in ("overlap_lp", "overlap_mip"):
        found = answer(problem, name)
        assert found.objective == total
        assert total - 1e-4 <= found.bound <= total
        assert found.prices == {}
        assert found.compile_seconds > 0


def test_how_much_is_enumerated_at_once(monkeypatch):
    free = tuple(np.zeros(2) for _ in range(3))
    problem = Costs(LayeredCosts(free, (np.zeros((1, 2)), np.eye(2), np.eye(2))))
    monkeypatch.setattr(rank_search, "MOST", 8)
    assert answer(problem, "rank_search", horizon=9).choice == (0, 1, 0)
    monkeypatch.setattr(rank_search, "MOST", 7)
    assert answer(problem, "rank_search", horizon=2).choice == (0, 1, 0)
    with pytest.raises(ProblemError, match=r"8 combinations of 3 moves; .*\(at most 7e\+00 are"):
        answer(problem, "rank_search", horizon=9)


class Counting(Watch):
    """A watch whose time is over after so many looks."""

    def __init__(self, looks):
        super().__init__()
        self.looks = looks

    @property
    def over(self):
        self.looks -= 1
        return self.looks < 0


def test_a_beam_says_whether_it_came_to_its_end():
    flat = [np.zeros((1, 2)), np.ones((2, 2)), np.ones((2, 2))]
    costs = Costs(LayeredCosts(single=[np.array([0.0, 1.0])] * 3, shared=flat))
    graph = costs.compiled().instance.asked
    assert not beam.choose(graph, Watch()).stopped
    for looks in (0, 1, 2):  # the greedy search alone is done
        assert beam.choose(graph, Counting(looks)) == ((1, 3, 5), (), True, (), 0.0)
    assert not beam.choose(graph, Counting(3)).stopped


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


def test_a_program_without_time_is_stopped_and_claims_nothing():
    x = cp.Variable(40, nonneg=True)
    program = cp.Problem(cp.Minimize(cp.max(x)), [cp.sum(x) == 1])
    assert minimize_by_highs(program, feasible=True).value == pytest.approx(1 / 40)
    found = minimize_by_highs(program, feasible=True, watch=Watch(time_limit=0.0))
    assert found.stopped or found.value == pytest.approx(1 / 40)
    whole = minimize_by_highs(boxed_program(), feasible=True, watch=Watch(time_limit=0.0))
    assert whole.stopped or whole.value == pytest.approx(3.5)  # presolve may be done at once
