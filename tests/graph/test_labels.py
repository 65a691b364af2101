"""The one label search, against every path: exact with room for all labels, a bound with few."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formulations.states._search import _Totals
from seqopt.graph._labels import CappedSums, LabelSearch, LateError, Sweep, widening
from seqopt.graph.formulation import Watch
from seqopt.problem.problem import WORST_TOTAL, cvar
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
        growth = CappedSums(
            graph, graph.amounts[:, 0], graph.amounts[:, 1:], np.array(caps), multipliers
        )
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
    growth = _Totals(graph, aim, np.full(3, 1 / 3))
    found = widening(growth, np.zeros(0), NONE, Watch(), 10_000)
    assert (found.cost, found.bound) == pytest.approx((least, least))
    one = widening(growth, np.zeros(0), NONE, Watch(), 1)
    assert one.bound <= least * (1 + 1e-9) <= one.cost * (1 + 2e-9)


@given(graph=graphs(goals=2))
@few
def test_a_sweep_stops_in_time_and_at_so_many_labels(graph):
    growth = CappedSums(
        graph, graph.amounts[:, 0], graph.amounts[:, 1:], np.array([9.0]), np.zeros(1)
    )
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
