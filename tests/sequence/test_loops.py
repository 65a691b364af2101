"""Loops of two robots and more: who grips when, and that an optimization can fill them."""

from __future__ import annotations

from dataclasses import replace

import pytest

import seqopt
from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.sequence.methods import SCHEDULES, _two_robot_loop, placing_node, robot_loop, sequential
from seqopt.sequence.steps import idle_robots
from seqopt.study.published import EQUATIONS, WEIGHTED
from tests.builders import anywhere, small_arch


@pytest.mark.parametrize(("count", "word"), [(3, "three"), (4, "four"), (5, "five")])
def test_the_roles_of_any_number_of_robots_rotate(count, word):
    scene = replace(small_arch(11), robots=anywhere(count))
    schedule = robot_loop(build_network(scene))
    assert schedule.method == f"{word}-robot"
    assert len(schedule.moves) == 11 - count
    assert idle_robots(scene, schedule.steps) == ()
    for step in schedule.steps[count - 1 :]:
        held = [grip for grip in step.grips if grip is not None]
        assert len(held) >= count - 1
        newest = {scene.brick_of_node[g].name for g in held if isinstance(g, int)}
        recent = scene.build_order[step.bricks - count + 2 : step.bricks]
        assert {*recent} - newest <= {scene.build_order[count - 1]}  # the first open grip's brick
    whole = {frozenset(m.robot for m in schedule.moves)}
    assert len(schedule.moves) < count or whole == {frozenset(r.name for r in scene.robots)}


def test_two_robots_filled_with_placing_nodes_are_the_sequential_method(engine25, arch25):
    network = engine25.network
    schedule = _two_robot_loop(network)
    robots = {robot.name: robot for robot in arch25.robots}
    nodes = [
        placing_node(network, robots[move.robot], brick)
        for move, brick in zip(schedule.moves, arch25.placed, strict=True)
    ]
    assert schedule.fill(nodes) == sequential(network)


@pytest.mark.parametrize("count", [2, 5])
@pytest.mark.parametrize("criterion", [EQUATIONS, WEIGHTED], ids=lambda c: c.name)
def test_any_loop_can_be_optimized(count, criterion):
    scene = replace(small_arch(9), robots=anywhere(count))
    plan = seqopt.optimize(scene, "loop", criterion)
    assert plan.certificate.gap <= 1e-9
    assert plan.summary()["idle_robots"] == []
    exact = seqopt.optimize(scene, "loop", criterion, "overlap_lp")
    assert exact.certificate.objective == pytest.approx(plan.certificate.objective, rel=1e-6)


def test_too_few_robots_or_bricks_are_counted():
    for bricks, robots, wanted in ((5, 5, "five robots and six"), (2, 3, "three robots and four")):
        scene = replace(small_arch(bricks), robots=anywhere(robots))
        with pytest.raises(StepError, match=f"{robots} robots and {bricks} bricks; .* {wanted}"):
            SCHEDULES["loop"](build_network(scene))
    with pytest.raises(StepError, match="3 robots and 7 bricks; this method needs four robots"):
        robot_loop(build_network(replace(small_arch(7), robots=anywhere(3))), 4)
