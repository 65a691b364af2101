"""Ways to nodes and back, where arms are checked if that is asked for; MuJoCo is the witness."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import seqopt
from seqopt.arms._model import ArmModel
from seqopt.arms._reached import WAY, targets, way
from seqopt.arms.reach import find_postures
from seqopt.errors import SceneError
from seqopt.scene.arm import Arm
from tests.arms.scenes import TOOL, two_arms

for extra in ("pinocchio", "coal", "compas_fab", "mujoco"):
    pytest.importorskip(extra)
from tests.arms.witness import Site as Witness  # noqa: E402

FAR = 0.25  # m


@pytest.fixture(scope="module")
def scenes():
    """Without ways and with them."""
    return two_arms(), two_arms(approach=FAR)


@pytest.fixture(scope="module")
def tables(scenes):
    return [find_postures(scene) for scene in scenes]


def gone(scene, table, row):
    """The way of a posture, and how it comes to its node; None if there is none."""
    robot = next(r for r in scene.robots if r.name == table.robots[table.robot[row]])
    model, node = ArmModel(replace(robot.arm, approach=FAR)), table.nodes[table.node[row]]
    brick = scene.brick_of_node[node]
    target = min(
        targets(model, brick, node), key=lambda each: np.abs(each.axes - table.axes[row]).max()
    )
    return target, way(model, target, table.joints[row])


@pytest.mark.slow
def test_a_way_is_straight_and_ends_where_it_begins(scenes, tables):
    model = ArmModel(scenes[1].robots[0].arm)
    rows = np.flatnonzero(tables[1].robot == 0)
    assert len(rows)
    for row in rows.tolist():
        target, points = gone(scenes[1], tables[1], row)
        assert len(points) == WAY
        for k, posture in enumerate(points, start=1):
            axes, place = model.flange_pose(posture)
            back = target.place - k / WAY * FAR * target.axes[:, 2]
            np.testing.assert_allclose(place, back, atol=1e-5)
            np.testing.assert_allclose(axes, target.axes, atol=1e-5)


def touched(scene, table, rows):
    """By posture: what MuJoCo finds in contact on the way, bricks as numbers, the rest as words.

    The tool goes around the brick that it grips.
    """
    ways = {row: gone(scene, table, row)[1] for row in rows}
    known = [(row, k) for row in rows if ways[row] is not None for k in range(WAY)]
    joints = np.array([ways[row][k] for row, k in known])
    tools = np.array([table.tools[row] for row, _ in known])
    site = Witness(scene, SimpleNamespace(joints=joints, tools=tools))
    out = {row: set() for row in rows if ways[row] is not None}
    for i, (row, _) in enumerate(known):
        robot, node = table.robots[table.robot[row]], table.nodes[table.node[row]]
        gripped = (("brick", scene.brick_of_node[node].name), (robot, "tool"))
        for pair in site.touching({robot: i}, len(scene.bricks)) - {gripped}:
            (kind, what), _ = pair
            out[row].add(what if kind == "brick" and what else str(pair))
    return out


@pytest.mark.slow
def test_ways_touch_what_the_table_says_and_nothing_else(scenes, tables):
    """And the control: where ways are not checked, some of them touch more."""
    names = np.array(tables[1].bricks)
    for table, is_checked in zip(tables, (False, True), strict=True):
        rows = range(0, len(table.robot), 3)
        found, more = touched(scenes[is_checked], table, rows), 0
        for row, what in found.items():
            more += bool(what - {*names[table.hits[row]].tolist()})
        assert (more > 0 or len(found) < len(rows)) != is_checked
        assert len(found) == len(rows) or not is_checked


@pytest.mark.slow
def test_checked_ways_leave_fewer_postures_and_less_room(scenes, tables):
    without, checked = tables
    assert (checked.found <= without.found).all()
    assert checked.found.sum() < without.found.sum()
    assert len(checked.robot)
    plan = seqopt.optimize(scenes[1], "free", aim="minmax", rules="least_grips=1")
    assert plan.arms.best
    assert not plan.arms.postures.unreached


def test_an_approach_is_kept_in_scene_files(scenes, tmp_path):
    path = tmp_path / "scene.json"
    seqopt.save_scene(scenes[1], path)
    assert seqopt.load_scene(path) == scenes[1]
    assert '"approach": 0.25' in path.read_text(encoding="utf-8")
    with pytest.raises(SceneError, match="approach"):
        Arm(**TOOL, position=(0, 0, 0), approach=-0.1)
