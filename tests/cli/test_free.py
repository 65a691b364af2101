"""The free schedule; parts of builds."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from seqopt._cli.main import main
from seqopt.exchange.schedules import read_plan
from seqopt.scene.scene_file import load_scene, save_scene
from tests.builders import small_arch
from tests.commands import beside_models
from tests.commands import command as run


@pytest.fixture
def arch(tmp_path):
    path = tmp_path / "arch.json"
    save_scene(small_arch(5), path)
    return str(path)


def test_optimize_writes_a_plan_that_reads_back(capsys, tmp_path, arch):
    out = tmp_path / "out"
    status, said, _ = run(
        capsys, "optimize", arch, "--schedule", "free", "--aim", "minmax,steps", "--out", str(out)
    )
    assert status == 0
    assert "optimal" in said
    summary = json.loads((out / "summary.json").read_text())
    assert summary["status"] == "optimal"
    assert summary["bound"] == pytest.approx(summary["objective"])
    assert summary["scales"]["F_largest"] > 0  # from the scene's own methods
    steps = read_plan(load_scene(arch), out / "plan.csv")
    assert len(steps) == summary["steps"] == summary["objective"]["steps"]
    assert load_scene(out / "scene.json") == load_scene(arch)


@pytest.mark.slow
def test_a_loop_by_its_states(capsys, tmp_path, arch):
    """Aims, limits and standing go with schedules of open grips too."""
    out = tmp_path / "out"
    words = ("--aim", "minmax,travel", "--stands", "bond=1e5", "--candidates", "near:4")
    status, text, error = run(capsys, "optimize", arch, *words, "--out", str(out))
    assert (status, beside_models(error)) == (0, "")
    assert text.splitlines()[0].endswith(", optimal")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["aims"] == ["minmax", "travel"]
    assert summary["stands"]["tensile_strength_Pa"] == 1e5
    assert (pd.read_csv(out / "stability.csv")["verdict"] == "stands").all()


@pytest.mark.slow
def test_pareto_writes_table_plans_and_chart(capsys, tmp_path, arch):
    out = tmp_path / "front"
    words = ["--aim", "F_largest,M_sup", "--round", "M_sup=0.5"]
    status, said, _ = run(capsys, "pareto", arch, *words, "--out", str(out))
    assert status == 0
    table = pd.read_csv(out / "pareto.csv")
    many = "s" * (len(table) != 1)
    assert f"{len(table)} point{many}, complete; written to {out}; " in said
    plans = pd.read_csv(out / "plans.csv")
    assert {*plans["point"]} == {*table["point"]}
    for point, rows in plans.groupby("point"):
        largest = rows[[c for c in rows if c.startswith("F_rob")]].abs().max().max()
        row = table[table["point"] == point].iloc[0]
        assert largest == pytest.approx(row["F_largest"], rel=1e-5)
        assert rows["M_sup_Nm"].max() <= row["M_sup"] * (1 + 1e-5)
    assert (out / "pareto.png").read_bytes()[:4] == b"\x89PNG"
    assert load_scene(out / "scene.json") == load_scene(arch)


@pytest.mark.slow
def test_the_best_order_is_written_with_its_scene(capsys, tmp_path, arch):
    out = tmp_path / "out"
    words = ["--schedule", "free", "--order", "search", "--aim", "F_largest,steps"]
    status, said, _ = run(capsys, "optimize", arch, *words, "--out", str(out))
    assert status == 0
    assert re.match(
        r"largest force [0-9.]+ N; payloads used .*; displacement .*; F_largest .*, optimal, no",
        said,
    )
    assert "\norder_search (exact): 10 steps, " in said
    summary = json.loads((out / "summary.json").read_text())
    scene = load_scene(out / "scene.json")
    assert [*scene.build_order] == summary["order"] != [*load_scene(arch).build_order]
    assert summary["bound"]["F_largest"] == pytest.approx(summary["objective"]["F_largest"])
    assert len(read_plan(scene, out / "plan.csv")) == summary["steps"]


def test_one_robot_gets_one_advice_that_works(capsys):
    asked = ("optimize", "wall:columns=2,courses=2", "--schedule", "free", "--robots", "1")
    status, _, err = run(capsys, *asked)
    assert status == 3
    advice = re.search(r"\((--rule [^)]*)\)$", err.strip())[1].split()
    assert run(capsys, *asked, *advice)[0] == 0


@pytest.mark.slow
def test_one_robot_has_nothing_to_compare(capsys, tmp_path):
    """What needs two is named, and by which rules one builds; with two nothing is left out."""
    scene = "wall:columns=2,courses=2"
    status, _, err = run(capsys, "compare", scene, "--robots", "1", "--out", str(tmp_path / "c"))
    assert status == 2
    assert "this method needs two" in err
    assert "--rule newest=free" in err
    status, out, _ = run(capsys, "compare", scene, "--robots", "2", "--no-stability")
    assert status == 0
    assert "not possible here" not in out


DOWN = ("--schedule", "free", "--direction", "take-down")
PROPPED = ("--props", "5,capacity=300")
CLOSE = ("--grips", "1e6", "--limit", "tolerance=1nm", "--limit", "T_max=500")


@pytest.mark.slow
def test_a_take_down_is_written_and_read_everywhere(capsys, tmp_path, arch):
    out = tmp_path / "down"
    aim = ("--aim", "minmax,steps")
    status, said, _ = run(capsys, "optimize", arch, *DOWN, *aim, "--out", out)
    assert (status, "optimal" in said) == (0, True)
    assert json.loads((out / "summary.json").read_text())["rules"]["direction"] == "take-down"
    plan = ("--plan", out / "plan.csv")
    assert run(capsys, "analyze", arch, *plan)[0] == 0
    status, said, _ = run(capsys, "assess", arch, *plan, "--mortar", "epoxy")
    assert (status, "nothing stands" in said) == (0, True)
    status, said, _ = run(capsys, "replan", out, "--at", "3")
    assert (status, "the new plan is the old one" in said) == (0, True)


@pytest.mark.slow
@pytest.mark.parametrize("words", [PROPPED, CLOSE], ids=" ".join)
def test_what_limits_follow_from_the_scene_goes_with_it(capsys, tmp_path, arch, words):
    """Props that bear only so much, and a tolerance beside other limits; also planned again."""
    out, quick = tmp_path / "propped", "--no-stability"
    status, said, _ = run(capsys, "optimize", arch, *DOWN, *words, quick, "--out", out)
    assert (status, "optimal" in said) == (0, True)
    assert (out / "plan.csv").read_text().splitlines()[-1].split(",")[2] == "0"
    limits = json.loads((out / "summary.json").read_text())["limits"]
    assert len(limits) == (2 if words == CLOSE else 1)
    status, said, _ = run(capsys, "replan", out, "--at", "2", quick)
    assert (status, "optimal" in said) == (0, True)
    assert run(capsys, "analyze", out)[0] == 0


def test_samples_alone_ask_for_the_worst_peak(capsys, arch):
    status, out, _ = run(capsys, "optimize", arch, "--scenarios", "3", "--no-stability")
    assert (status, "over 3 scenarios (worst-peak)" in out) == (0, True)


@pytest.mark.parametrize("aim", [pytest.param("worst-peak", marks=pytest.mark.slow), "cvar=0.5"])
def test_a_plan_over_scenarios_is_written(capsys, tmp_path, arch, aim):
    words = ("--robust", aim, "--scenarios", "4", "--seed", "5", "--out", tmp_path)
    more = ("--criterion", "weighted-published", "--vary", "stiffness=2", "--vary", "position=0")
    status, out, err = run(capsys, "optimize", arch, *words, *more)
    assert (status, beside_models(err)) == (0, "")
    assert f"({aim})" in out
    assert "optimal over 4 scenarios" in out
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    goal = "minmax" if aim == "worst-peak" else aim
    drawn = {"count": 4, "stiffness": [0.5, 2.0], "density": 0.1, "position_m": 0.0, "seed": 5}
    assert (summary["scenarios"], summary["aims"]) == (drawn, [goal])
    assert summary["status"].endswith("optimal")
    assert summary["bound"][goal] <= summary["objective"][goal]
    assert run(capsys, "analyze", arch, "--plan", tmp_path / "plan.csv")[0] == 0


# parts of builds, replanning and the next move on the command line
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


@pytest.mark.slow
def test_a_build_goes_on_from_a_step_and_reads_back(capsys, folder, tmp_path):
    rest = tmp_path / "rest"
    scene = str(folder / "scene.json")
    status, *_ = run(capsys, "optimize", scene, *FREE, "--from", f"{folder}:4", "--out", str(rest))
    assert status == 0
    steps = read_plan(load_scene(scene), rest / "plan.csv")
    assert steps[0].number == 5
    for command in ("analyze", "assess"):
        plan = str(rest / "plan.csv")
        status, said, _ = run(capsys, command, scene, "--plan", plan, "--quiet")
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


@pytest.mark.slow
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
