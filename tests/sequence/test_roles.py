"""Who places and who holds: from reach, or by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.scene.parts import Robot, Sphere
from seqopt.sequence.methods import (
    METHODS,
    SCHEDULES,
    _two_robot_loop,
    modified_sequential,
    robot_loop,
    sequential,
    three_robot_loop,
)
from seqopt.sequence.steps import StepKind, idle_robots
from tests.builders import anywhere, small_arch


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
