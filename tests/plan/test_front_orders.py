"""A problem as a flow; plans of robots that give way."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

import seqopt
from experiments.harness.layers import LayeredCosts
from experiments.placement.parts.staged import analyze_staged
from seqopt.engines.registry import make_engine
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph._spaces import TooManySetsError, order_rules
from seqopt.graph.formulation import find_formulation
from seqopt.graph.graph import TIED
from seqopt.network.network import build_network
from seqopt.plan import front as fronts
from seqopt.plan.front import find_front
from seqopt.plan.solve import graph_of
from seqopt.responses.table import analyze, force_column
from seqopt.scene.scenarios import require_alike
from seqopt.workflow import Robust
from tests.builders import small_arch
from tests.layered import Budget, Costs, answer
from tests.soft_bodies import SoftBodies

INF = np.inf


def amounts(single, shared):
    return (
        tuple(np.array(s, dtype=float) for s in single),
        tuple(np.array(s, dtype=float) for s in shared),
    )


def problem(*bounds):
    """Three moves; the second candidate of the first and one pair of the second are not allowed."""
    costs = LayeredCosts(
        *amounts(
            ([1, INF, 3], [10, 20], [100, 200]),
            ([[1000, 2000, 3000]], [[1, 2], [3, 4], [5, INF]], [[-7, 8], [9, 10]]),
        )
    )
    taken = amounts(
        ([30, 0, 50], [0, 0], [0, 0]), ([[0, 0, 0]], [[1, 2], [0, 0], [3, 0]], [[0, 0], [0, 0]])
    )
    return Costs(costs, tuple(Budget(f"use {i}", *taken, b) for i, b in enumerate(bounds)))


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_multipliers_are_costs_over_amounts(unit):
    """What costs 1 takes 4, what costs 3 takes 2: a unit more of the budget would save 1."""
    one = (np.zeros((1, 2)),)
    costs = LayeredCosts((np.array([1.0, 3.0]),), one)
    budget = Budget("use", (unit * np.array([4.0, 2.0]),), one, unit * 2.5)
    for name in ("overlap_lp", "lagrangian"):
        found = answer(Costs(costs, (budget,)), name)
        assert found.bound == pytest.approx(2.5, rel=1e-6)
        assert found.prices["use"] == pytest.approx(1.0 / unit, rel=1e-5)


@pytest.mark.parametrize("sizes", [(3, 2), (4, 2, 2), (3, 2, 1)])
def test_a_budget_is_for_the_moves_and_candidates_of_the_problem(sizes):
    single = tuple(np.ones(size) for size in sizes)
    shared = tuple(np.ones(pair) for pair in zip((1, *sizes[:-1]), sizes, strict=True))
    with pytest.raises(ProblemError, match="budget 'other' is for other moves or candidates"):
        replace(problem(), budgets=(Budget("other", single, shared, 99.0),)).compiled()


@pytest.mark.parametrize(("less", "hopeless"), [(0.9 * TIED, False), (1e-4, True)])
@pytest.mark.parametrize("name", ["labels", "lagrangian", "overlap_lp", "overlap_mip"])
def test_a_budget_that_no_choice_keeps_is_named(name, less, hopeless):
    """The least that a choice takes is 31; what is closer than rounding keeps the budget."""
    own = problem(90.0, 31.0 * (1 - less))
    if hopeless:
        with pytest.raises(InfeasibleError, match=r"at least 31 of 'use 1', more than 30\.9"):
            answer(own, name)
    else:
        assert own.budgets[1].spent(answer(own, name).choice) == 31.0


def test_a_program_that_is_too_large_says_its_size(monkeypatch):
    name = "overlap_lp"
    monkeypatch.setattr("formulations.flow.MOST_ARCS", 9)
    assert answer(problem(), name).choice == (0, 0, 0)
    monkeypatch.setattr("formulations.flow.MOST_ARCS", 8)
    with pytest.raises(ProblemError, match=r"of 9 moves between 5 states is too large"):
        answer(problem(), name)


# pareto sets over all build orders, against the sets of every order on its own
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


@pytest.mark.slow
def test_a_missing_point_is_seen():
    whole = find_formulation("pareto_zones")
    lacking = replace(whole, name="lacking", solve=lambda p, **rest: whole.solve(p, **rest)[1:])
    with pytest.raises(SolverError, match="the set lacks a point below"):
        find_front(posed(AIMS[0], bricks=4, orders="tied"), lacking)


def test_that_no_order_has_a_plan_is_proven():
    limits = (seqopt.Limit("F_largest", 1.0),)
    with pytest.raises(InfeasibleError, match="no order of the bricks has a plan"):
        find_front(posed(AIMS[0], orders="tied", limits=limits))


def test_what_does_not_fit_is_one_line(monkeypatch):
    monkeypatch.setattr(fronts, "_free_memory", lambda: 0.0)
    with pytest.raises(ProblemError, match="do not fit the memory; give an order"):
        find_front(posed(AIMS[0], orders="tied"))
    monkeypatch.setattr(fronts, "_free_memory", lambda: np.inf)
    monkeypatch.setattr("seqopt.graph._spaces.MOST_PARTS", 3)
    with pytest.raises(TooManySetsError, match="more than 3 sets of bricks; give an order"):
        find_front(posed(AIMS[0], orders="tied"))


# plans of robots that give way: who holds which node counts, and how much each gives
STIFF = (1e7, 1e5, 3e6)


@pytest.fixture(scope="module")
def unlike():
    """A small arch with robots of three stiffnesses."""
    scene = small_arch(5)
    pairs = zip(scene.robots, STIFF, strict=True)
    return scene.with_robots(*(replace(robot, stiffness=k) for robot, k in pairs))


def by_robot(scene, step):
    """The force of every robot in a step, zero of one that holds none, by a dense solver."""
    who = [i for i, node in enumerate(step.grips) if node is not None]
    hands = np.array([[STIFF[i]] * 3 + [0.0] * 3 for i in who]).reshape(-1, 6)
    out = np.zeros(len(scene.robots))
    if who:
        nodes = [step.grips[i] for i in who]
        borne, _ = SoftBodies(scene, step.bricks).solve(nodes, hands, np.zeros((len(who), 3)))
        out[who] = np.linalg.norm(borne[:, :3], axis=1)
    return out


@pytest.mark.parametrize("schedule", ["three-robot", "free"])
def test_plans_are_proven_and_their_forces_are_those_of_the_robots(unlike, schedule):
    plan = seqopt.optimize(unlike, schedule, "worst-ratio")
    assert plan.status == "optimal"
    table = analyze(make_engine("compliance", unlike), plan.steps)
    forces = table[[force_column(robot) for robot in unlike.robots]].fillna(0.0).to_numpy(float)
    dense = np.array([by_robot(unlike, step) for step in plan.steps])
    assert forces == pytest.approx(dense, rel=1e-9, abs=1e-7)
    assert len({tuple(np.flatnonzero(row)) for row in dense}) > 2  # all robots take part


def least(scene, **more):
    """The least largest displacement of a free schedule, m, proven."""
    plan = seqopt.optimize(scene, "free", aim="D_max", **more)
    assert plan.status == "optimal"
    (value,) = plan.objective.values()
    return value


def test_who_is_how_stiff_counts_and_not_who_comes_first(unlike):
    """With all of one stiffness there are other values, between which these lie."""
    own = least(unlike)
    assert least(unlike.with_robots(*unlike.robots[::-1])) == pytest.approx(own, rel=1e-9)
    softer, stiffer = (least(unlike.with_grips(k)) for k in (min(STIFF), max(STIFF)))
    assert 1.01 * stiffer < own < 0.99 * softer


@pytest.mark.slow
def test_orders_are_searched_with_robots_that_differ(unlike):
    assert least(unlike, order="search") <= least(unlike) * (1 + 1e-9)


def test_scenarios_keep_who_is_like_whom(unlike):
    require_alike(
        unlike,
        unlike.with_robots(
            *(replace(r, stiffness=k) for r, k in zip(unlike.robots, (1e6, 2e6, 3e6), strict=True))
        ),
        1,
    )
    with pytest.raises(ProblemError, match="or other robots share a compliance"):
        require_alike(unlike, unlike.with_grips(1e6), 1)
    drawn = seqopt.scenarios(unlike, count=3, grips=(0.3, 3.0))
    plan = seqopt.optimize(unlike, "free", "worst-ratio", robust=Robust(scenes=drawn.scenes))
    assert plan.status == "optimal"


def test_staged_builds_let_grips_give_way():
    """Nearly rigid grips change nothing; soft ones do, and all that is held is in balance."""
    scene = small_arch(5)
    steps = seqopt.sequential(build_network(scene))
    rigid, near = (analyze_staged(s, steps) for s in (scene, scene.with_grips(1e14)))
    name = "D_max_1e-3mm"
    assert near[name].to_numpy() == pytest.approx(rigid[name].to_numpy(), rel=1e-4)
    soft = analyze_staged(scene.with_grips(1e5, 1e3), steps)
    assert np.abs(soft[name] - rigid[name]).max() > 0.1 * rigid[name].max()
    first = analyze(make_engine("compliance", scene.with_grips(1e5, 1e3)), steps[:1])
    assert soft[name][0] == pytest.approx(first[name][0], rel=1e-9)
