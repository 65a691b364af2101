"""Proofs are as strong as they promise: one that looks at less, or allows more, is noticed."""

from __future__ import annotations

from dataclasses import replace
from heapq import heappop, heappush

import numpy as np
import pytest

import seqopt
from seqopt.engines.interface import Want
from seqopt.graph import Explorer
from seqopt.graph._orders import OrderSpace, among_orders
from seqopt.graph.paths import distances, keep_best, least_peak, lexicographic_bounds, reached
from seqopt.graph.states.explored import explore, floors_of_goals
from seqopt.graph.states.states import build_states
from seqopt.judge._proof import Proof, TooManyPartsError
from seqopt.judge._states import Filter, StateEvaluator
from seqopt.plan.solve import solve
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import Limit
from seqopt.responses.quantities import CHOSEN_BY
from seqopt.sequence.rules import Ending, FreeRules, with_robots
from tests.builders import small_arch
from tests.plain_rules import PlainBook

ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))
FREE_RULES = FreeRules()


def posed(aim, scene=None, limits=(), count=5, rules=FREE_RULES):
    engine = seqopt.make_engine("compliance", scene or small_arch(count))
    return build_states(engine, rules, ONES, aim, limits)


def states_below(problem, bound, join):
    """How many states plans may pass whose values, joined, are within a bound: in plain words."""
    book, engine = PlainBook(problem.network, problem.rules), problem.engine
    work = [(0.0, 0, 0, (None,) * len(problem.network.scene.robots))]
    done, values, pushed = set(), {}, 0
    while work:
        taken, _, bricks, grips = heappop(work)
        if (bricks, grips) in done:
            continue
        done.add((bricks, grips))
        for _, after, held, _ in book.follow(bricks, grips, 0):
            nodes = tuple(sorted(node for node in held if node is not None))
            if (after, nodes) not in values:
                asked = np.array([nodes], dtype=int).reshape(1, -1)
                fields = engine.solve(after, asked, Want.ALL)
                values[after, nodes] = float(CHOSEN_BY["M_sup"].of(engine.network, fields)[0])
            total = join(taken, values[after, nodes])
            if total <= bound:
                pushed += 1
                heappush(work, (total, pushed, after, held))
    return len(done)


@pytest.mark.parametrize(("aim", "join"), [("M_sup", max), ("sum(M_sup)", lambda a, b: a + b)])
def test_the_proof_looks_at_every_state_that_a_better_plan_could_pass(aim, join):
    problem = posed(aim, count=6, rules=FreeRules(ending=Ending.HELD))
    best = solve(problem, "schedule_search", proof=False).selection.objective
    proof = Proof(problem)
    assert proof.bounds(best) == pytest.approx(best, rel=1e-12)
    most = best[0] * (1 - 1e-9) if join is max else np.inf  # any state may be on a way to less
    assert proof.states == states_below(problem, most, join)
    assert proof.states > (150 if join is max else 200)  # one that stops early looks at less


@pytest.mark.parametrize("ending", list(Ending))
@pytest.mark.parametrize(("robots", "regrips"), [(2, None), (4, 0)])
def test_what_all_plans_have_in_common_bounds_every_path(ending, robots, regrips):
    """The search and the judge say the same, and no path through all states stays below."""
    rules = FreeRules(ending=ending, regrips=regrips, least_grips=1)
    problem = posed("minmax,steps", with_robots(small_arch(5), robots), rules=rules)
    floors = floors_of_goals(problem)
    assert StateEvaluator(problem).least() == pytest.approx(floors, rel=1e-12)
    graph = explore(problem).graph().graph
    assert least_peak(graph, 0) >= floors[0] * (1 - 1e-12)
    fewest = keep_best(graph, 1)[1]
    assert fewest == floors[1] or (regrips == 0 and fewest > floors[1])
    assert np.isfinite(floors[0]) == (ending is not Ending.HELD)


@pytest.mark.parametrize("direction", ["build", "take-down"])
@pytest.mark.parametrize("ending", list(Ending))
def test_no_step_lowers_the_steps_to_go_by_more_than_one(direction, ending):
    """So a path through a state has at least as many steps as are counted to it and from there."""
    if direction == "take-down" and ending is not Ending.HELD:
        ending = Ending.RELEASED  # nobody holds in the end, however builds end
    rules = FreeRules(ending=ending, least_grips=1, direction=direction)
    problem = posed("minmax,steps", count=4, rules=rules)
    space, tables = problem.space, StateEvaluator(problem).tables
    graph, states = explore(problem).graph()
    left = [space.steps_to_go(level, rows) for level, _, rows in states]
    again = [tables.steps_to_go(level, rows) for level, _, rows in states]
    bound = np.concatenate(left)
    assert bound.tolist() == np.concatenate(again).tolist()
    fewest = distances(graph, graph.amounts[:, 1], back=True)
    assert (bound <= fewest).all()  # infinite where no end is reached
    assert (bound[graph.source] <= 1 + bound[graph.target]).all()
    assert bound[0] == fewest[0]
    assert (bound == fewest).mean() > 0.05


def test_fewer_steps_are_proven_by_states_on_paths_of_fewer_steps():
    """A plan of more steps, or a bound that is too high, is refused by them as by all states."""
    problem = posed("minmax,steps", count=6)
    peak, steps = solve(problem, "schedule_search", proof=False).selection.objective
    proof, every = Proof(problem), Proof(problem)
    assert proof.bounds((peak, steps)) == (peak, steps)
    graph = every.rebuilt(Filter((peak, steps))).graph()
    assert lexicographic_bounds(graph, (peak, steps)) == (peak, steps)
    few = every.rebuilt(Filter((peak, steps), steps=steps - 1)).graph()
    assert len(few.source) < len(graph.source)
    assert not few.ends[reached(few)].any()
    as_many = every.rebuilt(Filter((peak, steps), steps=steps)).graph()
    assert lexicographic_bounds(as_many, (peak, steps))[1] == steps
    for more in (1, 2, 3):
        assert Proof(problem).bounds((peak, steps + more))[1] <= steps


@pytest.mark.parametrize(("aim", "by"), [("F_largest", "limits"), ("sum(M_sup)", "payloads")])
def test_the_proof_lets_robots_carry_all_they_may(aim, by):
    """They may just carry what any plan needs: plans above the best one are found."""
    scene = small_arch(5)
    (least,) = solve(posed("F_largest"), "schedule_search", proof=False).selection.objective
    limits = [Limit(f"F_{robot.name}", least) for robot in scene.robots] if by == "limits" else ()
    if by == "payloads":
        robots = tuple(replace(robot, payload=least) for robot in scene.robots)
        scene = replace(scene, robots=robots)
    problem = posed(aim, scene, limits)
    (best,) = solve(problem, "schedule_search").selection.objective
    assert Proof(problem).bounds((best * (1 + 1e-6),)) == pytest.approx((best,), rel=1e-9)


@pytest.mark.slow
def test_what_was_left_out_for_a_threshold_bounds_all_orders(monkeypatch):
    """Whatever the threshold; and with few sets looked at nothing is proven."""
    problem = among_orders(posed("F_largest", count=4), "tied")
    best = seqopt.solve(problem).certificate.objective
    for share in (0.0, 0.5, 0.99):
        found = Explorer(OrderSpace(problem))
        assert not found.rise(share * best)
        assert share * best < found.excluded <= best * (1 + 1e-6)
    assert Proof(problem).bounds_first(best)
    assert not Proof(problem).bounds_first(best * 1.01)
    monkeypatch.setattr("seqopt.judge._proof.MOST", 3)
    with pytest.raises(TooManyPartsError):
        Proof(problem).bounds_first(best * 1.01)  # the whole arch is below that
