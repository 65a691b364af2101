"""Where a payload is no remedy: ground that moves while stiff grips hold nodes in place."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.errors import InfeasibleError
from seqopt.graph.states.states import build_states
from seqopt.plan._infeasible import payload_advice
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import overloads
from tests.builders import small_arch

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
