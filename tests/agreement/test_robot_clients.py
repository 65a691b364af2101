"""Tasks and plans opened by those who read them: COMPAS, compas_fab, pandas."""

import io
import re

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from seqopt._cli.main import main
from seqopt.exchange._tasks import FRAMES, plan_tasks
from seqopt.exchange.exports import export
from seqopt.network.network import build_network
from seqopt.sequence.methods import METHODS
from tests.builders import ROOT, six_bricks

compas = pytest.importorskip("compas")
SCENE = six_bricks()
STEPS = METHODS["cantilever"](build_network(SCENE), ())
TASKS = [*plan_tasks(SCENE, STEPS)]


def opened(form, **more):
    return compas.json_loads(export(SCENE, STEPS, form, **more))


def same(theirs, mine):
    if mine is None:
        return theirs is None
    axes = [theirs.xaxis, theirs.yaxis, theirs.zaxis]
    return np.allclose(theirs.point, mine.point, atol=1e-8) and np.allclose(
        axes, mine.axes, atol=1e-8
    )


def test_compas_has_frames_and_meshes():
    from compas.geometry import Frame, Transformation  # noqa: PLC0415

    found = opened("tasks")
    assert len(found["tasks"]) == len(TASKS)
    for theirs, mine in zip(found["tasks"], TASKS, strict=True):
        assert all(same(theirs[name], getattr(mine, name)) for name in FRAMES)
        assert (theirs["action"], theirs["robot"]) == (mine.action.value, mine.robot)
        if mine.block_frame is not None:  # their own way from the block to the world
            world = Transformation.from_frame(theirs["block_frame"])
            there = Frame.from_transformation(
                world * Transformation.from_frame(theirs["grip_in_block"])
            )
            assert same(there, mine.grip)
    for block, brick in zip(found["blocks"], SCENE.placed, strict=True):
        assert block["shape"].volume() * brick.density == pytest.approx(block["mass"])
        assert list(block["shape"].centroid()) == pytest.approx(list(block["frame"].point))
    assert not same(found["tasks"][1]["grip"], TASKS[1].block_frame)  # the control


@pytest.mark.slow
def test_the_page_for_compas_fab_runs_and_prints_what_it_says(tmp_path, monkeypatch, capsys):
    """Its own inverse kinematics takes our targets."""
    pytest.importorskip("compas_fab")
    page = (ROOT / "docs/guides/driving.md").read_text("utf-8")
    code, said = re.search(r"```py\n(.*?)```\n\n```text\n(.*?)```", page, re.DOTALL).groups()
    monkeypatch.chdir(tmp_path)
    words = "optimize arch25 --schedule free --aim minmax --out best"
    assert main(words.split()) == 0
    assert main(["export", "best", "--format", "tasks", "--out", "tasks.json"]) == 0
    capsys.readouterr()
    exec(compile(code, "page", "exec"), {})
    assert capsys.readouterr().out == said


def test_pandas_has_a_row_for_every_task():
    table = pd.read_csv(io.StringIO(export(SCENE, STEPS, "tasks_csv")))
    assert [*table["action"]] == [task.action.value for task in TASKS]
    for name in FRAMES:
        known = [getattr(task, name) for task in TASKS]
        rows = table[
            [f"{name}_{end}" for end in ("x", "y", "z", "qx", "qy", "qz", "qw")]
        ].to_numpy()
        for row, frame in zip(rows, known, strict=True):
            assert np.isnan(row).all() == (frame is None)
            if frame is not None:
                np.testing.assert_allclose(row[:3], frame.point, atol=1e-8)
                turned = Rotation.from_quat(row[3:]).as_matrix().T
                np.testing.assert_allclose(turned, frame.axes, atol=1e-7)
