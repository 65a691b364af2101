"""Criteria people bring: functions of responses, aims in their order, quantiles over steps."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import seqopt
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.decision_costs import best_in_order
from seqopt.graph.decisions import pose_decisions
from seqopt.graph.states.states import build_states
from seqopt.judge._proof import Proof
from seqopt.problem.criteria import StepCost, WeightedSum
from seqopt.problem.problem import Aim
from seqopt.sequence.rules import FreeRules
from tests.builders import six_bricks, small_arch
from tests.strategies import problems

NAMES = ("F_largest", "M_sup")


def weighed(responses, bricks):
    return responses["F_largest"] / 100.0 + 2.0 * responses["M_sup"] / 10.0


def posed(criterion, scene=None):
    network = seqopt.build_network(six_bricks() if scene is None else scene)
    engine = seqopt.make_engine("compliance", network)
    return pose_decisions(engine, seqopt.three_robot_loop(network), criterion)


def test_a_function_costs_what_the_same_ready_made_criterion_does():
    same = WeightedSum("same", (("F_largest", 1.0, 100.0), ("M_sup", 2.0, 10.0)))
    ours, theirs = posed(StepCost("own", NAMES, weighed)), posed(same)
    for a, b in zip(
        (*ours.sums.single, *ours.sums.shared),
        (*theirs.sums.single, *theirs.sums.shared),
        strict=True,
    ):
        assert a == pytest.approx(b)
    assert seqopt.solve(ours, "overlap_dp").certificate.objective == pytest.approx(
        seqopt.solve(theirs, "overlap_mip").certificate.objective
    )


def test_forces_of_all_robots_are_spelled_out_and_zero_without_a_grip():
    seen = {}

    def spread(responses, bricks):
        forces = np.stack([responses[name] for name in sorted(responses)])
        seen.setdefault(tuple(sorted(responses)), []).append(forces)
        return forces.max(axis=0) - forces.min(axis=0)

    problem = posed(StepCost("spread", ("F_each",), spread))
    plan = seqopt.solve(problem, "overlap_dp")
    assert [*seen] == [("F_rob1", "F_rob2", "F_rob3")]
    assert any(
        (forces == 0).all(axis=tuple(range(1, forces.ndim))).any() for forces in seen.popitem()[1]
    )
    assert plan.summary()["responses"] == ["F_rob1", "F_rob2", "F_rob3"]
    assert plan.summary()["function"].endswith("spread")


def test_what_it_does_not_allow_is_not_chosen():
    def strict(responses, bricks):
        return np.where(responses["F_largest"] > 150.0, np.inf, responses["M_sup"])

    with pytest.raises(InfeasibleError):
        seqopt.solve(
            posed(StepCost("none", ("F_largest",), lambda r, b: np.inf * r["F_largest"])),
            "overlap_dp",
        )
    free = seqopt.solve(posed(StepCost("free", NAMES, lambda r, b: r["M_sup"])), "overlap_dp")
    bound = seqopt.solve(posed(StepCost("strict", NAMES, strict)), "overlap_dp")
    assert bound.certificate.objective >= free.certificate.objective


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda r, b: r["T_max"], "its function failed: KeyError"),
        (lambda r, b: 1.0, r"returned shape \(\)"),
        (lambda r, b: np.full_like(r["M_sup"], np.nan), "returned nan for a possible choice"),
    ],
)
def test_a_function_that_is_wrong_gets_one_line(function, said):
    with pytest.raises(ProblemError, match=said) as caught:
        seqopt.solve(posed(StepCost("wrong", NAMES, function)), "overlap_dp")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("aim", ["sum"])
def test_a_cost_below_zero_is_refused_where_steps_can_be_added(aim):
    """A sum would fall without end; where moves are given any sign is allowed."""
    criterion = StepCost("gain", ("F_largest",), lambda r, bricks: r["F_largest"] - 60.0)
    engine = seqopt.make_engine("compliance", small_arch(4))
    free = build_states(engine, FreeRules(), criterion, aim)
    with pytest.raises(ProblemError, match=r"gain: a step costs -\d.* at \d bricks; .* constant"):
        seqopt.solve(free, "schedule_search")
    with pytest.raises(ProblemError, match="gain: a step costs -"):
        Proof(free).bounds((0.0,) * len(free.goals))
    assert seqopt.solve(posed(criterion), "overlap_dp").certificate.gap == 0


def test_what_is_no_function_is_refused():
    with pytest.raises(ProblemError, match="give names of responses"):
        StepCost("wrong", NAMES, 3.0)
    with pytest.raises(ProblemError, match="give names of responses"):
        StepCost("wrong", "T_max", weighed)
    with pytest.raises(ProblemError, match="response X_max does not exist"):
        posed(StepCost("wrong", ("X_max",), weighed))


# aims in their order


def values(goals):
    """What every allowed choice is worth, in the order of the aims."""
    found = {}
    for choice in product(*(range(size) for size in goals[0][0].sizes)):
        worth = tuple(aim.value_of(costs, choice) for costs, aim in goals)
        if np.isfinite(worth).all():
            found[choice] = worth
    return found


@given(problem=problems(), data=st.data())
def test_aims_in_their_order_agree_with_brute_force(problem, data):
    goals = [(problem.sums, data.draw(st.sampled_from(Aim)))]
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    for _ in range(data.draw(st.integers(0, 2))):
        costs = replace(
            problem.sums,
            single=tuple(rng.integers(0, 3, s.shape) + 0.0 for s in problem.sums.single),
            shared=tuple(rng.integers(0, 3, s.shape) + 0.0 for s in problem.sums.shared),
        )
        goals.append((costs, data.draw(st.sampled_from(Aim))))
    found = values(goals)
    if not found:
        with pytest.raises(InfeasibleError, match="move"):
            best_in_order(goals)
        return
    assert found[best_in_order(goals)] == min(found.values())
