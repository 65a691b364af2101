"""Where a payload is no remedy: ground that moves while stiff grips hold nodes in place."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

import seqopt
from seqopt.errors import InfeasibleError
from seqopt.graph.states.states import build_states
from seqopt.network.build import build_network
from seqopt.plan._infeasible import payload_advice, whole_load
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import overloads
from seqopt.responses.table import analyze
from seqopt.sequence.methods import sequential
from seqopt.sequence.rules import FreeRules
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
    steps = sequential(engine.network)
    over = overloads(scene, analyze(engine, steps))
    return payload_advice(engine, steps, over), over


def grips(said):
    (stiffness,) = re.findall(r"grips of (\S+) N/m \(--grips \1\)", said)
    return float(stiffness)


def test_grips_that_are_said_to_be_enough_are_and_ten_times_stiffer_ones_are_not():
    """It was a payload of many times the weight of all bricks."""
    scene = settled()
    said, over = advice(scene)
    assert max(each.largest for each in over) > whole_load(build_network(scene))
    assert said.startswith("no payload helps: ")
    assert "while the ground moves" in said
    for share, enough in ((1.0, True), (10.0, False)):
        engine = seqopt.make_engine("compliance", scene.with_grips(share * grips(said)))
        table = analyze(engine, sequential(engine.network))
        assert (not [each for each in overloads(scene, table) if each.brick is None]) == enough


def test_a_payload_that_a_robot_could_have_is_still_said():
    scene = settled(0.0, payload=5.0)
    said, over = advice(scene)
    least = max(each.largest for each in over)
    assert least < whole_load(build_network(scene))
    (newton,) = re.findall(r"^payload of (\S+) N is enough for this plan: --payload \1", said)
    assert least <= float(newton) < 1.1 * least


def test_a_free_schedule_names_grips_with_which_there_is_a_plan():
    engine = seqopt.make_engine("compliance", settled(bricks=4))
    problem = build_states(engine, FreeRules(), ONES, "steps")
    with pytest.raises(InfeasibleError, match=r"becomes possible with .*grips of") as found:
        seqopt.solve(problem, "schedule_search")
    newtons = [int(n) for n in re.findall(r"--payload (\d+)", str(found.value))]
    assert max(newtons, default=0) <= whole_load(engine.network)
    soft = seqopt.make_engine("compliance", settled(bricks=4).with_grips(grips(str(found.value))))
    assert seqopt.solve(build_states(soft, FreeRules(), ONES, "steps")).steps
