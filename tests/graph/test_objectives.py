"""Ranks over all pairs, and given the choice before."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import rankdata

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.graph.decision_costs import best_in_order
from seqopt.graph.decisions import move_costs, pose_decisions
from seqopt.network.build import build_network
from seqopt.plan.solve import solve
from seqopt.problem.criteria import Ranked, _ranks_of
from seqopt.problem.problem import Aim
from seqopt.sequence.methods import three_robot_loop
from seqopt.study.published import EQUATIONS
from tests.builders import small_arch

CONDITIONAL = replace(EQUATIONS, ranked=Ranked.CONDITIONAL)
values = st.one_of(st.integers(0, 4).map(float), st.just(np.nan))


def posed(count, criterion, limits=()):
    engine = ComplianceEngine(build_network(small_arch(count)))
    return pose_decisions(engine, three_robot_loop(engine.network), criterion, limits)


def rank_again(problem, choice):
    """Add up ranks anew, from responses and the nodes that are taken, one step after the other."""
    total, criterion = 0.0, problem.criterion
    schedule = problem.schedule
    for step in problem.evaluation.steps:
        later = step.moves[-1]
        move = schedule.moves[later]
        terms = criterion.before if move.bricks < criterion.crown else criterion.after
        for name, weight in terms:
            found = step.responses[name] / dict(criterion.resolution)[name[0]]
            row = found if found.ndim == 1 else found[choice[later - 1]]
            row = np.round(row.copy())
            known = np.isfinite(row)
            rank = 0.5 * (len(row) + 1)
            if np.isfinite(found).any():
                rank = dict(zip(np.flatnonzero(known), rankdata(row[known]), strict=True)).get(
                    choice[later], np.inf
                )
            total += weight * rank / sum(w for _, w in terms)
    return total


@given(st.integers(1, 6).flatmap(lambda n: st.lists(st.lists(values, min_size=n, max_size=n))))
def test_rows_are_ranked_as_if_alone(rows):
    table = np.array(rows, float)
    if not np.isfinite(table).any() or table.ndim != 2:
        return
    together = _ranks_of(table, 9, Ranked.CONDITIONAL)
    for row, ranks in zip(table, together, strict=True):
        alone = _ranks_of(row, 9) if np.isfinite(row).any() else np.full(row.shape, np.nan)
        np.testing.assert_array_equal(ranks, alone)


@pytest.mark.parametrize("ranked", Ranked)
@pytest.mark.parametrize("count", [5])
def test_exact_ones_equal_brute_force_under_every_objective(count, ranked):
    problem = posed(count, replace(EQUATIONS, ranked=ranked))
    sizes = problem.sums.sizes
    worths = {c: problem.sums.cost(c) for c in product(*map(range, sizes))}
    best = min(worths.values())
    assert solve(problem, "overlap_dp").certificate.objective == pytest.approx(best)
    assert solve(problem, "cascade").certificate.objective >= best - 1e-9
    if ranked is Ranked.CONDITIONAL:
        some = [c for c in worths if np.isfinite(worths[c])][::37]
        for choice in some:
            assert worths[choice] == pytest.approx(rank_again(problem, choice))
        assert some


def test_the_conditional_objective_is_what_a_search_of_one_move_goes_by(engine25, loop25):
    problem = pose_decisions(engine25, loop25, CONDITIONAL)
    choice = solve(problem, "cascade").choice
    for k in range(len(choice)):
        before = choice[k - 1] if k else 0
        charged = problem.sums.single[k] + problem.sums.shared[k][before]
        allowed = np.isfinite(charged)
        np.testing.assert_allclose(charged[allowed], move_costs(problem, k, before)[allowed])
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
