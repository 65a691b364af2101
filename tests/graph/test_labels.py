"""Searches of labels and of states that pass; ranks over all pairs."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.harness.layers import best_in_order
from formulations.on_graph import _Totals
from seqopt.graph import Graph
from seqopt.graph._budgets import CappedSums, Joint, LabelSearch, LateError, Sweep, widening
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import FAILS, PASSES, _lazy_path
from seqopt.plan._answers import _branches
from seqopt.plan.solve import graph_of, pose, solve
from seqopt.problem.criteria import Ranked, _ranks_of
from seqopt.problem.problem import WORST_TOTAL, Aim, cvar
from seqopt.study import EQUATIONS
from tests.layered import of_layers
from tests.random_graphs import graphs, simple_paths

NONE = LabelSearch(None, np.inf, -np.inf)
few = settings(max_examples=25)


def taken(graph):
    """What every path takes, (p, g)."""
    return np.array([graph.amounts[list(moves)].sum(axis=0) for moves in simple_paths(graph)])


@given(graph=graphs(goals=3), caps=st.tuples(st.integers(0, 8), st.integers(0, 8)))
@few
def test_the_cheapest_path_within_two_caps_is_found(graph, caps):
    paths = taken(graph).reshape(-1, 3)
    least = paths[(paths[:, 1:] <= caps).all(axis=1), 0].min(initial=np.inf)
    for multipliers in (np.zeros(2), np.array([0.5, 2.0])):  # they lead, and change nothing
        sums = CappedSums(
            graph, graph.amounts[:, 0], graph.amounts[:, 1:], np.array(caps), multipliers
        )
        growth = Joint(graph, [sums])
        found = widening(growth, np.array(caps), NONE, Watch(), 10_000)
        assert (found.cost, found.bound) == pytest.approx((least, least))
        if np.isfinite(least):
            assert (graph.amounts[found.arcs, 1:].sum(axis=0) <= caps).all()
        one = widening(growth, np.array(caps), NONE, Watch(), 1)
        assert one.bound <= least * (1 + 1e-9) <= one.cost * (1 + 2e-9)


@given(graph=graphs(goals=3), aim=st.sampled_from([WORST_TOTAL, cvar(0.5)]))
@few
def test_the_least_total_over_scenarios_is_found(graph, aim):
    least = min((aim.value(totals) for totals in taken(graph)), default=np.inf)
    growth = Joint(graph, [_Totals(graph, aim, np.full(3, 1 / 3))])
    found = widening(growth, np.zeros(0), NONE, Watch(), 10_000)
    assert (found.cost, found.bound) == pytest.approx((least, least))
    one = widening(growth, np.zeros(0), NONE, Watch(), 1)
    assert one.bound <= least * (1 + 1e-9) <= one.cost * (1 + 2e-9)


@given(graph=graphs(goals=2))
@few
def test_a_sweep_stops_in_time_and_at_so_many_labels(graph):
    sums = CappedSums(
        graph, graph.amounts[:, 0], graph.amounts[:, 1:], np.array([9.0]), np.zeros(1)
    )
    growth = Joint(graph, [sums])
    limits = np.array([np.inf, 9.0])
    with pytest.raises(LateError):
        Sweep(growth, limits).run(Watch(0.0))
    watch = Watch()
    first = watch.apart()  # of a search that is told other values, as of paths within caps
    assert (first.over, first.left, first.bound) == (False, np.inf, watch.bound)
    watch.interrupt()
    assert (first.over, first.left) == (True, 0.0)
    with pytest.raises(LateError):
        Sweep(growth, limits).run(first)
    every = Sweep(growth, limits).run(Watch())
    count = sum(labels.size for labels in every.kept)
    assert Sweep(growth, limits).run(Watch(), count).best == every.best
    if count > 1:
        with pytest.raises(LateError):
            Sweep(growth, limits).run(Watch(), count - 1)


def sought(graph, passes, parts, *, recalls=False):
    """What is found, what is known then, and which states were asked."""
    asked = []
    known = np.zeros(graph.states, dtype=np.int64)
    known[0] = PASSES

    def ask(part, rows):
        assert set(parts[rows].tolist()) == {part}
        asked.extend(rows.tolist())
        return np.where(passes[rows], PASSES, FAILS)

    def recall(part, rows):
        return np.where(passes[rows], 0, FAILS * recalls)

    return _lazy_path(graph, parts, known, ask, recall), known, asked


@given(graph=graphs(), data=st.data(), recalls=st.booleans())
@settings(max_examples=40)
def test_a_path_is_found_where_there_is_one(graph, data, recalls):
    passes = np.array(data.draw(st.lists(st.booleans(), min_size=6, max_size=6)))[: graph.states]
    passes[0] = True
    parts = np.arange(graph.states) // 2
    path, known, asked = sought(graph, passes, parts, recalls=recalls)
    states = ((0, *(int(graph.target[m]) for m in moves)) for moves in simple_paths(graph))
    assert (path is not None) == any(passes[[*each]].all() for each in states)
    assert len(asked) == len({*asked}), "a state is asked twice"
    assert (passes[known == PASSES]).all()
    assert not passes[known == FAILS].any()
    if path is not None:
        moves = {*zip(graph.source.tolist(), graph.target.tolist(), strict=True)}
        assert {*zip((0, *path), path, strict=False)} <= moves
        assert graph.ends[path[-1]]
        assert passes[[*path]].all()


def test_a_cut_is_found_without_asking_what_lies_before_it():
    """Twenty ways lead to one state that fails: it is asked soon, most of the others never."""
    ways = np.arange(1, 21)
    source = np.concatenate([np.zeros(20), ways, [21]]).astype(np.int32)
    target = np.concatenate([ways, np.full(20, 21), [22]]).astype(np.int32)
    ends = np.arange(23) == 22
    graph = Graph(source, target, np.ones((41, 1)), (False,), ends)
    parts = np.array([0, *[1] * 20, 2, 3])
    path, known, asked = sought(graph, np.arange(23) != 21, parts)
    assert path is None
    assert known[21] == FAILS
    assert len(asked) <= 4


# ranks over all pairs, and given the choice before
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


@pytest.mark.slow
def test_the_conditional_objective_is_what_a_search_of_one_move_goes_by(engine25, loop25):
    problem = pose(engine25, loop25, CONDITIONAL)
    choice = solve(problem, "cascade").choice
    assert solve(problem, "cascade", proof=False).choice == choice
    costs, states = of_layers(problem).sums, graph_of(problem)
    state, level, before = states.space.start(), 0, 0
    for k, now in enumerate(choice):
        charged = costs.single[k] + costs.shared[k][before]
        assert charged[now] == charged.min()
        branches, trail = _branches(states, level, state)
        if len(branches) == 1:  # a step that is forced
            state, level = trail[-1], level + len(trail)
            branches, trail = _branches(states, level, state)
        allowed = np.isfinite(charged)
        np.testing.assert_allclose(charged[allowed], branches)
        row = np.flatnonzero(allowed).tolist().index(now)
        state, level, before = trail[-1][[row]], level + len(trail), now
    assert level == states.space.levels


@pytest.mark.slow
def test_the_reference_arch_under_both(problem25):
    """The cascade loses nothing by being short of sight, and all by the change of objective."""
    criterion = replace(problem25.criterion, ranked=Ranked.CONDITIONAL)  # on the choice before
    cascade, other = solve(problem25, "cascade"), replace(problem25, criterion=criterion)
    own, sums = of_layers(problem25).sums, of_layers(other).sums
    assert own.cost(cascade.choice) == pytest.approx(663.81, abs=0.01)
    assert sums.cost(cascade.choice) == pytest.approx(664.5)
    exact = solve(other, "overlap_dp")
    assert exact.certificate.objective == pytest.approx(656.025)
    assert solve(other, "cascade").certificate.gap == pytest.approx(0.01275, abs=1e-5)
    sighted = best_in_order([(sums, Aim.SUM), (own, Aim.SUM)])
    assert own.cost(sighted) == pytest.approx(663.81, abs=0.01)
