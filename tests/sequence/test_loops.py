"""Loops of two robots and more: who grips when, and that an optimization can fill them."""

from __future__ import annotations

from dataclasses import replace

import pytest

import seqopt
from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.sequence.methods import (
    SCHEDULES,
    _two_robot_loop,
    modified_sequential,
    placing_node,
    robot_loop,
    sequential,
)
from seqopt.sequence.schedule import OpenGrip, Schedule, thin
from seqopt.sequence.steps import StepKind, idle_robots
from seqopt.study.published import EQUATIONS, WEIGHTED, printed
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


# the three-robot loop and the modified sequential method as schedules


def test_who_moves_when(loop25):
    """Table B.1: 22 moves, at step 3 and every fourth after it, by robots 3, 2, 1 in turn."""
    assert [m.step for m in loop25.moves] == list(range(3, 88, 4))
    assert [m.robot for m in loop25.moves] == [f"rob{3 - k % 3}" for k in range(22)]
    printed_robots = printed("three_robot_plan").set_index("step")["optimized_robot"]
    for step in loop25.steps[2:]:
        named = {f"rob{number}" for number in str(printed_robots[step.number]).split(";")}
        assert {loop25.moves[m].robot for m in step.moves} == named


def test_the_modified_sequential_method(engine25):
    """A third support for three steps; without it the sequential method is left."""
    schedule = modified_sequential(engine25.network)
    assert len(schedule.moves) == 23
    for k in range(len(schedule.moves)):
        kinds = [s.kind for s in schedule.steps if k in s.moves]
        assert kinds == [StepKind.REPOSITION, StepKind.RELEASE, StepKind.PLACE]
    plain = [(s.bricks, s.grips[:2]) for s in sequential(engine25.network)]
    bare = [(s.bricks, s.grips[:2]) for s in schedule.steps if s.kind is not StepKind.REPOSITION]
    assert [b for i, b in enumerate(bare) if i == 0 or b != bare[i - 1]] == plain
    nodes = [m.candidates[0] for m in schedule.moves]
    assert len(schedule.fill(nodes)) == len(schedule.steps)


def test_schedules_are_checked(loop25):
    with pytest.raises(StepError, match="3 nodes for 22 moves"):
        loop25.fill((1, 2, 3))
    far = replace(loop25.steps[0], grips=(OpenGrip(0), OpenGrip(5), None))
    with pytest.raises(StepError, match="at most two neighboring"):
        Schedule("x", loop25.scene, (far,), loop25.moves).require_pairs()


# fewer candidates: those near the newest bricks, never none, and the schedule says so


@pytest.mark.parametrize("method", SCHEDULES)
def test_on_a_chain_joints_are_counted(arch25, method):
    schedule = SCHEDULES[method](arch25)
    thinned = thin(schedule, "near:4")
    place = {brick.name: i for i, brick in enumerate(arch25.placed)}
    for few, whole in zip(thinned.moves, schedule.moves, strict=True):
        newest = range(max(0, whole.bricks - 2), whole.bricks)
        away = {
            node: min(abs(place[arch25.brick_of_node[node].name] - end) for end in newest)
            for node in whole.candidates
        }
        limit = max(4, min(away.values()))
        assert few.candidates == tuple(n for n in whole.candidates if away[n] <= limit)
    assert thinned.steps == schedule.steps


@pytest.mark.parametrize("rule", ["near:", "near:-1", "far:3", 3])
def test_what_is_no_rule_is_refused(loop25, rule):
    with pytest.raises(StepError, match="give near:JOINTS, as near:12"):
        thin(loop25, rule)
