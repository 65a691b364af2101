"""Parts of builds, replanning and the next move on the command line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from seqopt._cli.main import main
from seqopt.scene.scene_file import load_scene, save_scene
from seqopt.sequence.schedule_file import read_plan
from tests.builders import small_arch
from tests.commands import command as run


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a plan."""
    here = tmp_path_factory.mktemp("parts")
    save_scene(small_arch(5), here / "arch.json")
    words = ["--schedule", "free", "--aim", "minmax,steps", "--no-stability", "--quiet"]
    out = here / "plan"
    assert main(["optimize", str(here / "arch.json"), *words, "--out", str(out)]) == 0
    return out


FREE = ("--schedule", "free", "--no-stability")


def test_a_build_goes_on_from_a_step_and_reads_back(capsys, folder, tmp_path):
    rest = tmp_path / "rest"
    scene = str(folder / "scene.json")
    status, *_ = run(capsys, "optimize", scene, *FREE, "--from", f"{folder}:4", "--out", str(rest))
    assert status == 0
    steps = read_plan(load_scene(scene), rest / "plan.csv")
    assert steps[0].number == 5
    for command in ("analyze", "assess"):
        plan = str(rest / "plan.csv")
        status, said, _ = run(capsys, command, scene, "--plan", plan)
        assert status == 0
        mortar = "dry," * (command == "assess")
        assert said.splitlines()[1].startswith(f"{mortar}5,")
    status, said, _ = run(capsys, "optimize", scene, *FREE, "--from", "2", "--to", "3")
    assert status == 0


@pytest.mark.slow
def test_time_goes_on_from_a_step_and_mortar_is_as_old_as_is_said(capsys, tmp_path):
    scene, out, state = (str(tmp_path / name) for name in ("arch.json", "timed", "state.csv"))
    save_scene(small_arch(4), Path(scene))
    timed = (*FREE, "--durations", "fetch=30,place=10,approach=10,grip=5,release=5")
    timed += ("--aim", "makespan", "--robots", "rob1,rob2", "--rule", "least_grips=1")
    cures = ("--stands", "epoxy", "--curing", "5min=1")
    status, *_ = run(capsys, "optimize", scene, *timed, *cures, "--out", out)
    assert status == 0
    status, said, _ = run(capsys, "replan", out, "--at", "2", "--no-stability", *cures)
    assert status == 0
    was, new = re.findall(r"makespan (\d+)", said)  # all three robots take part from there on
    assert float(new) < float(was)
    held = read_plan(load_scene(scene), Path(out) / "plan.csv")[1].grips
    rows = f"step,type,bricks,rob1_node,rob2_node,rob3_node\n2,release,2,{held[0]},{held[1]},\n"
    Path(state).write_text(rows)
    took = []
    for begin in (f"{out}:2", f"{state}:2"):
        status, said, _ = run(capsys, "optimize", scene, *timed, *cures, "--from", begin)
        assert status == 0
        took.append(float(re.search(r"makespan (\d+)", said)[1]))
    assert took[1] >= took[0] == float(was)  # just placed, as in the plan


def test_a_state_is_a_plan_of_one_step(capsys, folder, tmp_path):
    scene, state = str(folder / "scene.json"), tmp_path / "state.csv"
    node, out = load_scene(scene).placed[1].nodes[0], tmp_path / "out"
    head, begin = "step,type,bricks,rob1_node,rob2_node,rob3_node\n", ("--from", f"{state}:7")
    state.write_text(f"{head}7,release,2,{node},,\n")
    status, *_ = run(capsys, "optimize", scene, *FREE, *begin, "--out", str(out))
    assert status == 0
    assert read_plan(load_scene(out / "scene.json"), out / "plan.csv")[0].number == 8
    for row, said in (
        ("7,release,2,99,,", "line 2: step 7: rob1 at node 99: there is no such node"),
        ("7,release,99,,,", "line 2: step 7: 99 bricks; the scene has 1 to"),
    ):
        state.write_text(f"{head}{row}\n")
        status, _, err = run(capsys, "optimize", scene, *FREE, *begin)
        assert (status, err.count("\n")) == (2, 1)
        assert said in err


def test_the_rest_is_planned_anew(capsys, folder, tmp_path):
    quiet = ("--no-stability",)
    status, said, _ = run(capsys, "replan", str(folder), "--at", "3", *quiet)
    assert status == 0
    assert "the new plan is the old one" in said
    out = tmp_path / "new"
    words = ("--at", "3", "--robots", "4", "--payload", "rob1=60", "--out", str(out))
    status, said, _ = run(capsys, "replan", str(folder), *words, *quiet)
    assert status == 0
    assert "the new plan:" in said
    scene = load_scene(out / "scene.json")
    assert [robot.payload for robot in scene.robots if robot.name == "rob1"] == [60.0]
    status, _, err = run(capsys, "replan", str(folder), "--at", "3", "--lost", "rob1", *quiet)
    assert status == 3
    assert "or with one more robot that reaches every node" in err
    for wrong, said in (
        (("--at", "x"), "--at x: give a whole number from 0"),
        (("--at", "3", "--payload", "rob8=1"), "give ROBOT=NEWTON"),
        (("--at", "3", "--missing", "x"), "give the number of a brick"),
    ):
        status, _, err = run(capsys, "replan", str(folder), *wrong, *quiet)
        assert status == 2
        assert said in err
