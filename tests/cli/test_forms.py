"""The three forms of an answer; where the command line reads and writes."""

import json
import math
import os
import stat
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from seqopt._cli.main import main
from seqopt.arms import Arm
from seqopt.exchange._files import json_value
from seqopt.scene.parts import Sphere
from seqopt.scene.scene_file import load_scene, save_scene
from tests.commands import beside_models
from tests.commands import command as run
from tests.documents import BOXES, DOCUMENTS

SMALL = "chain:bricks=7"


def strict(text):
    """Parse JSON that other languages read too: no NaN, no Infinity."""

    def refuse(name):
        raise ValueError(name)

    return json.loads(text, parse_constant=refuse)


def test_json_of_other_languages_is_asked_for():
    with pytest.raises(ValueError, match="NaN"):
        strict('{"gap": NaN}')


@pytest.mark.parametrize(
    "words", [("scene", "--list"), ("assess", SMALL, "--method", "sequential")]
)
def test_json_is_one_document_with_the_same_keys_everywhere(capsys, words):
    status, out, _ = run(capsys, *words, "--json")
    found = strict(out)
    assert (found["command"], found["seqopt"]) == (words[0], version("seqopt"))
    assert (found["exit_status"], found["written"], found["failures"]) == (status, [], [])
    assert isinstance(found["notes"], list)


@pytest.mark.slow
def test_json_of_optimize_is_its_summary_and_its_plan(capsys, tmp_path):
    words = ("optimize", SMALL, "--formulation", "overlap_dp", "--out", tmp_path / "a")
    status, out, err = run(capsys, *words, "--json")
    found = strict(out)
    assert (status, beside_models(err)) == (0, "")
    assert set(err.splitlines()) == set(found["notes"])
    assert found["proof"].endswith("no other plan is better")
    assert found["written"] == [str(tmp_path / "a")]
    stored = json.loads((tmp_path / "a" / "summary.json").read_text(encoding="utf-8"))
    assert found["summary"]["objective"] == stored["objective"]
    assert len(found["plan"]) == len(pd.read_csv(tmp_path / "a" / "plan.csv"))


def test_an_answer_that_does_not_hold_is_still_a_document(capsys):
    status, out, err = run(capsys, "assess", SMALL, "--mortar", "dry", "--json")
    found = strict(out)
    assert (status, err.count("\n")) == (1, len(found["notes"]))
    assert found["exit_status"] == 1
    assert found["verdicts"]["dry"]["does not stand"]


@pytest.mark.slow
def test_quiet_prints_the_paths_of_what_is_written(capsys, tmp_path):
    folder, path = tmp_path / "a", tmp_path / "s.json"
    words = ("optimize", SMALL, "--formulation", "overlap_dp", "--out", folder)
    assert run(capsys, *words, "--quiet") == (0, f"{folder}\n", "")
    assert run(capsys, "report", folder, "--quiet") == (0, f"{folder / 'report.html'}\n", "")
    assert run(capsys, "scene", "--export", path, "--quiet") == (0, f"{path}\n", "")
    words = ("analyze", "--method", "cantilever", "--out", tmp_path / "c.csv")
    _, out, err = run(capsys, *words)
    over = "payload exceeded: rob2 holds up to 409.4 N, more than its payload of 392.4 N (step 47)"
    said = f"{over}\nrobots: rob3 never grips\n"
    assert (out.startswith("49 steps"), beside_models(err)) == (True, said)
    assert run(capsys, *words, "--quiet") == (0, f"{tmp_path / 'c.csv'}\n", "")


def test_values_as_json_can_hold_them():
    table = pd.DataFrame({"a": [1, 2], "b": [0.1, np.inf]})
    assert json_value(table) == [{"a": 1, "b": 0.1}, {"a": 2, "b": "inf"}]
    assert json_value({1: np.float64("nan"), "n": np.int64(3)}) == {"1": None, "n": 3}
    assert json_value((True, None, -np.inf, np.arange(2))) == [True, None, "-inf", [0, 1]]
    assert json_value(1 / 3) == 1 / 3


# where the command line reads and writes: files of others, never over its input
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
    tower = tmp_path / "tower.json"
    assert main(["scene", "--export", str(scene)]) == 0
    plan.write_text(PLAN, encoding="utf-8")
    tower.write_text(json.dumps(DOCUMENTS["assembly"]), encoding="utf-8")
    capsys.readouterr()
    before = scene.read_bytes()
    for words in (
        ("scene", scene, "--export", scene),
        ("analyze", "--plan", plan, "--out", plan),
        ("analyze", scene, "--plan", plan, "--out", scene),
        ("assess", "--plan", plan, "--out", plan),
        ("optimize", scene, "--formulation", "overlap_dp", "--out", tmp_path),
        ("import", tower, "--unit", "m", "--density", "1", "--out", tower),
        ("export", tmp_path, "--out", scene),
    ):
        assert "it is the input" in refused(capsys, *words)
    assert "it has no scene.json" in refused(capsys, "export", tmp_path, "--out", tmp_path / "x")
    assert scene.read_bytes() == before
    assert plan.read_text(encoding="utf-8") == PLAN
    assert json.loads(tower.read_text(encoding="utf-8")) == DOCUMENTS["assembly"]
    assert len(list(tmp_path.iterdir())) == 3


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "tower.json"
    path.write_text(json.dumps(DOCUMENTS["assembly"]), encoding="utf-8")
    return path


def status_of(*words):
    return main([str(word) for word in words])


def test_from_an_assembly_to_a_plan_and_back(source, tmp_path, capsys):
    scene, plan, back = tmp_path / "scene.json", tmp_path / "plan", tmp_path / "back.json"
    assert status_of("import", source, "--unit", "m", "--density", "2400", "--out", scene) == 0
    said = capsys.readouterr().out
    assert "density of 2 blocks is 2400 kg/m³, as given" in said
    assert "tower: 2 bricks, 1 joints, 1 ground ends" in said
    assert load_scene(scene).provenance in said
    assert status_of("optimize", scene, "--schedule", "free", "--out", plan) == 0
    assert load_scene(plan / "scene.json") == load_scene(scene)
    words = ("export", plan, "--format", "compas_assembly", "--source", source, "--out", back)
    assert status_of(*words) == 0
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
    assert status_of("import", source, *words, "--out", out) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_options_reach_the_scene(tmp_path):
    path, out = tmp_path / "boxes.csv", tmp_path / "scene.json"
    path.write_text(BOXES, encoding="utf-8")
    words = ("--unit", "cm", "--density", "1000", "--robots", "2", "--name", "stack")
    stiff = ("--stiffness", "2e9,1e9", "--supports", "", "--gap", "0.0001")
    assert status_of("import", path, *words, *stiff, "--out", out) == 0
    scene = load_scene(out)
    assert (scene.name, len(scene.robots), len(scene.bricks)) == ("stack", 2, 2)
    assert "no more than 100 µm apart" in " ".join(scene.provenance.split())
    assert scene.joints[0].translational_stiffness == pytest.approx((2e5, 1e5, 1e5))


def test_gaps_wider_than_blocks_are_said(capsys, tmp_path):
    path, out = tmp_path / "boxes.csv", tmp_path / "scene.json"
    path.write_text(BOXES, encoding="utf-8")
    for gap, odd in (("0.0001", False), ("5", True)):
        words = ("--unit", "cm", "--density", "1000", "--gap", gap, "--out", out)
        _, said, _ = run(capsys, "import", path, *words)
        assert ("apart, more than the thinnest block: " in " ".join(said.split())) == odd


def test_an_arm_without_its_model_is_named(capsys, tmp_path):
    wall = load_scene("wall:columns=3,courses=2")
    model = tmp_path / "no.urdf"
    arm = Arm(urdf=str(model), position=(0.0, 1.5, 0.0), tool_length=0.3, tool_radius=0.05)
    for robots in (wall.robots, (replace(wall.robots[0], arm=arm), *wall.robots[1:])):
        save_scene(wall.with_robots(*robots), tmp_path / "arm.json")
        status, _, err = run(capsys, "scene", tmp_path / "arm.json")
        said = [f"robot rob1: there is no file {model}; give a URDF, or package:path"]
        assert (status, err.splitlines()) == (0, said * (robots[0].arm is not None))


def test_robots_without_arms_reach_what_their_regions_cover(capsys, tmp_path):
    wall = load_scene("wall:columns=3,courses=2")
    near = Sphere(center=wall.bricks[0].position, radius=0.3)
    robots = (replace(wall.robots[0], reach=near), *wall.robots[1:])
    save_scene(wall.with_robots(*robots), tmp_path / "near.json")
    status, said, _ = run(capsys, "reach", tmp_path / "near.json", "--out", tmp_path / "out")
    nodes = [n for b in wall.bricks for n in b.nodes if n not in wall.blocked_nodes]
    far = [n for n in nodes if math.dist(wall.node_position(n), near.center) > near.radius]
    assert 0 < len(far) < len(nodes)
    assert status == 0
    lines = said.splitlines()
    count = len(nodes) - len(far)
    assert f"rob1: reaches {count} of {len(nodes)} nodes (0.3 m around (0, 0, 0.03))" in lines
    assert f"  never: {', '.join(map(str, far))}" in lines
    assert f"rob2: reaches {len(nodes)} of {len(nodes)} nodes (anywhere)" in lines
    table = pd.read_csv(tmp_path / "out" / "reach.csv")
    assert table[table["robot"] == "rob1"]["node"].tolist() == [n for n in nodes if n not in far]
