"""The free schedule and Pareto sets on the command line."""

from __future__ import annotations

import json
import re

import pandas as pd
import pytest

from seqopt.scene.scene_file import load_scene, save_scene
from seqopt.sequence.schedule_file import read_plan
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


def test_more_robots_come_with_their_scene(capsys, tmp_path, arch):
    out = tmp_path / "out"
    words = ["--robots", "4", "--rule", "ending=one-by-one", "--rule", "regrips=1"]
    status, *_ = run(capsys, "optimize", arch, "--schedule", "free", *words, "--out", str(out))
    assert status == 0
    scene = load_scene(out / "scene.json")
    assert [robot.name for robot in scene.robots][3:] == ["rob4"]
    steps = read_plan(scene, out / "plan.csv")
    assert steps[-1].held == ()
    assert len(steps[-2].held) == 1


@pytest.mark.slow
def test_states_that_must_stand(capsys, tmp_path, arch):
    out = tmp_path / "out"
    words = ["--stands", "dry", "--tilt", "2", "--aim", "steps,minmax"]
    status, *_ = run(capsys, "optimize", arch, "--schedule", "free", *words, "--out", str(out))
    assert status == 0
    rows = pd.read_csv(out / "stability.csv")
    assert set(rows["verdict"]) == {"stands"}
    assert rows["tilt_survived_deg"].min() >= 2
    said = json.loads((out / "summary.json").read_text())["stands"]
    assert said["tilt_deg"] == pytest.approx(2)
    assert (said["cohesion_Pa"], said["undecided"]) == (0, 0)


@pytest.mark.long
@pytest.mark.slow
def test_the_margin_search_plan_is_in_degrees(capsys, tmp_path, arch):
    out = tmp_path / "out"
    words = ["--stands", "dry", "--aim", "tilt"]
    status, said, _ = run(capsys, "optimize", arch, "--schedule", "free", *words, "--out", str(out))
    assert status == 0
    tilt = json.loads((out / "summary.json").read_text())["objective"]["tilt"]
    assert f"tilt {tilt:.6g}" in said
    assert tilt <= pd.read_csv(out / "stability.csv")["tilt_survived_deg"].min() + 0.1


def test_a_free_schedule_within_a_budget(capsys, tmp_path, arch):
    out = tmp_path / "out"
    words = ("--schedule", "free", "--budget", "regrips=0", "--budget", "travel=9m")
    status, text, error = run(capsys, "optimize", arch, *words, "--out", str(out))
    assert (status, beside_models(error)) == (0, "")
    assert ", optimal" in text
    summary = json.loads((out / "summary.json").read_text())
    assert summary["budgets"]["regrips"] == {"bound": 0, "spent": 0, "price": None}
    assert summary["budgets"]["travel"]["spent"] <= 9
    assert summary["objective"]["travel"] <= 9


def test_a_free_schedule_over_scenarios(capsys, tmp_path, arch):
    out = tmp_path / "out"
    words = ("--schedule", "free", "--robust", "worst-peak", "--scenarios", "3")
    status, text, error = run(capsys, "optimize", arch, *words, "--out", str(out))
    assert (status, beside_models(error)) == (0, "")
    assert text.splitlines()[0].endswith(", optimal")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["scenarios"]["count"] == 3


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


def test_pareto_writes_table_plans_and_chart(capsys, tmp_path, arch):
    out = tmp_path / "front"
    words = ["--aim", "F_largest,M_sup", "--round", "M_sup=0.5", "--pick", "M_sup"]
    status, said, _ = run(
        capsys, "pareto", arch, *words, "--under", "F_largest=1000", "--out", str(out)
    )
    assert status == 0
    table = pd.read_csv(out / "pareto.csv")
    assert f"{len(table)} points, complete; picked row" in said
    plans = pd.read_csv(out / "plans.csv")
    assert {*plans["point"]} == {*table["point"]}
    for point, rows in plans.groupby("point"):
        largest = rows[[c for c in rows if c.startswith("F_rob")]].abs().max().max()
        row = table[table["point"] == point].iloc[0]
        assert largest == pytest.approx(row["F_largest"], rel=1e-5)
        assert rows["M_sup_Nm"].max() <= row["M_sup"] * (1 + 1e-5)
    assert (out / "pareto.png").read_bytes()[:4] == b"\x89PNG"
    picked = read_plan(load_scene(arch), out / "pick" / "plan.csv")
    whole = {"plan.csv", "scene.json", "summary.json", "tasks.csv", "tasks.json", "report.html"}
    assert {path.name for path in (out / "pick").iterdir()} == whole
    assert len(picked) == table["steps"][table["M_sup"].argmin()]


def test_figures_that_cannot_be_drawn_are_left_out_and_it_says_so(
    capsys, monkeypatch, tmp_path, arch
):
    """Without the extra that draws: tables and the page are written all the same."""
    asked = ("pareto", arch, "--aim", "F_largest,steps")
    assert run(capsys, *asked, "--out", str(tmp_path / "drawn"))[0] == 0
    monkeypatch.setattr("seqopt._cli.outputs.find_spec", lambda name: None)
    status, _, error = run(capsys, *asked, "--out", str(tmp_path / "plain"))
    assert (status, error.count("\n")) == (0, 1)
    assert "figures are left out, they need matplotlib" in error
    drawn, plain = ({f.name for f in (tmp_path / n).iterdir()} for n in ("drawn", "plain"))
    assert drawn - plain == {"pareto.png", "pareto.svg"}
    assert "report.html" in plain


@pytest.mark.slow
def test_pareto_of_a_loop_and_bounds_of_what_is_picked(capsys, tmp_path, arch):
    out = ["--out", str(tmp_path / "front")]
    loop = ["--schedule", "three-robot", "--aim", "F_largest,T_max"]
    status, said, _ = run(capsys, "pareto", arch, *loop, *out)
    assert status == 0
    assert "complete; --pick D_max also writes" in said
    words = ["--aim", "F_largest,M_sup,T_max,D_max", "--pick", "steps", "--under", "D_max=1"]
    status, said, error = run(capsys, "pareto", arch, *words, *out)
    assert "picked row" in said or "no plan of the set is below all bounds" in error
    status, _, error = run(capsys, "pareto", arch, "--pick", "steps", "--under", "magic", *out)
    assert status == 2
    assert "--under magic" in error
    status, _, error = run(capsys, "pareto", arch, *loop, "--rule", "regrips=0", *out)
    assert status == 2
    assert "only the free schedule has them; give --schedule free" in error


def test_the_best_order_is_written_with_its_scene(capsys, tmp_path, arch):
    out = tmp_path / "out"
    words = ["--schedule", "free", "--order", "search", "--aim", "F_largest,steps"]
    status, said, _ = run(capsys, "optimize", arch, *words, "--out", str(out))
    assert status == 0
    assert re.match(
        r"largest force [0-9.]+ N \(.* of payload\), .*; F_largest .*, optimal, no", said
    )
    assert "\norder_search (exact): 10 steps, " in said
    summary = json.loads((out / "summary.json").read_text())
    scene = load_scene(out / "scene.json")
    assert [*scene.build_order] == summary["order"] != [*load_scene(arch).build_order]
    assert summary["order_bound"] == pytest.approx(summary["objective"]["F_largest"])
    assert len(read_plan(scene, out / "plan.csv")) == summary["steps"]


@pytest.mark.parametrize("scene", ["wall:columns=2,courses=2", "chain:bricks=8"])
def test_one_robot_gets_one_advice_that_works(capsys, scene):
    asked = ("optimize", scene, "--schedule", "free", "--robots", "1")
    status, _, err = run(capsys, *asked)
    assert status == 3
    advice = re.search(r"\((--rule [^)]*)\)$", err.strip())[1].split()
    assert run(capsys, *asked, *advice)[0] == 0


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
