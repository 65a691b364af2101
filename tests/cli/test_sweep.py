"""Many problems side by side: ranges, rows as they come, what is left after an end, the chart."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pandas as pd
import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.errors import ProblemError
from seqopt.report.charts import draw_sweep
from seqopt.sweep import _spread_values, _spread_words, sweep

ASKED = ["--schedule", "free", "--aim", "F_largest,steps", "--no-stability"]
free = partial(seqopt.optimize, schedule="free", aim="F_largest,steps")


def told(*words):
    return main(["sweep", *words, *ASKED])


def without_time(path):
    return pd.read_csv(path, dtype=str).drop(columns="seconds")


def test_every_row_is_what_one_problem_has(tmp_path, capsys):
    out = tmp_path / "s"
    assert (
        told("wall:columns=2,courses=1..2/2", "--over", "payload=300..500/2", "--out", str(out))
        == 0
    )
    assert "4 problems: 4 optimal" in capsys.readouterr().out
    rows = pd.read_csv(out / "sweep.csv")
    assert list(zip(rows["courses"], rows["payload"], strict=True)) == [
        (courses, payload) for courses in (1, 2) for payload in (300, 500)
    ]
    for _, row in rows.iterrows():
        plan = free(f"wall:columns=2,courses={row['courses']:.0f}")
        assert row["F_largest"] == pytest.approx(plan.objective["F_largest"], rel=1e-8)
        assert row["F_largest_bound"] == pytest.approx(row["F_largest"], rel=1e-8)
        assert (row["steps"], row["status"]) == (len(plan.steps), "optimal")
    assert (out / "sweep.png").stat().st_size > 5000


@pytest.mark.parametrize("workers", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_a_sweep_that_was_interrupted_goes_on_where_it_ended(tmp_path, workers):
    """Rows that are there are kept as they are, the others are the same as without an end."""
    whole, part = tmp_path / "whole", tmp_path / "part"
    words = ["wall:columns=2,courses=1..3/3", "--out"]
    assert told(*words, str(whole)) == 0
    assert told(*words, str(part)) == 0
    lines = (part / "sweep.csv").read_text().splitlines()
    lines[1] = lines[1].replace("optimal", "kept")
    (part / "sweep.csv").write_text("\n".join([*lines[:3], ""]))
    assert told(*words, str(part), "--workers", workers) == 0
    expected, found = without_time(whole / "sweep.csv"), without_time(part / "sweep.csv")
    assert found["status"][0] == "kept"
    pd.testing.assert_frame_equal(found.iloc[1:], expected.iloc[1:])


def test_a_problem_without_a_plan_is_a_row_that_says_why(capsys):
    assert told("wall:columns=2,courses=1..2/2", "--over", "payload=1,400") == 0
    rows = capsys.readouterr().out
    assert rows.count("infeasible") == 2
    assert rows.count("optimal") == 2
    assert told("wall:columns=2,courses=1..2/2", "--over", "payload=1") == 3


def test_ranges_are_even_or_in_proportion():
    assert _spread_values("0..1/3") == ("0", "0.5", "1")
    assert _spread_values("1e3..1e9/3log") == ("1000", "1000000", "1000000000")
    assert _spread_values("1..12,25..13") == ("1..12,25..13",)  # an order of bricks is no range
    with pytest.raises(ProblemError, match="of a log range above 0"):
        _spread_values("0..1/3log")
    assert _spread_words("arch25") == [({"scene": "arch25"}, "arch25")]


def test_scenes_of_ones_own_and_any_function(tmp_path):
    scenes = [seqopt.load_scene(f"wall:columns=2,courses={count}") for count in (1, 2)]
    path = tmp_path / "rows.csv"
    found = sweep(scenes, free, mortars=["dry"], out=path)
    again = sweep(scenes, lambda scene: pytest.fail("it is known"), mortars=["dry"], out=path)
    assert list(found["scene"]) == [scene.name for scene in scenes]
    assert {*found["falls_dry"]} <= {*range(20)}
    assert list(again["F_largest"]) == pytest.approx(list(found["F_largest"]), rel=1e-8)
    with pytest.raises(ProblemError, match="it has columns scene, not courses"):
        sweep("wall:columns=2,courses=1..2/2", free, out=path)
    other = sweep([replace(scenes[0], name="other")], free, mortars=["dry"], out=path)
    assert len(other) == 1
    assert len(pd.read_csv(path)) == 3  # rows of other problems stay
    with pytest.raises(ProblemError, match="two problems are called wall 2 x 1; give scenes names"):
        sweep([scenes[0], scenes[0].with_grips(1e6)], free)


def test_the_chart_has_a_line_for_every_value_and_crosses_where_there_is_no_plan():
    rows = [
        {"span": f"{s}", "rise": f"{r}", "T_max": None if s == r else 1.0 * s + r, "T_max_bound": 0}
        for s in range(3)
        for r in range(2)
    ]
    (axes,) = draw_sweep(pd.DataFrame(rows), ["span", "rise"]).axes
    assert len(axes.lines) == 3  # two lines, and crosses of no plan
    assert axes.get_xlabel() == "span"


def test_without_matplotlib_the_chart_is_left_out_and_it_says_so(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("seqopt._cli.outputs.find_spec", lambda name: None)
    assert told("wall:columns=2,courses=2", "--out", str(tmp_path)) == 0
    assert "figures are left out" in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {"sweep.csv", "sweep.json"}
