"""The plans of four arms on the page of examples, opened by those who would drive them."""

import json
import re
from dataclasses import fields, is_dataclass, replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from experiments.exchange.four_arms import EXAMPLES, SCENES
from experiments.harness.scenes import read_folder
from seqopt.errors import StepError
from seqopt.exchange.schedules import parse_plan
from seqopt.scene.scene_file import dump_scene, load_scene
from tests.builders import ROOT


def content(name, file):
    return (EXAMPLES / name / file).read_text(encoding="utf-8")


@pytest.fixture(scope="module", params=SCENES)
def build(request):
    return request.param, *read_folder(EXAMPLES / request.param)


def test_files_are_of_one_plan(build):
    name, scene, steps = build
    told = json.loads(content(name, "tasks.json"))["tasks"]
    table = pd.read_csv(EXAMPLES / name / "tasks.csv")
    assert [row["action"] for row in told] == [*table["action"]]
    for row, joints in zip(told, table.filter(like="joint_").to_numpy(), strict=True):
        assert (row["posture"] is None) == np.isnan(joints).all() == (row["action"] == "pick")
        np.testing.assert_allclose(row["posture"] or joints, joints, atol=1e-8)
    known = [[row["step"], row["robot"], row["node"]] for row in told if row["action"] != "release"]
    for step in steps:
        held = {(r.name, n) for r, n in zip(scene.robots, step.grips, strict=True) if n is not None}
        assert held == {(robot, node) for at, robot, node in known if at == step.number}


def test_a_spoiled_plan_is_no_plan(build):
    """The control of what is read."""
    name, scene, _ = build
    lines = content(name, "plan.csv").splitlines(keepends=True)
    with pytest.raises(StepError):
        parse_plan(scene, "".join([*lines[:3], *lines[4:]]), name)


def near(one, other):
    """Whether two values agree in all but what processors round their own way."""
    if isinstance(one, float):
        return one == pytest.approx(other, rel=1e-12, abs=1e-12)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(near, one, other))
    if is_dataclass(one):
        pairs = ((getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
        return type(one) is type(other) and all(near(*pair) for pair in pairs)
    return one == other


def test_scenes_are_those_that_are_generated(build, tmp_path):
    name, scene, _ = build
    made = SCENES[name]()
    assert near(scene, made)
    first, *others = scene.joints
    softer = replace(first, position=tuple(x + 1e-9 for x in first.position))
    assert not near(replace(scene, joints=(softer, *others)), made)  # the control
    (tmp_path / "again.json").write_text(dump_scene(scene), encoding="utf-8")
    assert load_scene(tmp_path / "again.json") == scene


@pytest.mark.slow
def test_compas_fab_takes_the_arms_of_the_tasks_there():
    """A cell of compas_fab puts the flange where the task has it, by its own kinematics."""
    kinematics = pytest.importorskip("compas_fab.backends.kinematics.solvers")
    from compas.geometry import Frame  # noqa: PLC0415

    compas = pytest.importorskip("compas")
    scene, _ = read_folder(EXAMPLES / "wall")
    solver, far = kinematics.ABB_IRB4600_40_255Kinematics(), 0
    robots = {robot.name: robot for robot in scene.robots}
    for task in compas.json_load(EXAMPLES / "wall" / "tasks.json")["tasks"]:
        if task["posture"] is None:
            continue
        arm = robots[task["robot"]].arm
        base = Frame(arm.position, arm.x_axis, arm.y_axis)
        flange = base.to_world_coordinates(solver.forward(task["posture"]))
        tool = np.array(flange.point) + arm.tool_length * np.array(task["grip"].zaxis)
        np.testing.assert_allclose(tool, task["grip"].point, atol=2e-3)
        far += np.abs(np.array(flange.point) - task["grip"].point).max() > 0.1
    assert far


@pytest.mark.slow
def test_no_step_has_a_contact_by_another_library(build):
    """MuJoCo has its own kinematics and its own collisions; joints are those of the tasks."""
    for extra in ("pinocchio", "compas_fab", "mujoco"):
        pytest.importorskip(extra)
    from tests.arms.witness import Site  # noqa: PLC0415

    name, scene, steps = build
    tasks = pd.read_csv(EXAMPLES / name / "tasks.csv")
    arms = {robot.name: robot.arm for robot in scene.robots}
    outside = [
        arms[row.robot].tool_length - row.depth - arms[row.robot].fingers
        for row in tasks.itertuples()
    ]
    table = SimpleNamespace(joints=tasks.filter(like="joint_").to_numpy(), tools=np.array(outside))
    site = Site(scene, table)
    held = tasks[~tasks["action"].isin(["pick", "release"])]
    for step in steps:
        rows = held[held["step"] == step.number]
        assert (
            site.touching(dict(zip(rows["robot"], rows.index, strict=True)), step.bricks) == set()
        )
    robot, row = held["robot"].iloc[0], held.index[0]
    table.joints[row, 1] += 1.0  # the control: an arm that reaches into the ground
    assert site.touching({robot: row}, len(scene.bricks)) != set()


def test_the_page_prints_what_it_says(monkeypatch, capsys):
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    code, said = re.search(
        r"```python\n(.*?)```\n\nThat prints:\n\n```text\n(.*?)```", page, re.DOTALL
    ).groups()
    monkeypatch.chdir(EXAMPLES / "wall")
    exec(compile(code, "page", "exec"), {})
    assert capsys.readouterr().out == said


def test_the_page_names_files_that_are_there():
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    named = re.findall(r"[<(](examples/four_arms/[^>)]+)[>)]", page)
    files = {str(path.relative_to(ROOT / "docs")) for path in EXAMPLES.rglob("*.*")}
    assert {*named} == files
    for name in SCENES:
        with Image.open(EXAMPLES / name / "film.gif") as film:
            assert film.n_frames == len(read_folder(EXAMPLES / name)[1])
