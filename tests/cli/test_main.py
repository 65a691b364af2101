"""The command line as a user meets it, and what its results came from."""

from __future__ import annotations

import io
import json
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from seqopt._cli.main import main
from seqopt.responses.table import analyze
from seqopt.scene.scene_file import save_scene
from seqopt.sequence.methods import sequential
from seqopt.study.published import printed_steps
from tests.builders import anywhere, from_both_ends
from tests.commands import beside_models
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
    study = printed_steps("sequential").columns[: table.shape[1] - len(ends)]
    assert list(table.columns) == [*study, *ends]
    values = analyze(engine25, sequential(engine25.network))
    for column in ("F_rob1_N", "M_sup_Nm", "D_max_1e-3mm"):
        close = 1e-5 * values[column].abs().max()
        assert (table[column] - values[column]).abs().max() <= close


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
        status, out, _ = run(capsys, "assess", "--plan", str(plan), *mortar, "--margins", "bond")
        assert status == (verdict != "stands")
        last = pd.read_csv(io.StringIO(out)).iloc[-1]
        assert last["verdict"] == verdict
        assert 600 < last["bond_needed_Pa"] < 640


def test_assess_says_what_it_cannot_decide(capsys, tmp_path, monkeypatch):
    """A solver out of time is neither 'stands' nor 'does not stand'; the table is still written."""
    monkeypatch.setattr("formulations.contact.limit_analysis.SECONDS", 1e-9)
    monkeypatch.setattr("seqopt.stability._verdict_chain.approach", lambda *_: iter(()))
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


def test_a_bad_scene_gets_one_line(capsys, tmp_path):
    path = scene_file(capsys, tmp_path, lambda d: d["bricks"][4].update(density="heavy"))
    target = tmp_path / "out.csv"
    words = ("analyze", str(path), "--method", "sequential", "--out", str(target))
    status, _, err = run(capsys, *words)
    assert (status, err.count("\n"), target.exists()) == (2, 1, False)
    assert "brick 5: density is 'heavy'; give a positive number" in err


def test_a_joint_that_is_missing_gets_one_line_beside_the_table(capsys, tmp_path):
    path, out = scene_file(capsys, tmp_path, lambda d: d["joints"].pop(3)), tmp_path / "out.csv"
    words = ("analyze", str(path), "--method", "sequential", "--out", str(out))
    status, _, err = run(capsys, *words)
    (line,) = (line for line in err.splitlines() if line.startswith("seqopt: "))
    assert (status, "nothing resists a motion of brick" in line) == (3, True)
    assert pd.read_csv(out)["finding"].notna().any()


def test_a_time_limit_ends_with_a_choice_and_a_trace(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("seqopt.work.progress.GRACE", math.inf)  # choosing alone is late
    words = ("--formulation", "overlap_dp", "--time-limit", "0", "--no-stability")
    words = (*words, "--out", str(tmp_path / "a"))
    assert main(["optimize", "arch25", *words]) == 0
    found = json.loads((tmp_path / "a" / "summary.json").read_text(encoding="utf-8"))
    assert (found["ended"], found["status"]) == ("stopped", "feasible")
    trace = pd.read_csv(tmp_path / "a" / "trace.csv")
    assert list(trace.columns) == ["seconds", "objective", "bound", "gap"]
    assert trace["objective"].iloc[-1] == pytest.approx(found["objective"]["sum"], rel=1e-5)
    assert trace["bound"].iloc[-1] <= found["bound"]["sum"]
    assert main(["optimize", "arch25", *words[:2], "--time-limit", "soon"]) == 2
    assert "--time-limit: 'soon' is not a positive number or zero" in capsys.readouterr().err


@pytest.mark.slow
def test_a_comparison_with_speed(tmp_path, capsys):
    out, words = tmp_path / "speed", ("compare", "wall:columns=2,courses=2", "--no-stability")
    status, said, _ = run(capsys, *words, "--speed", "20", "--out", out)
    block = said.split("Speed against regret\n")[1].split("written to")[0]
    assert (status, max(map(len, block.splitlines())) <= 80) == (0, True)
    rows = pd.read_csv(out / "speed.csv")
    assert {"compliance", "frame"} <= {*rows["engine"]}
    assert {"loop", "free"} == {*rows["schedule"]}
    sentence = " ".join(block.partition("\n\n")[0].split())
    assert sentence.startswith("Take ")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert f'alt="{sentence}"' in page
    assert page.count("data:image/png;base64,") == 1
    assert (out / "speed.png").exists()
    assert "speed" not in json.loads(run(capsys, *words, "--json")[1])
