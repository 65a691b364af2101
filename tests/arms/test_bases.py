"""Where bases stand: the best plan of all sets, and what bounds skip."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pandas as pd
import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.arms._bases import choose_bases, facing, grid, without_arms
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.sequence.schedule_file import read_plan
from tests.arms.scenes import beside, two_arms

for extra in ("pinocchio", "coal", "compas_fab"):
    pytest.importorskip(extra)


@pytest.fixture(scope="module")
def scene():
    """Two arms without a crane: where they stand decides what can be built."""
    found = two_arms()
    return found.with_robots(*found.robots[:2])


def posed(scene, aim):
    engine = seqopt.make_engine("compliance", without_arms(scene))
    rules, criterion = seqopt.FreeRules(least_grips=1), seqopt.CRITERIA["worst-ratio"]
    return seqopt.pose(engine, rules, criterion, aim)


@pytest.mark.parametrize("aim", ["steps", pytest.param("sum(D_max)", marks=pytest.mark.slow)])
def test_the_best_of_all_sets_is_found(scene, aim):
    x, y, _ = scene.robots[0].arm.position
    at = [(x + 0.75, y, 0.0), (x, -y, 0.0), (40.0, 0.0, 0.0), (x + 1.1, y, 0.0)]
    places = {"south": [facing(scene, each) for each in at]}
    problem = posed(scene, aim)
    found = choose_bases(problem, scene, places, partial(seqopt.solve))
    values = []
    for base in places["south"]:
        one = {"south": [base]}
        try:
            values.append(choose_bases(problem, scene, one, seqopt.solve).plan.objective[aim])
        except InfeasibleError:
            values.append(float("inf"))
    assert found.proven
    assert found.plan.objective[aim] == pytest.approx(min(values), rel=1e-9)
    assert values[2] > min(values)
    rows = found.tried.set_index("south")
    assert len(rows) == 4
    for base, value in zip(places["south"], values, strict=True):
        row = rows.loc[str(base)]
        assert row[aim] <= value * (1 + 1e-9)  # bounds are bounds
        if row["outcome"] == "solved":
            assert row[aim] == pytest.approx(value, rel=1e-9)
    assert found.problem.scene.robots[1].arm.position in at
    assert "no set allows a better plan" in found.said


def test_no_set_is_a_line(scene):
    places = {"south": [facing(scene, (40.0, 0.0, 0.0))], "north": [facing(scene, (0, 30, 0))]}
    with pytest.raises(InfeasibleError, match=r"none of 1 sets .*: nobody reaches brick 1; give"):
        choose_bases(posed(scene, "steps"), scene, places, seqopt.solve)


def test_a_grid_goes_around_the_bricks(scene):
    places = grid(scene)
    assert {*places} == {"north", "south"}
    assert len(places["north"]) > 4
    for base in places["north"]:
        x, y, z = base.position
        away = min(
            ((b.position[0] - x) ** 2 + (b.position[1] - y) ** 2) ** 0.5 for b in scene.bricks
        )
        assert 0.5 < away < 2.5
        assert z == pytest.approx(0.0)
        to = [
            sum(b.position[k] for b in scene.bricks) / len(scene.bricks) - p
            for k, p in ((0, x), (1, y))
        ]
        assert base.x_axis[0] * to[0] + base.x_axis[1] * to[1] == pytest.approx(
            (to[0] ** 2 + to[1] ** 2) ** 0.5
        )
    assert len(grid(scene, 0.5)["north"]) > len(places["north"])


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.json"
    seqopt.save_scene(two_arms(), path)
    return str(path)


def test_reach_on_the_command_line(capsys, tmp_path, file):
    out, cache = tmp_path / "reach", tmp_path / "postures"
    assert main(["reach", file, "--out", str(out), "--cache", str(cache)]) == 0
    said = capsys.readouterr().out
    assert "north: reaches" in said
    assert "written to" in said
    table = pd.read_csv(out / "reach.csv")
    assert len(table) == 20
    assert len(pd.read_csv(out / "postures.csv")) <= table["postures"].sum()
    assert len([*cache.iterdir()]) == 1
    assert main(["reach", "arch25"]) == 0
    assert "no robot of arch25 has an arm" in capsys.readouterr().out


def test_given_plans_are_checked_on_the_command_line(capsys, tmp_path):
    path = tmp_path / "mine.json"
    seqopt.save_scene(beside(two_arms(), 0.75), path)
    plan = tmp_path / "plan.csv"
    steps = seqopt.sequential(without_arms(two_arms()))
    rows = [
        {"step": s.number, "type": s.kind.value, "bricks": s.bricks}
        | {f"{n}_node": node for n, node in zip(("north", "south", "crane"), s.grips, strict=True)}
        for s in steps
    ]
    pd.DataFrame(rows).astype("Int64", errors="ignore").to_csv(plan, index=False)
    assert read_plan(seqopt.load_scene(path), plan) == steps
    words = ["analyze", str(path), "--plan", str(plan), "--out", str(tmp_path / "r.csv")]
    assert main(words) == 0
    said = capsys.readouterr().err
    assert "arms: " in said
    assert "in each other's way (step" in said
    assert main([*words, "--strict"]) == 1
    assert "arms cannot: " in capsys.readouterr().err


def test_bases_on_the_command_line(capsys, tmp_path, file):
    places = tmp_path / "bases.csv"
    places.write_text("robot,x,y,z,heading_deg\nsouth,1.0,-1.3,0,90\nsouth,40,0,,\n")
    out = tmp_path / "out"
    words = ["optimize", file, "--schedule", "free", "--no-stability"]
    assert main([*words, "--bases", str(places), "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "bases: north at (" in said.out
    assert "arms: all postures are kept" in said.err
    assert seqopt.load_scene(out / "scene.json").robots[1].arm.position == (1.0, -1.3, 0.0)
    assert len(pd.read_csv(out / "bases.csv")) == 2


@pytest.mark.parametrize(
    ("words", "text", "said"),
    [
        (["--schedule", "three-robot", "--bases", "grid"], "", "goes with --schedule free"),
        (["--schedule", "free", "--bases", "grid:no"], "", "'no' is not a positive number"),
        (["--schedule", "free", "--bases", "FILE"], "robot,x\n", "give a CSV file with columns"),
        (
            ["--schedule", "free", "--bases", "FILE"],
            "robot,x,y\nsauth,1,2\n",
            "did you mean south?",
        ),
        (
            ["--schedule", "free", "--bases", "FILE"],
            "robot,x,y\nsouth,1,two\n",
            "'two' is not a number",
        ),
    ],
)
def test_wrong_bases_are_a_line(capsys, tmp_path, file, words, text, said):
    (tmp_path / "bases.csv").write_text(text)
    given = [str(tmp_path / "bases.csv") if word == "FILE" else word for word in words]
    assert main(["optimize", file, *given]) == 2
    assert said in capsys.readouterr().err


def test_too_many_sets_are_refused(scene):
    some = [facing(scene, (3.0 + 0.01 * i, 1.0, 0.0)) for i in range(120)]
    with pytest.raises(ProblemError, match="give fewer places"):
        choose_bases(posed(scene, "steps"), scene, {"north": some, "south": some}, seqopt.solve)


@pytest.mark.slow
def test_bases_of_arms_that_give_way_are_all_solved(scene):
    """Robots without arms hold otherwise, so no bound of theirs skips a set."""
    joints = (2e6, 2e6, 1e6, 5e5, 4e5, 2e5)
    arms = (replace(robot.arm, joint_stiffness=joints) for robot in scene.robots)
    pairs = zip(scene.robots, arms, strict=True)
    soft = scene.with_robots(*(replace(robot, arm=arm) for robot, arm in pairs))
    x, y, _ = soft.robots[0].arm.position
    at = [(x + 0.75, y, 0.0), (x, -y, 0.0), (x + 1.1, y, 0.0)]
    places = {"south": [facing(soft, each) for each in at]}
    found = choose_bases(posed(soft, "D_max"), soft, places, seqopt.solve)
    values = []
    for base in places["south"]:
        moved = soft.robots[1].arm
        own = {"position": base.position, "x_axis": base.x_axis, "y_axis": base.y_axis}
        there = soft.with_robots(soft.robots[0], replace(soft.robots[1], arm=replace(moved, **own)))
        try:
            plan = seqopt.optimize(there, "free", aim="D_max", rules="least_grips=1")
        except InfeasibleError:
            continue
        values.append(plan.objective["D_max"])
    assert found.plan.objective["D_max"] == pytest.approx(min(values), rel=1e-9)
    assert len(values) > 1
    assert max(values) > 1.01 * min(values)
    assert not found.tried["outcome"].str.startswith("skipped").any()
