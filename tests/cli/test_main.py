"""The command line as a user meets it; a step that is a mechanism is said to be one."""

import io
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import seqopt
from seqopt._cli.answer import Status
from seqopt._cli.commands.analyze import _status_of
from seqopt._cli.main import main
from seqopt.errors import MechanismError, SolverError
from seqopt.responses._faults import _fault
from seqopt.responses.quantities import RESPONSES
from seqopt.responses.table import analyze
from seqopt.scene.scene_file import load_scene, save_scene
from seqopt.sequence.methods import sequential
from seqopt.study import printed_steps
from tests.builders import anywhere, from_both_ends, hinged, on_soft_ground
from tests.commands import beside_models, command
from tests.commands import command as run


@pytest.mark.slow
def test_compare(capsys, monkeypatch):
    """In 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")
    status, out, _ = run(capsys, "compare")
    assert status == 0
    assert "three-robot" in out
    assert "paper" in out
    assert "406.1 (406.0)!" in out  # of the sequential method, the paper's beside; over the payload
    assert "114.6 (114.4)" in out
    assert "step 47" in out
    assert "22" in out
    assert "- sequential: rob3 never grips\n" in out
    assert "the sequential method here" not in out
    assert [line for line in out.splitlines() if len(line) > 80] == []


def test_compare_says_what_is_not_possible(capsys, tmp_path):
    path = tmp_path / "short.json"
    save_scene(replace(from_both_ends(3), robots=anywhere(3)), path)
    folder = tmp_path / "out"
    status, out, _ = run(capsys, "compare", str(path), "--out", str(folder))
    assert status == 0
    assert "cantilever" in out
    assert "Loop of robots: not possible here; " in out
    assert "<td>cantilever</td>" in (folder / "report.html").read_text("utf-8")
    assert "cantilever" in (folder / "comparison.csv").read_text("utf-8")


def scene_file(capsys, tmp_path, change):
    path = tmp_path / "scene.json"
    assert run(capsys, "scene", "--export", str(path))[0] == 0
    document = json.loads(path.read_text(encoding="utf-8"))
    change(document)
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_analyze_writes_the_columns_of_table_a1(capsys, tmp_path, engine25):
    path = tmp_path / "out.csv"
    arguments = ("analyze", "--method", "sequential", "--engine", "frame", "--out", str(path))
    status, out, _ = run(capsys, *arguments)
    assert (status, out.count("\n")) == (0, 1)
    table = pd.read_csv(path)
    ends = ["F_sup_1_N", "M_sup_1_Nm", "F_sup_25_N", "M_sup_25_Nm"]
    own = [each.column for each in RESPONSES.values()]
    study = [c for c in printed_steps("sequential").columns if c in table.columns]
    assert list(table.columns) == [*study, *(c for c in own if c not in study), *ends]
    assert {"F_rob3_N", "F_sup_N", "D_std_1e-3mm"} <= {*study}
    values = analyze(engine25, sequential(engine25.network))
    for column in ("F_rob1_N", "M_sup_Nm", "D_max_1e-3mm"):
        close = 1e-5 * values[column].abs().max()
        assert (table[column] - values[column]).abs().max() <= close


@pytest.mark.slow
def test_robots_by_name_and_those_that_never_grip(capsys, tmp_path):
    words = ("--schedule", "two-robot", "--robots", "rob3,rob1", "--formulation", "overlap_dp")
    status, _, err = run(capsys, "optimize", *words, "--no-stability", "--out", str(tmp_path))
    assert (status, beside_models(err)) == (0, "robots: rob2 never grips\n")
    report = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert (report["schedule"], report["idle_robots"]) == ("two-robot", ["rob2"])
    assert report["models_paper_count"] is None
    status, out, err = run(capsys, "analyze", "--method", "sequential", "--robots", "rob3, rob2")
    over = "payload exceeded: rob2 holds up to 406.1 N, more than its payload of 392.4 N (step 47)"
    assert (status, beside_models(err)) == (0, f"{over}\nrobots: rob1 never grips\n")
    first = pd.read_csv(io.StringIO(out)).iloc[0]
    assert first["rob3_node"] == 1
    assert np.isnan(first["rob2_node"])
    assert beside_models(run(capsys, "analyze", "--method", "published")[2]) == ""


def test_assess_a_plan_with_a_mortar_of_ones_own(capsys, tmp_path):
    """The bond that a step needs is what makes it stand."""
    plan = tmp_path / "plan.csv"
    rows = ["step,type,bricks,rob1_node,rob2_node,rob3_node", "1,place,1,1,,", "2,place,2,1,2,"]
    rows += ["3,release,2,1,,"]
    plan.write_text("\n".join(rows) + "\n", encoding="utf-8")
    for strength, verdict in (("600", "does not stand"), ("640", "stands")):
        mortar = ("--mortar", f"bond={strength}")
        words = ("assess", "--plan", str(plan), *mortar, "--margins", "bond")
        status, out, _ = run(capsys, *words, "--quiet")
        assert status == (verdict != "stands")
        last = pd.read_csv(io.StringIO(out)).iloc[-1]
        printed = run(capsys, *words)[1].splitlines()
        assert printed[0].startswith(f"with bond={strength}: 3 steps")
        assert [line.split()[1] for line in printed[3:6]] == ["1", "2", "3"]
        assert last["verdict"] == verdict
        assert 600 < last["bond_needed_Pa"] < 640


def test_assess_says_what_it_cannot_decide(capsys, tmp_path, monkeypatch):
    """A solver out of time is neither 'stands' nor 'does not stand'; the table is still written."""
    monkeypatch.setattr("formulations.contact.limit_analysis.SECONDS", 1e-9)
    monkeypatch.setattr("seqopt.stability._steps.approach", lambda *_: iter(()))
    plan, out = tmp_path / "plan.csv", tmp_path / "out.csv"
    plan.write_text(
        "step,type,bricks,rob1_node,rob2_node,rob3_node\n1,place,1,1,,\n", encoding="utf-8"
    )
    words = ("--plan", str(plan), "--out", str(out), "--margins", "all")
    status, text, err = run(capsys, "assess", *words)
    assert (status, err.count("\n")) == (4, 1)
    assert "step 1: undecided" in err
    assert "1 are undecided" in text
    row = pd.read_csv(out).iloc[0]
    assert row["verdict"] == "undecided"
    assert row["stalled"] == 2 * row["unproven"] > 0
    assert np.isnan(row["bond_needed_Pa"])


def test_a_joint_that_is_missing_gets_one_line_beside_the_table(capsys, tmp_path):
    path, out = scene_file(capsys, tmp_path, lambda d: d["joints"].pop(3)), tmp_path / "out.csv"
    words = ("analyze", str(path), "--method", "sequential", "--out", str(out))
    status, _, err = run(capsys, *words)
    (line,) = (line for line in err.splitlines() if line.startswith("seqopt: "))
    assert (status, "nothing resists a motion of brick" in line) == (3, True)
    assert pd.read_csv(out)["finding"].notna().any()


@pytest.mark.slow
def test_a_time_limit_ends_a_search_whose_choices_are_in_a_trace(tmp_path, capsys):
    words = ("--formulation", "labels", "--budget", "travel=0.9", "--no-stability")
    words = (*words, "--out", str(tmp_path / "a"))
    small = ("optimize", "chain:bricks=8", *words)
    assert main([*small, "--time-limit", "0"]) == 4
    assert "time is over: no plan was found yet; give more" in capsys.readouterr().err
    assert main([*small, "--time-limit", "3600"]) == 0
    found = json.loads((tmp_path / "a" / "summary.json").read_text(encoding="utf-8"))
    assert (found["ended"], found["status"]) == ("done", "optimal")
    trace = pd.read_csv(tmp_path / "a" / "trace.csv")
    assert list(trace.columns) == ["seconds", "objective", "bound", "gap"]
    assert trace["objective"].iloc[-1] == pytest.approx(found["objective"]["sum"], rel=1e-5)
    assert trace["bound"].iloc[-1] <= found["bound"]["sum"]
    assert main([*small, "--time-limit", "soon"]) == 2
    assert "--time-limit: 'soon' is not a positive number or zero" in capsys.readouterr().err


@pytest.mark.slow
def test_a_comparison_with_speed(tmp_path, capsys):
    out, words = tmp_path / "speed", ("compare", "wall:columns=2,courses=2", "--mortar", "dry")
    status, said, _ = run(capsys, *words, "--speed", "20", "--out", out)
    block = said.split("Speed against regret\n")[1].split("written to")[0]
    assert (status, max(map(len, block.splitlines())) <= 80) == (0, True)
    assert "valued by compliance, where every step stands," in " ".join(block.split())
    rows = pd.read_csv(out / "speed.csv")
    assert {"compliance", "frame", "discrete"} <= {*rows["engine"]}
    assert {"loop", "free"} == {*rows["schedule"]}
    sentence = " ".join(block.partition("\n\n")[0].split())
    page = (out / "report.html").read_text(encoding="utf-8")
    assert f'alt="{sentence}"' in page
    assert (sentence[:5], page.count("data:image/png;base64,")) == ("Take ", 1)
    assert (out / "speed.png").exists()
    assert "speed" not in json.loads(run(capsys, *words, "--json")[1])


# a step that is a mechanism is said to be one, beside the steps that are none
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


@pytest.mark.slow
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
    verdicts = [found.verdict.value for found in seqopt.assess(network, steps, "dry")]
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
    save_scene(on_soft_ground(scene, 0.0), path := tmp_path / "hinge.json")
    plan = first_steps(tmp_path / "plan.csv", 1)
    status, out, _ = command(capsys, "analyze", path, "--plan", plan, "--json")
    found = json.loads(out)
    assert (status, [row["finding"] for row in found["steps"]]) == (3, ["mechanism (brick 1)"])
    assert "seqopt: mechanism: every step (step 1)" in found["failures"][0]
