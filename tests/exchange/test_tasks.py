"""Tasks of robots: what each does in every step, and frames that follow from the bricks."""

from __future__ import annotations

import csv
import io
import json
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.harness.scenes import running_bond
from seqopt.exchange._grip_frames import hold
from seqopt.exchange._tasks import Action, plan_tasks, tasks_csv, tasks_json
from seqopt.network.build import build_network
from seqopt.scene._armed import PlanPostures
from seqopt.scene.parts import Robot, Side, Sphere
from seqopt.sequence.methods import METHODS
from seqopt.sequence.steps import Step, StepKind, check_sequence
from tests.builders import six_bricks
from tests.strategies import builds

SCENE = six_bricks()
STEPS = METHODS["cantilever"](build_network(SCENE), ())
TASKS = [*plan_tasks(SCENE, STEPS)]
WALL = running_bond(2, 1)
PLACE, RELEASE, REPOSITION = StepKind.PLACE, StepKind.RELEASE, StepKind.REPOSITION
REGRIPPED = check_sequence(
    WALL,
    [
        Step(1, PLACE, 1, (WALL.bricks[0].nodes[0], None, None)),
        Step(2, PLACE, 2, (WALL.bricks[0].nodes[0], WALL.bricks[1].nodes[1], None)),
        Step(3, RELEASE, 2, (None, WALL.bricks[1].nodes[1], None)),
        Step(4, REPOSITION, 2, (WALL.bricks[0].nodes[1], WALL.bricks[1].nodes[1], None)),
        Step(5, RELEASE, 2, (None, None, None)),
    ],
)


def replayed(scene, tasks):
    """What robots hold and what stands after every step, from the tasks alone."""
    held, standing, out = {}, [], {}
    for task in tasks:
        key = (task.block, task.node)
        match task.action:
            case Action.PICK:
                assert task.robot not in held
                held[task.robot] = key
            case Action.PLACE:
                assert held[task.robot] == key
                standing.append(task.block)
            case Action.REPOSITION:
                assert task.robot not in held
                assert task.block in standing
                held[task.robot] = key
            case Action.HOLD:
                assert held[task.robot] == key
            case Action.RELEASE:
                assert held.pop(task.robot) == key
        grips = tuple(held.get(robot.name, (None, None))[1] for robot in scene.robots)
        out[task.step] = (len(standing), grips)
    return out


def test_a_robot_that_does_the_tasks_does_the_plan():
    for scene, steps in ((SCENE, STEPS), (WALL, REGRIPPED)):
        tasks = [*plan_tasks(scene, steps)]
        done = replayed(scene, tasks)
        assert [done[s.number] for s in steps] == [(s.bricks, s.grips) for s in steps]
        assert [task.step for task in tasks] == sorted(task.step for task in tasks)
    assert {task.action for task in tasks} == {*Action} - {Action.REMOVE, Action.STORE}
    places = Counter(task.block for task in TASKS if task.action is Action.PLACE)
    assert places == Counter(SCENE.build_order)
    with pytest.raises(AssertionError):  # the control
        replayed(SCENE, [task for task in TASKS if task.action is not Action.RELEASE])


@settings(max_examples=25)
@given(scene=builds(), data=st.data())
def test_frames_follow_from_the_brick(scene, data):
    """The tip is the node, the tool looks into the brick through one of its faces, square to it."""
    robot = data.draw(st.sampled_from(scene.robots))
    brick = data.draw(st.sampled_from(scene.bricks))
    node = data.draw(st.sampled_from(brick.nodes))
    held = hold(scene, robot, node)
    axes = held.grip.axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(axes) > 0
    at = brick.node_position(node)
    assert held.grip.point == at
    assert np.abs(brick.frame @ axes[2]).max() == pytest.approx(1.0)  # square to a face of a box
    entry = brick.frame @ (np.array(at) - held.depth * axes[2] - brick.position)
    half = 0.5 * np.array(brick.dimensions)
    assert (np.abs(entry) <= half + 1e-9).all()
    assert np.abs(np.abs(entry) - half).min() < 1e-9  # on the face
    inside = held.grip.inside(held.block)
    back = held.block.point + np.array(inside.point) @ held.block.axes
    np.testing.assert_allclose(back, at, atol=1e-12)
    np.testing.assert_allclose(inside.axes @ held.block.axes, axes, atol=1e-12)


def outward(scene, robot, node):
    return -hold(scene, robot, node).grip.axes[2]


def test_a_tool_comes_from_its_robot_through_a_face_that_is_free():
    wall = running_bond(3, 3)
    middle = wall.bricks[4]
    front, back = (Side(toward=(0.0, y, 0.0), point=(0.0, -y, 0.0)) for y in (-1.0, 1.0))
    arm = Sphere(center=(0.3, 2.0, 0.0), radius=3.0)
    for reach, toward in ((front, -1.0), (back, 1.0), (arm, 1.0)):
        robot = Robot(name="r", payload=1.0, reach=reach)
        np.testing.assert_allclose(outward(wall, robot, middle.nodes[0]), (0, toward, 0), atol=1e-9)
    mobile = Robot(name="r", payload=1.0)
    assert outward(wall, mobile, middle.nodes[0])[2] == pytest.approx(0.0)  # one lies on it later
    assert outward(wall, mobile, wall.bricks[-1].nodes[0])[2] == pytest.approx(1.0)  # none ever


def test_a_brick_is_placed_away_from_all_that_it_touches():
    """Up on a course, and out of the gap between two for one that closes an arch."""
    wall, robot = running_bond(3, 2), Robot(name="r", payload=1.0)
    np.testing.assert_allclose(hold(wall, robot, wall.bricks[0].nodes[0]).away, (0, 0, 1))
    for scene in (wall, SCENE):
        for brick in scene.placed:
            away = np.array(hold(scene, robot, brick.nodes[0]).away)
            assert np.linalg.norm(away) == pytest.approx(1.0)
            free = [into @ away for into in stands_on(scene, brick)]
            assert min(free) > 0
    assert len(free) == 2  # the last brick closes the arch
    others = [axis for axis in (*brick.frame, *-brick.frame) if axis @ away < 1 - 1e-9]
    assert all(min(into @ axis for into in stands_on(SCENE, brick)) < min(free) for axis in others)


def stands_on(scene, brick):
    """Normals into a brick of the joints with what stands when it is placed."""
    for spring in (*scene.joints, *scene.grounds):
        earlier = all(scene.since[end] <= scene.since[brick.name] for end in spring.ends)
        if brick.name in spring.ends and earlier:
            normal = np.array(spring.along)
            yield normal * np.sign(normal @ np.subtract(brick.position, spring.position))


def test_postures_are_written_where_they_are_given():
    rows = tuple(tuple(None if n is None else 0 for n in step.grips) for step in STEPS)
    table = SimpleNamespace(joints=np.array([[0.1, -2.0, np.nan]]), axes=np.eye(3)[None])
    tasks = [*plan_tasks(SCENE, STEPS, postures=PlanPostures(table, rows, ()))]
    told = [task for task in tasks if task.posture is not None]
    assert told == [task for task in tasks if task.action is not Action.PICK]
    assert {task.grip.xaxis for task in told} == {(1.0, 0.0, 0.0)}
    assert json.loads(tasks_json(SCENE, tasks))["tasks"][1]["posture"] == [0.1, -2.0]
    lines = [*csv.DictReader(io.StringIO(tasks_csv(tasks)))]
    assert (lines[1]["joint_1"], lines[1]["joint_2"]) == ("0.1", "-2")
    assert lines[0]["joint_1"] == ""
    assert "joint_3" not in lines[0]
