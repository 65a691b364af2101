"""Postures of a plan where people see them: tasks of robots, and arms that are drawn."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import seqopt
from experiments.harness.scenes import read_folder
from seqopt._cli.main import main
from seqopt.arms._model import ArmModel, idle_arm
from seqopt.errors import ExtraError, SceneError
from seqopt.exchange._files import csv_text
from seqopt.exchange._tasks import Action, plan_tasks, tasks_json
from seqopt.exchange.exports import export
from seqopt.report._folders import task_files
from seqopt.report._robots import _known_arms
from tests.arms.scenes import TOOL, beside, two_arms

pytest.importorskip("pinocchio")
pytest.importorskip("coal")
pytest.importorskip("compas_fab")


@pytest.fixture(scope="module")
def plan():
    return seqopt.optimize(two_arms(), "free", aim="minmax", rules="least_grips=1")


def test_tasks_have_the_joints_and_the_tool_of_the_posture(plan):
    scene, found = plan.engine.network.scene, plan.arms.postures
    table, names = found.table, [robot.name for robot in scene.robots]
    proposed = [*plan_tasks(scene, plan.steps)]
    tasks = [*plan_tasks(scene, plan.steps, postures=found)]
    turned = 0
    for old, task in zip(proposed, tasks, strict=True):
        if task.robot not in table.robots:
            assert task == old
            continue
        let_go = task.action is Action.RELEASE
        row = found.steps[task.step - 1 - let_go][names.index(task.robot)]
        assert table.nodes[table.node[row]] == task.node
        if task.action is Action.PICK:
            assert task.posture is None
            continue
        assert task.posture == tuple(table.joints[row])
        assert np.allclose(task.grip.axes.T, table.axes[row], atol=1e-5)
        tip = table.place[row] + TOOL["tool_length"] * table.axes[row][:, 2]
        assert np.allclose(task.grip.point, tip, atol=1e-5)
        inner = task.depth + 0.02 + table.tools[row]  # with the fingers: the whole tool
        assert inner == pytest.approx(TOOL["tool_length"])
        turned += not np.allclose(task.grip.axes, old.grip.axes)
        if task.retreat is not None:
            way = np.subtract(task.retreat.point, task.grip.point)
            assert np.allclose(way / np.linalg.norm(way), -table.axes[row][:, 2], atol=1e-5)
    assert turned  # some proposals were others
    assert any(task.action is Action.RELEASE and task.posture for task in tasks)


@pytest.fixture(scope="module")
def folder(plan, tmp_path_factory):
    out = tmp_path_factory.mktemp("plan")
    scene = plan.engine.network.scene
    seqopt.save_scene(scene, out / "scene.json")
    (out / "plan.csv").write_text(csv_text(plan.responses()), encoding="utf-8")
    return out


@pytest.mark.parametrize(("form", "name"), [("tasks", "tasks.json"), ("tasks_csv", "tasks.csv")])
def test_what_is_exported_later_has_the_same_postures(plan, folder, form, name, capsys):
    assert task_files(plan)[name] == export(plan.engine.network.scene, read_folder(folder)[1], form)
    out = folder / name
    words = ["export", str(folder), "--format", form, "--out", str(out)]
    assert main([*words, "--cache", str(folder / "postures")]) == 0
    assert capsys.readouterr().err == ""
    assert out.read_text(encoding="utf-8") == task_files(plan)[name]
    assert [*(folder / "postures").iterdir()]


@pytest.mark.parametrize("kind", [ExtraError, SceneError])
def test_an_export_without_postures_is_of_proposals(plan, folder, monkeypatch, capsys, kind):
    scene, steps = read_folder(folder)
    proposed = tasks_json(scene, plan_tasks(scene, steps))
    assert proposed != task_files(plan)["tasks.json"]  # the control

    def missing(*_):
        raise kind("arms need pinocchio and coal: pip install 'seqopt[arms]'")

    monkeypatch.setattr("seqopt.arms._kept.find_postures", missing)
    out = folder / "proposed.json"
    assert main(["export", str(folder), "--format", "tasks", "--out", str(out)]) == 0
    assert "grips are proposals without postures; arms need pinocchio" in capsys.readouterr().err
    assert out.read_text(encoding="utf-8") == proposed


@pytest.mark.slow
def test_an_export_names_steps_that_arms_cannot_be_in(folder, tmp_path, capsys):
    scene, _ = read_folder(folder)
    seqopt.save_scene(beside(scene, 0.75), tmp_path / "scene.json")
    bare = scene.with_robots(*(replace(robot, arm=None) for robot in scene.robots))
    rows = [
        {"step": s.number, "type": s.kind.value, "bricks": s.bricks}
        | {f"{n}_node": node for n, node in zip(("north", "south", "crane"), s.grips, strict=True)}
        for s in seqopt.sequential(bare)
    ]
    table = pd.DataFrame(rows).astype("Int64", errors="ignore")
    table.to_csv(tmp_path / "plan.csv", index=False)
    words = ["export", str(tmp_path), "--format", "tasks", "--out", str(tmp_path / "tasks.json")]
    assert main(words) == 0
    assert "arms cannot: " in capsys.readouterr().err


def test_bodies_are_those_that_collisions_are_looked_for_with(plan):
    """The tool ends at the node, and links are where the table of postures has them."""
    scene = plan.engine.network.scene
    for robot, own in ((r, _known_arms(scene, plan.steps)[r.name]) for r in scene.robots[:2]):
        for step, arm in zip(plan.steps, own, strict=True):
            node = step.grips[scene.robots.index(robot)]
            if node is None:
                assert len(arm.bodies) == len(idle_arm(robot.arm).bodies) >= 1
                continue
            tip = arm.bodies[-1][len(arm.bodies[-1]) // 2 :].mean(axis=0)
            np.testing.assert_allclose(tip, scene.node_position(node), atol=1e-5)
            placed = ArmModel(robot.arm).placed(arm.joints[None], np.array([0.1]))
            links = arm.bodies[-placed.low.shape[1] :][:-1]
            for k, points in enumerate(links):
                np.testing.assert_allclose(points.min(axis=0), placed.low[0, k], atol=1e-9)
                np.testing.assert_allclose(points.max(axis=0), placed.high[0, k], atol=1e-9)
