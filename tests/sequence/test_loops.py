"""Loops of two robots and more: who grips when, and that an optimization can fill them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.scene.parts import Robot, Sphere
from seqopt.sequence.methods import (
    METHODS,
    SCHEDULES,
    _two_robot_loop,
    modified_sequential,
    placing_node,
    robot_loop,
    sequential,
    three_robot_loop,
)
from seqopt.sequence.schedule import OpenGrip, Schedule, thin
from seqopt.sequence.steps import StepKind, idle_robots
from seqopt.study import EQUATIONS, WEIGHTED, printed
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


@pytest.mark.parametrize(("count", "criterion"), [(2, WEIGHTED), (5, EQUATIONS)])
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


# who places and who holds: from reach, or by name


def placers(scene, steps):
    """Return who places every brick."""
    found = []
    for before, step in zip((None, *steps), steps, strict=False):
        if step.kind is StepKind.PLACE:
            taken = [
                robot.name
                for i, robot in enumerate(scene.robots)
                if step.grips[i] is not None and (before is None or before.grips[i] is None)
            ]
            found += taken
    return found


def near(scene, name, *bricks):
    """A robot that reaches some neighboring bricks and no others."""
    nodes = {n: np.array(b.node_position(n)) for b in scene.bricks for n in b.nodes}
    own = [nodes[n] for b in scene.bricks if b.name in bricks for n in b.nodes]
    center = np.mean(own, axis=0)
    radius = max(np.linalg.norm(p - center) for p in own) + 1e-6
    robot = Robot(name=name, payload=400.0, reach=Sphere(center=tuple(center), radius=radius))
    reached = {b.name for b in scene.bricks if robot.reach.covers(b.node_position(b.nodes[0]))}
    assert set(bricks) <= reached
    return robot


def with_robots(scene, *robots):
    return build_network(replace(scene, robots=robots))


def test_the_first_two_that_reach_build():
    """A robot that reaches nothing comes first, and is left out."""
    scene = small_arch(5)
    far = Robot(name="far", payload=1.0, reach=Sphere(center=(50.0, 0.0, 0.0), radius=1.0))
    net = with_robots(scene, far, *anywhere(2))
    for method in METHODS.values():
        steps = method(net)
        assert placers(net.scene, steps)[:2] == ["rob1", "rob2"]
        assert idle_robots(net.scene, steps) == ("far",)
    three = with_robots(scene, far, *anywhere(3))
    for name in ("three-robot", "modified-sequential"):
        assert idle_robots(three.scene, SCHEDULES[name](three).steps) == ("far",)
    with pytest.raises(
        StepError, match="one places bricks 1, 5, all within reach of rob1, rob2, rob3;"
    ):
        robot_loop(with_robots(scene, far, *anywhere(3)))


def test_robots_by_name_take_the_roles_in_their_order():
    net = build_network(replace(small_arch(7), robots=anywhere(5)))
    for method in (*METHODS.values(), _two_robot_loop):
        made = method(net, ("rob4", "rob2"))
        steps = made if isinstance(made, tuple) else made.steps
        assert placers(net.scene, steps)[:2] == ["rob4", "rob2"]
        assert idle_robots(net.scene, steps) == ("rob1", "rob3", "rob5")
    for method in (three_robot_loop, robot_loop, modified_sequential):
        schedule = method(net, ("rob5", "rob1", "rob3"))
        assert placers(net.scene, schedule.steps)[:2] == ["rob5", "rob1"]
        assert schedule.moves[0].robot == "rob3"
        assert idle_robots(net.scene, schedule.steps) == ("rob2", "rob4")
    assert robot_loop(net, ("rob5", "rob1", "rob3", "rob2")).method == "four-robot"


@pytest.mark.parametrize(
    ("method", "names", "named"),
    [
        ("sequential", ("rob1", "robot"), "robot 'robot' does not exist; give some of rob1, rob2"),
        ("sequential", ("rob1", "rob1"), "robots rob1, rob1: one occurs twice"),
        ("two-robot", ("rob1", "rob2", "rob3"), "3 named; two-robot takes two"),
        ("three-robot", ("rob1", "rob2"), "2 named; three-robot takes three"),
        ("loop", ("rob1",), "1 named; two-robot takes two"),
    ],
)
def test_wrong_names_get_one_line(arch25, method, names, named):
    with pytest.raises(StepError, match=named) as caught:
        (METHODS | SCHEDULES)[method](build_network(arch25), names)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", [*METHODS, *SCHEDULES])
@pytest.mark.parametrize(("bricks", "robots"), [(2, 1), (1, 2), (2, 5)])
def test_few_bricks_and_few_robots_work_or_get_one_line(method, bricks, robots):
    net = build_network(replace(small_arch(bricks), robots=anywhere(robots)))
    enough = {"three-robot": (3, 4), "loop": (robots, robots + 1), "modified-sequential": (3, 1)}
    most, least = enough.get(method, (2, 1))
    most, least = (2, 1) if method == "loop" and robots < 3 else (most, least)
    if robots >= most and bricks >= least:
        made = (METHODS | SCHEDULES)[method](net)
        assert (made if isinstance(made, tuple) else made.steps)[-1].bricks == bricks
        return
    with pytest.raises(StepError, match="this method needs") as caught:
        (METHODS | SCHEDULES)[method](net)
    assert "\n" not in str(caught.value)


def test_a_brick_that_nobody_reaches_is_named():
    scene = small_arch(5)
    net = with_robots(scene, near(scene, "a", 1, 2), near(scene, "b", 1, 2))
    with pytest.raises(
        StepError, match=r"brick 3: a and b reach none of its free nodes \[4, 5\]; extend a reach"
    ):
        sequential(net)
    mixed = with_robots(scene, near(scene, "a", 1, 2), *anywhere(1))
    with pytest.raises(
        StepError, match=r"a reaches none .*; rob1 does, and holds the brick before"
    ):
        sequential(mixed)
