"""Where the command line reads and writes: files of others, never over its input."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path

import pytest

from seqopt._cli.main import main
from seqopt.scene.scene_file import load_scene
from tests.documents import BOXES, DOCUMENTS

PLAN = "step,type,bricks,rob1_node,rob2_node,rob3_node\n1,place,1,1,,\n"


def refused(capsys, *words):
    assert main(list(map(str, words))) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


@pytest.mark.skipif(os.name != "posix", reason="devices are POSIX's")
def test_a_device_is_no_output(capsys):
    assert "device" in refused(capsys, "scene", "--export", "/dev/null")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_an_input_is_not_overwritten(capsys, tmp_path):
    scene, plan = tmp_path / "plan.csv", tmp_path / "steps.csv"  # a scene under an output's name
    assert main(["scene", "--export", str(scene)]) == 0
    plan.write_text(PLAN, encoding="utf-8")
    capsys.readouterr()
    before = scene.read_bytes()
    for words in (
        ("scene", scene, "--export", scene),
        ("analyze", "--plan", plan, "--out", plan),
        ("analyze", scene, "--plan", plan, "--out", scene),
        ("assess", "--plan", plan, "--out", plan),
        ("optimize", scene, "--formulation", "overlap_dp", "--out", tmp_path),
    ):
        assert "it is the input" in refused(capsys, *words)
    assert scene.read_bytes() == before
    assert plan.read_text(encoding="utf-8") == PLAN
    assert len(list(tmp_path.iterdir())) == 2


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "tower.json"
    path.write_text(json.dumps(DOCUMENTS["assembly"]), encoding="utf-8")
    return path


def run(*words):
    return main([str(word) for word in words])


def test_from_an_assembly_to_a_plan_and_back(source, tmp_path, capsys):
    scene, plan, back = tmp_path / "scene.json", tmp_path / "plan", tmp_path / "back.json"
    assert run("import", source, "--unit", "m", "--density", "2400", "--out", scene) == 0
    said = capsys.readouterr().out
    assert "density of 2 blocks is 2400 kg/m³, as given" in said
    assert "tower: 2 bricks, 1 joints, 1 ground ends" in said
    assert load_scene(scene).provenance in said
    assert run("optimize", scene, "--schedule", "free", "--out", plan) == 0
    assert load_scene(plan / "scene.json") == load_scene(scene)
    words = ("export", plan, "--format", "compas_assembly", "--source", source, "--out", back)
    assert run(*words) == 0
    graph = json.loads(back.read_text(encoding="utf-8"))["data"]["graph"]["data"]
    assert graph["node"]["7"]["order"] == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "does not say its unit"),
        (("--unit", "m", "--density", "1", "--gap", "0"), "--gap: '0'"),
        (("--unit", "m", "--density", "1", "--robots", "0"), "--robots 0"),
        (("--unit", "m", "--density", "1", "--supports", "x"), "there is no block 'x'"),
        (("--unit", "m", "--density", "1", "--name", "a\x1bb"), "its name is"),
    ],
)
def test_what_is_wrong_is_one_line_and_writes_nothing(source, tmp_path, capsys, words, said):
    out = tmp_path / "out.json"
    assert run("import", source, *words, "--out", out) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_inputs_are_not_overwritten(source, tmp_path, capsys):
    words = ("--unit", "m", "--density", "1")
    assert run("import", source, *words, "--out", source) == 2
    assert "it is the input" in capsys.readouterr().err
    assert json.loads(source.read_text(encoding="utf-8")) == DOCUMENTS["assembly"]
    assert run("export", tmp_path, "--out", tmp_path / "plan.csv") == 2
    assert "it is the input" in capsys.readouterr().err
    assert run("export", tmp_path, "--out", tmp_path / "x.csv") == 2
    assert "it has no scene.json" in capsys.readouterr().err


def test_options_reach_the_scene(tmp_path):
    path, out = tmp_path / "boxes.csv", tmp_path / "scene.json"
    path.write_text(BOXES, encoding="utf-8")
    words = ("--unit", "cm", "--density", "1000", "--robots", "2", "--name", "stack")
    stiff = ("--stiffness", "2e9,1e9", "--supports", "", "--gap", "0.0001")
    assert run("import", path, *words, *stiff, "--out", out) == 0
    scene = load_scene(out)
    assert (scene.name, len(scene.robots), len(scene.bricks)) == ("stack", 2, 2)
    assert scene.joints[0].translational_stiffness == pytest.approx((2e5, 1e5, 1e5))
