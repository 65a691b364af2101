"""Ranks over all pairs, and given the choice before."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import rankdata

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.layers import candidate_layers
from seqopt.graph.layers.ranking import _least_among_least, move_costs, objectives, split_gap
from seqopt.network.build import build_network
from seqopt.plan.solve import solve
from seqopt.problem.criteria import Ranked, _ranks_of
from seqopt.problem.requirements import Limit
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.published import EQUATIONS, WEIGHTED
from tests.builders import small_arch
from tests.strategies import problems

CONDITIONAL = replace(EQUATIONS, ranked=Ranked.CONDITIONAL)
values = st.one_of(st.integers(0, 4).map(float), st.just(np.nan))


def posed(count, criterion, limits=()):
    engine = ComplianceEngine(build_network(small_arch(count)))
    return candidate_layers(engine, three_robot_loop(engine.network), criterion, limits)


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
@pytest.mark.parametrize("count", [5, 6, 7])
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
    problem = candidate_layers(engine25, loop25, CONDITIONAL)
    choice = solve(problem, "cascade").choice
    for k in range(len(choice)):
        before = choice[k - 1] if k else 0
        charged = problem.sums.single[k] + problem.sums.shared[k][before]
        allowed = np.isfinite(charged)
        np.testing.assert_allclose(charged[allowed], move_costs(problem, k, before)[allowed])
        assert charged[choice[k]] == charged.min()


def test_the_reference_arch_under_both(problem25):
    """The cascade loses nothing by being short of sight, and all by the change of objective."""
    cascade = solve(problem25, "cascade")
    assert objectives(problem25, cascade.choice, heuristic=False) == {
        "objectives": {
            "pairs": pytest.approx(663.81, abs=0.01),
            "conditional": pytest.approx(664.5),
        },
        "gap_parts": None,
    }
    conditional = problem25.ranked(Ranked.CONDITIONAL)
    exact = solve(conditional, "overlap_dp").certificate
    assert exact.objective == pytest.approx(656.025)
    assert solve(conditional, "cascade").certificate.gap == pytest.approx(0.01275, abs=1e-5)
    parts = split_gap(problem25, cascade.choice)
    assert sum(parts.values()) == pytest.approx(cascade.certificate.gap)
    assert abs(parts["short_sight"]) < 1e-5
    assert parts["objective"] > 0.009
    summary = cascade.summary()
    assert summary["gap_parts"] == parts
    assert summary["objectives"]["conditional"] == pytest.approx(664.5)
    assert solve(problem25, "overlap_dp").summary()["gap_parts"] is None
    assert solve(problem25, "cascade", proof=False).summary()["objectives"] is None


def test_under_the_conditional_objective_sight_is_all_that_is_lost(engine25, loop25):
    problem = candidate_layers(engine25, loop25, CONDITIONAL)
    plan = solve(problem, "cascade")
    parts = split_gap(problem, plan.choice)
    assert parts["objective"] == 0
    assert parts["short_sight"] == pytest.approx(plan.certificate.gap) != 0
    assert problem.ranked(Ranked.CONDITIONAL) is problem
    assert problem.ranked(Ranked.PAIRS) is problem.ranked(Ranked.PAIRS)


def test_without_ranks_there_is_one_objective(engine25, loop25):
    problem = candidate_layers(engine25, loop25, WEIGHTED)
    choice = solve(problem, "cascade").choice
    found = objectives(problem, choice, heuristic=True)
    assert found == {"objectives": None, "gap_parts": None}
    assert solve(problem, "cascade").summary()["gap_parts"] is None


def test_limits_hold_under_both(engine25, loop25):
    limit = Limit("F_largest", 300.0)
    for ranked in Ranked:
        problem = candidate_layers(engine25, loop25, replace(EQUATIONS, ranked=ranked), [limit])
        choice = solve(problem, "overlap_dp").choice
        for step in problem.evaluation.steps:
            assert step.responses["F_largest"][tuple(choice[m] for m in step.moves)] <= 300.0
        others = {r: np.isfinite(problem.ranked(r).sums.shared[5]) for r in Ranked}
        np.testing.assert_array_equal(*others.values())


@given(first=problems(), data=st.data())
@settings(max_examples=40)
def test_of_the_best_choices_the_cheapest_by_the_other_costs(first, data):
    costs = first.sums
    draw = st.integers(0, 3).map(float)
    parts = [
        tuple(
            np.array(data.draw(st.lists(draw, min_size=a.size, max_size=a.size))).reshape(a.shape)
            for a in arrays
        )
        for arrays in (costs.single, costs.shared)
    ]
    second = LayeredCosts(*parts)
    choices = [c for c in product(*map(range, costs.sizes)) if np.isfinite(costs.cost(c))]
    if not choices:
        with pytest.raises(InfeasibleError):
            _least_among_least(costs, second)
        return
    least = min(map(costs.cost, choices))
    wanted = min(second.cost(c) for c in choices if costs.cost(c) == least)
    assert _least_among_least(costs, second) == pytest.approx(wanted)
