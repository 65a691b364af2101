"""Tasks of robots; plans go into the formats of others; blocks that interpenetrate."""

import csv
import io
import json
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt._files import write_file
from seqopt.arms._kept import PlanPostures
from seqopt.errors import SceneError, SceneWarning, StepError
from seqopt.exchange._content import Given
from seqopt.exchange._grip_frames import hold
from seqopt.exchange._tasks import Action, plan_tasks, tasks_csv, tasks_json
from seqopt.exchange.exports import export
from seqopt.exchange.imports import import_scene
from seqopt.network.network import build_network
from seqopt.scene.parts import Robot, Side, Sphere
from seqopt.sequence.methods import METHODS
from seqopt.sequence.steps import Step, StepKind, check_sequence
from tests.blocks import box
from tests.builders import running_bond, six_bricks
from tests.documents import DOCUMENTS, obj
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


# plans go into the formats of others, and folders of plans are read again
@pytest.fixture
def sources(tmp_path):
    """Write documents; return the scenes that they become."""

    def write(name):
        path = tmp_path / f"{name}.json"
        write_file(path, json.dumps(DOCUMENTS[name]))
        return path, import_scene(path, given=Given(unit="m", density=2000.0))

    return write


def test_an_assembly_keeps_all_and_gains_the_plan(sources):
    path, scene = sources("assembly")
    steps = METHODS["sequential"](build_network(scene), ())
    whole = json.loads(export(scene, steps, "compas_assembly", path))
    graph = whole["data"]["graph"]["data"]
    assert [graph["node"][key].get("order") for key in ("0", "4", "7")] == [None, 0, 1]
    before = DOCUMENTS["assembly"]["data"]["graph"]["data"]["node"]["4"]
    assert graph["node"]["4"]["block"] == before["block"]
    assert graph["node"]["4"]["held"][0][0] == 1
    names, count, told = [robot.name for robot in scene.robots], 0, []
    for row in graph["attributes"]["plan"]:
        count += len(row["placed"])
        grips = tuple(row["holds"].get(name, [None])[0] for name in names)
        told.append(Step(row["step"], StepKind(row["type"]), count, grips))
    assert tuple(told) == steps


def test_what_does_not_fit_is_refused(sources, tmp_path):
    path, _ = sources("assembly")
    with pytest.raises(StepError, match="format is 'xml'; give one of tasks"):
        export(SCENE, STEPS, "xml")
    with pytest.raises(StepError, match=r"give the assembly that was imported \(--source\)"):
        export(SCENE, STEPS, "compas_assembly")
    with pytest.raises(StepError, match="takes no source"):
        export(SCENE, STEPS, "tasks", path)
    with pytest.raises(StepError, match="the source has no block 1"):
        export(SCENE, STEPS, "compas_assembly", path)
    meshes, _ = sources("meshes")
    with pytest.raises(SceneError, match="an object is expected"):
        export(SCENE, STEPS, "compas_assembly", meshes)


# blocks that interpenetrate, or stand there twice, are named and never pass in silence
BRICK = (0.2, 0.1, 0.06)


def bricks(*places):
    return [box(BRICK, at=(x, 0.0, z)) for x, z in places]


HALF = bricks((0.0, 0.0), (0.1, 0.0), (0.05, 0.06))
SIDE = bricks((0.0, 0.0), (0.18, 0.0), (0.09, 0.06))
SUNK = bricks((0.0, 0.0), (0.2, 0.0), (0.1, 0.055))
GOOD = bricks((0.0, 0.0), (0.2, 0.0), (0.1, 0.06))
REFUSED = {
    "half": (HALF, "blocks block_0 and block_1 interpenetrate by 60 mm (their bounds by 100 mm"),
    "side": (SIDE, "blocks block_0 and block_1 interpenetrate by 20 mm"),
    "sunk": (SUNK, "blocks block_1 and block_2 interpenetrate by 5 mm"),
}


@pytest.fixture
def read(tmp_path):
    def import_one(shapes, **given):
        path = tmp_path / "wall.obj"
        path.write_text(obj(*shapes), encoding="utf-8")
        return import_scene(path, given=Given(unit="m", density=2000.0, **given))

    return import_one


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("gap", [None, 0.2])
def test_blocks_that_interpenetrate_are_refused_whatever_the_gap(read, name, gap):
    """They came in as blocks beside each other, and every step stood."""
    shapes, said = REFUSED[name]
    with pytest.raises(SceneError) as caught:
        read(shapes, gap=gap)
    assert said in str(caught.value)
    assert "wider gap" not in str(caught.value)
    assert "(--accept-overlaps)" in str(caught.value)
    assert "faces tolerate 3 mm" in str(caught.value)


def test_what_only_touches_is_not_refused(read):
    assert len(read(GOOD).joints) == 3
    nearly = bricks((0.0, 0.0), (0.199, 0.0), (0.1, 0.058))
    assert len(read(nearly).joints) == 3
    with pytest.raises(SceneError, match=r"interpenetrate by 2 mm .* faces tolerate 1 mm"):
        read(nearly, gap=0.001)


def test_accepted_overlaps_are_said_first_and_warned_of(read):
    with pytest.warns(SceneWarning, match="bricks 0 and 1 interpenetrate by 60 mm"):
        scene = read(HALF, accept_overlaps=True)
    assert scene.provenance.splitlines()[1].startswith("blocks block_0 and block_1 interpenetrate")
    assert len(scene.joints) == 2
    with pytest.raises(
        SceneError, match="block_2; move block_2 out of the block that it"
    ) as caught:
        read(SUNK, accept_overlaps=True)
    assert "gap" not in str(caught.value)


def test_a_block_that_is_there_twice_is_refused(read):
    """It weighed twice as much: both were one block of twelve faces."""
    with pytest.raises(SceneError, match="blocks block_2 and block_3 interpenetrate by 60 mm"):
        read([*GOOD, GOOD[2]])
