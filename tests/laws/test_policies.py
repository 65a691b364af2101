"""Laws of policies: what one says of a state is what a search from that state finds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.errors import InfeasibleError, StepError
from seqopt.plan.policy import find_policy
from seqopt.plan.solving import states_of
from seqopt.scene._props import Prop
from seqopt.sequence.rules import FreeRules
from tests.brute_force import ONES
from tests.builders import site_of, small_arch

ENDINGS = ("held", "released", "one-by-one")
PROPS = ((), (Prop(node=3, capacity=250.0),), (Prop(node=4, direction=(0.0, 0.0, 1.0)),))


@settings(max_examples=3)
@given(
    rules=st.builds(
        FreeRules,
        ending=st.sampled_from(ENDINGS),
        direction=st.sampled_from(["build", "take-down"]),
        regrips=st.sampled_from([None, 1]),
        least_grips=st.sampled_from([1, 2]),
    ),
    props=st.sampled_from(PROPS),
    aim=st.sampled_from(["minmax,steps", "regrips,minmax"]),
    seed=st.integers(0, 9),
)
@example(FreeRules(ending="one-by-one"), (), "minmax,steps", 0)
@example(FreeRules(direction="take-down"), PROPS[1], "minmax,steps", 0)
def test_a_policy_says_of_every_state_what_a_search_from_it_finds(rules, props, aim, seed):
    scene = small_arch(4).with_props(*props)
    scene = scene.with_robots(*(replace(r, payload=400.0) for r in scene.robots[:3]))
    engine = seqopt.make_engine("compliance", scene)
    problem = seqopt.pose(engine, rules, ONES, aim)
    policy = answer_to(find_policy, problem)
    if isinstance(policy, str):
        assert policy == answer_to(seqopt.solve, problem)
        return
    rng = np.random.default_rng(seed)
    whole = np.flatnonzero(policy.bricks == 4)
    for row in [*rng.permutation(whole)[:4], rng.integers(len(policy.bricks))]:
        same_as_a_search(policy, row, problem, len(scene.robots))


def answer_to(ask, problem):
    """What is found, or in words why there is nothing."""
    try:
        return ask(problem)
    except InfeasibleError as error:
        return str(error)


def same_as_a_search(policy, row, problem, robots):
    site = site_of(policy, row, robots)
    begun = replace(problem, moves=replace(problem.moves, begin=site))
    try:
        advice = policy.best(site)
    except StepError:
        with pytest.raises(InfeasibleError):
            seqopt.solve(begun)
        return
    if advice.kind is None or states_of(begun).space.ended(states_of(begun).space.start()).all():
        return
    plan = seqopt.solve(begun)
    assert [*plan.objective.values()] == pytest.approx([*advice.values.values()], rel=1e-9)
