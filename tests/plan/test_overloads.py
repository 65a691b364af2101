"""What is promised of every step: payloads and limits, and what helps where they are exceeded."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph.decision_costs import LayeredCosts
from seqopt.graph.states.states import build_states
from seqopt.plan._infeasible import payload_advice
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import overloads, payload_limits
from tests.builders import small_arch
from tests.layered import Costs


def weak(scene, payload):
    return replace(scene, robots=tuple(replace(r, payload=payload) for r in scene.robots))


def test_a_limit_that_a_fixed_step_exceeds_is_infeasible(arch25):
    """The first two steps of the loop have no open grip: nothing can be chosen there."""
    with pytest.raises(InfeasibleError, match=r"F_largest is up to .* of 20 \(steps? 1"):
        seqopt.optimize(arch25, limits=[seqopt.Limit("F_largest", 20.0)])
    with pytest.raises(InfeasibleError, match="no grip is left to choose"):
        seqopt.optimize(
            arch25, "modified-sequential", formulation="cascade",
            search=seqopt.Search(proof=False),
            limits=payload_limits(weak(arch25, 150.0)),
        )  # fmt: skip


def test_payloads_hold_on_every_step_or_are_named(arch25):
    kept = seqopt.optimize(arch25, limits=payload_limits(arch25))
    assert kept.overloads == ()
    assert kept.summary()["payload_exceeded"] == []
    over = seqopt.optimize(weak(arch25, 350.0))
    assert [excess.limit.response for excess in over.overloads] == ["F_rob1"]
    table = over.responses()
    assert over.overloads[0].largest == table["F_rob1_N"].abs().max()
    assert over.summary()["payload_exceeded"] == [str(over.overloads[0])]
    assert "rob1 holds up to 375.4 N, more than its payload of 350 N (step" in str(
        over.overloads[0]
    )


@pytest.mark.parametrize(("share", "exceeds"), [(1 - 1e-12, False), (1 - 1e-6, True)])
def test_the_last_bit_decides_nothing(share, exceeds):
    limit = seqopt.Limit("T_max", share * 0.3)
    assert limit.exceeded(np.array([0.1 + 0.2, np.nan])).tolist() == [exceeds, False]


def small():
    costs = LayeredCosts(
        (np.array([2.0, 1.0]), np.array([1.0, 4.0])), (np.zeros((1, 2)), np.ones((2, 2)))
    )
    return Costs(costs).compiled().instance


def test_costs_that_change_while_they_are_judged_are_seen(monkeypatch):
    monkeypatch.setattr("seqopt.judge.arithmetic.proven", lambda *_: 99.0)
    with pytest.raises(SolverError, match="the bound 99 is above the path's 3"):
        seqopt.solve(small(), "overlap_dp")


ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))


def settled(fall=-0.005, payload=None, bricks=7):
    """An arch whose second end sinks, m; by default robots carry what they are given."""
    scene = small_arch(bricks)
    first, second = scene.grounds
    scene = replace(scene, grounds=(first, replace(second, movement=(0.0, 0.0, fall))))
    strong = (replace(robot, payload=payload or robot.payload) for robot in scene.robots)
    return scene.with_robots(*strong)


def advice(scene):
    """What is said of the sequential method, and how much the largest grip would hold, N."""
    engine = seqopt.make_engine("compliance", scene)
    over = overloads(scene, seqopt.analyze(engine, seqopt.sequential(engine.network)))
    return payload_advice(engine.network, over), max(each.largest for each in over)


def weight(scene):
    return np.linalg.norm(seqopt.build_network(scene).weight, axis=1).sum()


@pytest.mark.parametrize(("fall", "stiff"), [(-0.005, True), (0.0, False)])
def test_a_payload_beyond_all_weights_comes_with_the_grips_that_need_less(fall, stiff):
    scene = settled(fall, payload=5.0)
    said, least = advice(scene)
    assert (least > weight(scene)) == stiff == ("softer grips (--grips)" in said)
    (newton,) = re.findall(r"^payload of (\S+) N is enough for this plan: --payload \1", said)
    assert least <= float(newton) < 1.1 * least
    if stiff:
        soft = seqopt.make_engine("compliance", scene.with_grips(1e3))
        table = seqopt.analyze(soft, seqopt.sequential(soft.network))
        assert max(each.largest for each in overloads(scene, table)) < weight(scene)


def test_a_free_schedule_says_so_too():
    engine = seqopt.make_engine("compliance", settled(bricks=4))
    problem = build_states(engine, seqopt.FreeRules(), ONES, "steps")
    with pytest.raises(InfeasibleError, match=r"a payload of .* softer grips") as found:
        seqopt.solve(problem, "schedule_search")
    assert str(found.value).count("softer grips") == 1
