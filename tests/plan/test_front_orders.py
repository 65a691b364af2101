"""Pareto sets over all build orders, against the sets of every order on its own."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

import seqopt
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph._orders import TooManySetsError, order_rules
from seqopt.graph.formulation import find_formulation
from seqopt.plan import front as fronts
from seqopt.plan.front import find_front
from seqopt.plan.pose import graph_of
from seqopt.responses.table import analyze
from tests.builders import small_arch

AIMS = ["T_max,F_largest", pytest.param("D_max,steps", marks=pytest.mark.slow)]
RULES = seqopt.FreeRules()


def posed(aim, order=None, rules=RULES, bricks=3, **words):
    network = seqopt.build_network(small_arch(bricks), order)
    engine = seqopt.make_engine("compliance", network)
    return seqopt.pose(engine, rules, seqopt.CRITERIA["worst-ratio"], aim, **words)


def points(front, aim):
    """The points of a front, aims in their own columns."""
    return front.table.to_numpy(float)[:, : len(aim.split(","))]


def beaten(point, others):
    return any((other <= point).all() and (other < point).any() for other in others)


def of_every_order(aim):
    """What no plan of any order beats, one order after the other."""
    allowed = order_rules(graph_of(posed(aim, orders="tied")))
    found = [
        points(find_front(posed(aim, order)), aim)
        for order in permutations(allowed.scene.build_order)
        if allowed.allows(order)
    ]
    assert len(found) == 4  # of a chain between two ground ends
    every = np.unique(np.concatenate(found), axis=0)
    return every[[not beaten(point, every) for point in every]]


@pytest.mark.parametrize("aim", AIMS)
def test_it_is_the_best_of_the_sets_of_every_order(aim):
    front = find_front(posed(aim, orders="tied"))
    assert front.complete
    found = points(front, aim)
    np.testing.assert_allclose(found[np.lexsort(found.T[::-1])], of_every_order(aim), rtol=1e-8)


@pytest.fixture(scope="module")
def tied():
    """The set over all orders."""
    return find_front(posed(AIMS[0], orders="tied"))


def test_another_order_is_better_than_the_own_one(tied):
    own, every = points(find_front(posed(AIMS[0])), AIMS[0]), points(tied, AIMS[0])
    assert any(beaten(point, every) for point in own)
    assert not any(beaten(point, own) for point in every)


def test_every_plan_is_analyzed_in_its_own_order(tied):
    for engine, steps, point in zip(tied.engines, tied.steps, tied.table.T_max, strict=True):
        assert analyze(engine, steps)["F_max_N"].max() == pytest.approx(point, rel=1e-5)
    assert {engine.network.scene.build_order for engine in tied.engines} != {(1, 2, 3)}


def short_of_one(problem, **options):
    found = find_formulation("pareto_zones").solve(problem, **options)
    return found[1:]


def test_a_missing_point_is_seen():
    lacking = replace(find_formulation("pareto_zones"), name="lacking", solve=short_of_one)
    with pytest.raises(SolverError, match="the set lacks a point below"):
        find_front(posed(AIMS[0], bricks=4, orders="tied"), lacking)


def test_that_no_order_has_a_plan_is_proven():
    limits = (seqopt.Limit("F_largest", 1.0),)
    with pytest.raises(InfeasibleError, match="no order of the bricks has a plan"):
        find_front(posed(AIMS[0], orders="tied", limits=limits))


def test_what_does_not_fit_is_one_line(monkeypatch):
    monkeypatch.setattr(fronts, "free_memory", lambda: 0.0)
    with pytest.raises(ProblemError, match="do not fit the memory; give an order"):
        find_front(posed(AIMS[0], orders="tied"))
    monkeypatch.setattr(fronts, "free_memory", lambda: np.inf)
    monkeypatch.setattr("seqopt.graph.states.explored.MOST_PARTS", 3)
    with pytest.raises(TooManySetsError, match="more than 3 sets of bricks; give an order"):
        find_front(posed(AIMS[0], orders="tied"))
