"""States that every plan passes are asked before any plan is sought, the whole first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.errors import InfeasibleError
from seqopt.graph import Explorer
from seqopt.graph._orders import among_orders
from seqopt.graph.states._visits import StateSpace
from seqopt.graph.states.explored import barred, explore
from seqopt.graph.states.states import build_states
from seqopt.judge._proof import Proof
from seqopt.plan.front import FrontProblem, find_front
from seqopt.problem.criteria import WorstRatio
from tests.builders import small_arch
from tests.strategies import free_builds

ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))
END = r"the finished structure, which nobody holds, "


def windy(wind, stands="dry", limits=(), bricks=5, rules=None):
    """An arch in wind along it, over the weight of every brick, all of whose states must stand."""
    scene = replace(small_arch(bricks), wind=(wind, 0.0, 0.0))
    engine = seqopt.make_engine("compliance", seqopt.build_network(scene))
    return build_states(engine, rules or seqopt.FreeRules(), ONES, "steps", limits, stands)


def test_that_the_whole_falls_is_known_before_a_plan_is_sought():
    """It was found after all states that are reached, and told of the brick where they ended."""
    problem = windy(0.6)
    with pytest.raises(InfeasibleError, match=END + "does not stand dry; .* a bond of") as found:
        seqopt.solve(problem, "schedule_search")
    assert "claimed" not in str(found.value)
    assert problem.stability.looked_at == 1
    proof = Proof(replace(problem))
    assert proof.is_impossible()
    assert proof.states == 1
    calm = windy(0.0)
    assert barred(calm) is None
    assert not Proof(calm).is_impossible()


def test_all_orders_and_fronts_end_in_it_too():
    problem = windy(0.6, bricks=4)
    with pytest.raises(InfeasibleError, match=END):
        seqopt.solve(among_orders(problem, "tied"), "order_search")
    with pytest.raises(InfeasibleError, match=END):
        find_front(FrontProblem(problem, None))


def test_a_step_without_an_open_grip_is_asked_before_those_with_one():
    """In the loop of three robots two steps have none; a storm is more than robots hold."""
    network = seqopt.build_network(replace(seqopt.load_scene("arch25"), wind=(0.0, 30.0, 0.0)))
    engine, loop = seqopt.make_engine("compliance", network), seqopt.three_robot_loop(network)
    problem = build_states(engine, loop, ONES, "minmax", stands="dry")
    assert [level for level, _ in problem.space.without_choice()] == [2, 1]
    level, state = barred(problem)
    assert (level, problem.space.grips(state).tolist()) == (2, [2])
    assert Proof(replace(problem)).is_impossible()
    said = "step 2 of 90, in which no grip is open, does not stand dry"
    with pytest.raises(InfeasibleError, match=said):
        seqopt.solve(problem, "schedule_search", time_limit=1.0)
    calm = build_states(
        seqopt.make_engine("compliance", seqopt.load_scene("arch25")), loop, ONES, stands="dry"
    )
    assert barred(calm) is None


@given(build=free_builds(most_bricks=3, most_robots=2), limit=st.floats(-12.0, -4.0))
@settings(max_examples=10, deadline=None)
def test_where_it_says_that_no_plan_is_there_is_none(build, limit):
    """By all states, none left out, and by the judge; where it says nothing, they decide."""
    scene, rules = build
    engine = seqopt.make_engine("compliance", scene)
    problem = build_states(engine, rules, ONES, "steps", [seqopt.Limit("D_max", 10.0**limit)])
    every = Explorer(StateSpace(replace(problem)))
    found = every.rise()
    assert explore(problem).whole == found
    assert Proof(problem).is_impossible() == (not found)
    if barred(problem) is not None:
        assert not found
        level, state = barred(problem)
        assert problem.space.ended(state).all()
        assert level == len(scene.bricks)
        assert not np.any(state)
