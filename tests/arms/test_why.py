"""Why an arm reaches a node with no posture, in words, and what there is to do."""

import re
from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.arms import _tables, find_postures
from seqopt.arms._kept import plan_postures
from seqopt.arms._permits import reach
from seqopt.arms._tables import _known
from seqopt.scene.parts import Sphere
from seqopt.sequence.steps import Step, StepKind
from tests.arms.scenes import beside_a_wall, boxes

pytest.importorskip("pinocchio")
pytest.importorskip("coal")

TOP = {"faces": ("thickness",)}


def reasons(scene):
    """Why no posture is possible, by node, where there is none."""
    rows = reach(scene)
    assert ((rows["to_bricks"] == 0) == (rows["why"] != "")).all()
    return {node: why for node, why in zip(rows["node"], rows["why"], strict=True) if why}


@pytest.mark.slow
def test_a_tool_in_the_model_is_found_and_its_end_named(tmp_path):
    urdf = boxes(tmp_path / "arm.urdf", gripper=True)
    found = reasons(beside_a_wall(urdf, **TOP))
    assert len(found) == 12
    for why in found.values():
        assert re.match("link gripper (hits the brick that it grips|touches the ground);", why)
        assert "after the flange tool0, so the model has the tool: give flange=tcp" in why
    assert not reasons(beside_a_wall(urdf, flange="tcp", **TOP))  # the remedy
    assert not reasons(beside_a_wall(boxes(tmp_path / "bare.urdf"), **TOP))  # the control


@pytest.mark.parametrize(
    ("far", "more", "said"),
    [
        (9.0, {}, "too far: its flange gets about 2.5 m from its base"),
        (0.9, {"tool_length": 0.05}, "the tool is too short: the flange would be in the brick"),
        (0.9, {}, "link l5 touches the ground"),
        (2.35, {}, "no posture was found within joint limits with the tool square to a face"),
    ],
)
def test_what_stops_an_arm_is_said(tmp_path, far, more, said):
    how = {"faces": ("width",)} | more
    found = reasons(beside_a_wall(boxes(tmp_path / "arm.urdf"), (0.3, -far, 0.0), **how))
    assert any(why.startswith(said) for why in found.values()), found


def test_a_node_outside_the_given_reach_is_said_to_be(tmp_path):
    scene = beside_a_wall(boxes(tmp_path / "arm.urdf"), **TOP)
    (robot,) = scene.robots
    near = replace(robot, reach=Sphere(center=(0.0, 0.0, 0.0), radius=0.25))
    found = reasons(scene.with_robots(near))
    outside = {n for n in scene.brick_of_node if not near.reach.covers(scene.node_position(n))}
    assert 0 < len(outside) < 12
    assert {*found} == outside
    assert all("outside the reach that the scene gives" in why for why in found.values())


def test_bricks_and_bases_that_are_hit_are_named(tmp_path):
    scene = beside_a_wall(boxes(tmp_path / "arm.urdf"), **TOP)
    table = find_postures(scene)
    standing = np.ones(len(table.bricks), dtype=bool)
    stopped = [n for n in table.nodes if table.hits[table.rows("arm", n)].any(axis=1).all()]
    assert stopped
    for node in stopped:
        rows = table.rows("arm", node)
        why = table.why_not("arm", node, rows, standing)
        link, brick = re.fullmatch(r"(link l\d|tool) hits brick (\d)", why).groups()
        column = table.bricks.index(int(brick))
        assert any(table.links[k].startswith(link) for k in table.strikes[rows, column] if k >= 0)
        assert table.why_not("arm", node, rows, ~standing) == ""  # without bricks it is free
        held = Step(1, StepKind.PLACE, 6, (node,))
        (fault,) = plan_postures(scene, [held]).unreached
        assert fault.why == f"arm at node {node} has no posture ({why})"


def test_the_command_lists_nodes_by_reason(tmp_path, capsys):
    file = tmp_path / "s.json"
    seqopt.save_scene(beside_a_wall(boxes(tmp_path / "arm.urdf", gripper=True), **TOP), file)
    assert main(["reach", str(file), "--out", str(tmp_path / "reach")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "never: 8, 9, 10, 11, 12, 13 (link gripper hits the brick that it grips; it" in said
    assert "flange=tcp" in (tmp_path / "reach" / "reach.csv").read_text()


# every command that computes postures keeps them in a folder, and takes them from there


pytest.importorskip("pinocchio")
pytest.importorskip("coal")

FREE = ("--schedule", "free", "--rule", "least_grips=0", "--rule", "newest=free")


@pytest.fixture
def folder(tmp_path, monkeypatch, capsys):
    """A plan of a wall with an arm; commands run beside it, in processes without any posture."""
    monkeypatch.chdir(tmp_path)
    scene = beside_a_wall(boxes(tmp_path / "arm.urdf"), faces=("thickness",))
    seqopt.save_scene(scene, "s.json")
    assert main(["optimize", "s.json", *FREE, "--aim", "steps", "--out", "plan"]) == 0
    capsys.readouterr()
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        pytest.param(["replan", "plan", "--no-stability"], marks=pytest.mark.slow),
        ["reach", "s.json"],
    ],
)
def test_postures_are_kept_and_taken(folder, words, monkeypatch):
    _known.cache_clear()
    assert main([*words, "--cache", "kept"]) == 0
    assert [*(folder / "kept").glob("postures-*.npz")]
    _known.cache_clear()
    monkeypatch.setattr(_tables, "_compute_table", lambda *_: pytest.fail("computed again"))
    assert main([*words, "--cache", "kept"]) == 0
