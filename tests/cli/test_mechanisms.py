"""A step that is a mechanism is said to be one, beside the steps that are none."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import seqopt
from seqopt._cli.answer import Status
from seqopt._cli.commands.analyze import _fault, _status_of
from seqopt.errors import MechanismError, SolverError
from seqopt.scene.scene_file import load_scene, save_scene
from tests.builders import hinged
from tests.commands import command

ARCH = "arch:span=1,rise=0.4,pattern=VLR"
DRY = ("--engine", "discrete", "--mortar", "dry")


def first_steps(path, count):
    """Write the first steps of the sequential method as a plan."""
    scene = load_scene(ARCH)
    rows = [f"step,type,bricks,{','.join(f'{robot.name}_node' for robot in scene.robots)}"]
    for step in seqopt.sequential(seqopt.build_network(scene))[:count]:
        nodes = ",".join("" if node is None else str(node) for node in step.grips)
        rows.append(f"{step.number},{step.kind.value},{step.bricks},{nodes}")
    path.write_text("\n".join([*rows, ""]), encoding="utf-8")
    return path


def test_what_flies_apart_is_no_displacement(capsys, tmp_path):
    """It was a displacement of 1,119 km, with the advice of stiffer joints, and status 0."""
    words = (ARCH, "--plan", first_steps(tmp_path / "plan.csv", 3))
    out = tmp_path / "out.csv"
    status, said, err = command(capsys, "analyze", *words, *DRY, "--out", out)
    assert status == 3
    assert "stiffer" not in said + err
    assert "3 steps, 1 of them mechanisms, written to" in said
    assert "seqopt: mechanism: 1 of 3 steps (step 2); step 2: 2 bricks: joints open or" in err
    table = pd.read_csv(out, keep_default_na=False).set_index("step")
    brick = err.partition("slip and brick ")[2].split()[0]
    assert table["finding"].tolist() == ["", f"mechanism (brick {brick})", ""]
    responses = table.loc[:, "F_sup_N":"D_std_1e-3mm"]
    assert (responses.loc[2] == "").all()
    assert responses["D_max_1e-3mm"].drop(2).astype(float).max() < 6e3
    assert command(capsys, "analyze", *words, "--engine", "discrete", "--out", out)[0] == 0


@pytest.mark.parametrize("engine", ["frame", "auto"])
def test_every_engine_goes_on_after_a_mechanism(capsys, tmp_path, engine):
    """It ended at the first one, and said nothing of the steps after it."""
    save_scene(hinged(load_scene(ARCH), 2), path := tmp_path / "hinge.json")
    words = ("analyze", path, "--method", "sequential", "--engine", engine)
    status, out, _ = command(capsys, *words, "--json")
    found = json.loads(out)
    cells = {row["step"]: row["finding"] for row in found["steps"]}
    wrong = [step for step, cell in cells.items() if cell.startswith("mechanism (brick")]
    assert (status, len(cells)) == (3, 17)
    assert wrong
    assert max(wrong) < 17
    assert all((row["D_max_1e-3mm"] is None) == (row["step"] in wrong) for row in found["steps"])
    assert found["failures"][0].startswith(f"seqopt: mechanism: {len(wrong)} of 17 steps")
    tied = ("analyze", ARCH, "--method", "sequential", "--engine", engine, "--json")
    status, out, _ = command(capsys, *tied)
    assert status == 0
    assert "finding" not in json.loads(out)["steps"][0]


def test_a_failed_solver_is_a_mechanism_only_where_one_is_proven():
    network = seqopt.build_network(load_scene(ARCH))
    steps, failed = seqopt.sequential(network), SolverError("step: not at rest")
    verdicts = [found.verdict.value for found in seqopt.assess_steps(network, steps, "dry")]
    falls, stands = steps[verdicts.index("does not stand")], steps[verdicts.index("stands")]
    dry = seqopt.make_engine("discrete", network, seqopt.DRY)
    found = _fault(dry, falls, failed)
    assert isinstance(found, MechanismError)
    assert "a motion proves that it falls" in str(found)
    assert np.abs([motion for _, motion in found.mode]).max() > 0
    assert _fault(dry, stands, failed) is failed
    bonded = seqopt.make_engine("discrete", network, seqopt.EPOXY)
    assert _fault(bonded, falls, failed) is failed
    assert _status_of({1: found}) is Status.NO_ANSWER
    assert _status_of({1: found, 2: failed}) is Status.FAILED
    loose = seqopt.build_network(hinged(load_scene(ARCH), 2))
    elastic = seqopt.make_engine("frame", loose)
    kinds = {type(_fault(elastic, step, failed)) for step in seqopt.sequential(loose)}
    assert kinds == {MechanismError, SolverError}


def test_where_every_step_is_one_there_is_still_a_table(capsys, tmp_path):
    scene = load_scene(ARCH)
    ground = replace(scene.grounds[0], rotational_stiffness=(0.0, 0.0, 0.0))
    path, grounds = tmp_path / "hinge.json", (ground, *scene.grounds[1:])
    save_scene(replace(scene, grounds=grounds), path)
    plan = first_steps(tmp_path / "plan.csv", 1)
    status, out, _ = command(capsys, "analyze", path, "--plan", plan, "--json")
    found = json.loads(out)
    assert (status, [row["finding"] for row in found["steps"]]) == (3, ["mechanism (brick 1)"])
    assert "seqopt: mechanism: every step (step 1)" in found["failures"][0]
