"""One way to solve: what is computed when, what a plan says of itself, what a watch is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt import Search
from seqopt.engines.interface import Want
from seqopt.errors import ProblemError
from seqopt.graph.decision_costs import LayeredCosts
from seqopt.graph.decisions import pose_decisions
from seqopt.graph.formulation import find_formulation
from seqopt.plan.solve import solve
from seqopt.workflow import Robust
from tests.builders import small_arch
from tests.layered import Costs

WORST = seqopt.CRITERIA["worst-ratio-published"]


class Counting:
    """An engine that counts the grip sets it is asked for."""

    def __init__(self, engine):
        self.engine, self.asked = engine, 0

    @property
    def network(self):
        return self.engine.network

    def solve(self, bricks, grips, want=Want.RESPONSES):
        self.asked += len(grips)
        return self.engine.solve(bricks, grips, want)


@pytest.fixture
def counted(engine25):
    engine = Counting(engine25)
    return engine, pose_decisions(engine, seqopt.three_robot_loop(engine.network), WORST)


def test_posing_computes_nothing(counted):
    engine, problem = counted
    assert engine.asked == 0
    assert problem.evaluation.models == engine.asked > 0


def test_a_search_without_proof_computes_only_what_it_meets(counted):
    engine, problem = counted
    plan = seqopt.solve(problem, "cascade", proof=False)
    assert plan.models == engine.asked
    assert plan.certificate is None
    assert np.isnan(plan.selection.objective).all()
    proven = seqopt.solve(problem, "cascade")
    assert plan.nodes == proven.nodes
    assert plan.steps == proven.steps
    assert engine.asked > problem.evaluation.models
    assert plan.models < 0.3 * problem.evaluation.models
    assert plan.summary()["status"] == "unproven"
    assert plan.summary()["gap"] is None
    assert "not compared" in repr(plan)


def test_a_plan_shows_its_steps_and_choices(engine25):
    plan = seqopt.optimize(engine25.network.scene, engine="compliance")
    assert next(iter(plan.seconds)) == "assemble"
    assert {*plan.nodes} <= {*plan.table()["node"]}
    table = plan.responses()
    assert len(table) == len(plan.steps) == 90
    assert (table["optimized_robot"] != "").sum() > 22


def test_a_plan_of_costs_alone_has_a_path_and_no_steps():
    costs = LayeredCosts((np.array([2.0, 1.0]),), (np.zeros((1, 2)),))
    plan = seqopt.solve(Costs(costs).compiled().instance, "overlap_dp")
    assert plan.nodes == (2,)  # of the graph, whose start is 0
    assert plan.steps == ()
    assert plan.certificate.gap == 0.0
    assert plan.summary()["objective"] == {"least sum": 1.0}
    for ask in (plan.table, plan.responses):
        with pytest.raises(ProblemError, match="costs alone"):
            ask()


def test_every_plan_has_one_summary():
    """Its keys do not depend on what was chosen from, but for the criterion's and the order's."""
    scene, ones = small_arch(5), seqopt.CRITERIA["worst-ratio"]
    plans = [
        seqopt.optimize(scene, criterion=ones),
        seqopt.optimize(scene, criterion=ones, formulation="cascade", search=Search(proof=False)),
        seqopt.optimize(scene, criterion=ones, formulation="path_dp"),
        seqopt.optimize(scene, "free"),
        seqopt.optimize(scene, criterion=ones, robust=Robust(count=2)),
        seqopt.optimize(scene, "free", order="search"),
    ]
    own = {"criterion", *(name for plan in plans for name in criterion_of(plan).settings)}
    keys = [{k for k in p.summary() if k not in own and not k.startswith("order")} for p in plans]
    assert keys == [keys[0]] * len(plans)
    assert [type(plan.summary()["objective"]) for plan in plans] == [dict] * len(plans)
    assert {"order", "orders", "order_evaluated"} <= set(plans[-1].summary())
    for plan in plans:
        assert len(plan.responses()) == len(plan.steps)
        assert len(plan.table()) > 0


def criterion_of(plan):
    return plan.problem.criterion


def problem():
    costs = LayeredCosts((np.array([2.0, 1.0]),), (np.zeros((1, 2)),))
    return Costs(costs).compiled().instance


@pytest.mark.parametrize("limit", [-1, "1", np.nan, None])
def test_a_time_limit_is_seconds(limit):
    with pytest.raises(ProblemError, match=r"time_limit is .*; give seconds from 0"):
        solve(problem(), "overlap_dp", time_limit=limit)


def test_what_takes_no_watch_takes_no_time_limit():
    exact = find_formulation("overlap_dp")

    def unwatched(problem):
        return exact.solve(problem)

    bare = replace(exact, name="bare", solve=unwatched)
    assert not bare.watched
    assert solve(problem(), bare).certificate.objective == 1.0
    assert solve(problem(), bare).selection.trace[-1].objective == 1.0
    with pytest.raises(ProblemError, match="bare takes no time limit; leave it out"):
        solve(problem(), bare, time_limit=1.0)
    assert "watch" not in exact.options
