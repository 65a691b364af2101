"""Ranks over all pairs, and given the choice before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seqopt.graph._decision_search import Windows
from seqopt.graph.decision_costs import best_in_order
from seqopt.graph.decisions import pose_decisions
from seqopt.plan.solve import solve
from seqopt.problem.criteria import Ranked, _ranks_of
from seqopt.problem.problem import Aim
from seqopt.study.published import EQUATIONS

CONDITIONAL = replace(EQUATIONS, ranked=Ranked.CONDITIONAL)
values = st.one_of(st.integers(0, 4).map(float), st.just(np.nan))


@given(st.integers(1, 6).flatmap(lambda n: st.lists(st.lists(values, min_size=n, max_size=n))))
def test_rows_are_ranked_as_if_alone(rows):
    table = np.array(rows, float)
    if not np.isfinite(table).any() or table.ndim != 2:
        return
    together = _ranks_of(table, 9, Ranked.CONDITIONAL)
    for row, ranks in zip(table, together, strict=True):
        alone = _ranks_of(row, 9) if np.isfinite(row).any() else np.full(row.shape, np.nan)
        np.testing.assert_array_equal(ranks, alone)


def test_the_conditional_objective_is_what_a_search_of_one_move_goes_by(engine25, loop25):
    problem = pose_decisions(engine25, loop25, CONDITIONAL)
    choice = solve(problem, "cascade").choice
    windows = Windows(problem, [*choice])
    for k in range(len(choice)):
        before = choice[k - 1] if k else 0
        charged = problem.sums.single[k] + problem.sums.shared[k][before]
        allowed = np.isfinite(charged)
        np.testing.assert_allclose(charged[allowed], windows.costs(k)[allowed])
        assert charged[choice[k]] == charged.min()


def conditional(problem):
    """The same candidates, ranks being those given the choice before."""
    criterion = replace(problem.criterion, ranked=Ranked.CONDITIONAL)
    return replace(problem, criterion=criterion)


def test_the_reference_arch_under_both(problem25):
    """The cascade loses nothing by being short of sight, and all by the change of objective."""
    cascade, other = solve(problem25, "cascade"), conditional(problem25)
    assert problem25.sums.cost(cascade.choice) == pytest.approx(663.81, abs=0.01)
    assert other.sums.cost(cascade.choice) == pytest.approx(664.5)
    exact = solve(other, "overlap_dp")
    assert exact.certificate.objective == pytest.approx(656.025)
    assert solve(other, "cascade").certificate.gap == pytest.approx(0.01275, abs=1e-5)
    sighted = best_in_order([(other.sums, Aim.SUM), (problem25.sums, Aim.SUM)])
    assert problem25.sums.cost(sighted) == pytest.approx(663.81, abs=0.01)
