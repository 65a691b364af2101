"""Many problems side by side: rows as they come, what is left after an end, what has no plan."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import pandas as pd
import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.errors import ProblemError
from seqopt.sweep import sweep

WORDS = [f"wall:columns=2,courses={count}" for count in (1, 2)]
free = partial(seqopt.optimize, schedule="free", aim="F_largest,steps")


def test_every_row_is_what_one_problem_has(tmp_path):
    found = sweep(WORDS, free, mortars=["dry"], out=tmp_path / "rows.csv")
    assert [*found["problem"]] == WORDS
    for row in found.to_dict("records"):
        plan = free(row["problem"])
        assert row["F_largest"] == pytest.approx(plan.objective["F_largest"], rel=1e-8)
        assert row["F_largest_bound"] == pytest.approx(row["F_largest"], rel=1e-8)
        assert (row["steps"], row["status"]) == (len(plan.steps), "optimal")
        falls = sum(verdict.value == "does not stand" for verdict in plan.verdicts("dry"))
        assert row["falls_dry"] == falls
    stored = pd.read_csv(tmp_path / "rows.csv")
    pd.testing.assert_frame_equal(stored, found, check_dtype=False, rtol=1e-8)


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_sweep_that_was_interrupted_goes_on_where_it_ended(tmp_path, workers):
    """Rows that are there are kept as they are, the others are the same as without an end."""
    path = tmp_path / "rows.csv"
    whole = sweep(WORDS, free, out=path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], lines[1].replace("optimal", "kept"), ""]))
    again = sweep(WORDS, free, out=path, workers=workers)
    assert [*again["status"]] == ["kept", "optimal"]
    assert [*again["F_largest"]] == pytest.approx([*whole["F_largest"]], rel=1e-8)
    sweep(WORDS, lambda scene: pytest.fail("it is known"), out=path)
    other = replace(seqopt.load_scene(WORDS[0]), name="other")
    assert len(sweep([other], free, out=path)) == 1
    assert len(pd.read_csv(path)) == 3  # rows of other problems stay
    path.write_text("a,b\n1,2\n")
    with pytest.raises(ProblemError, match="no table of a sweep"):
        sweep(WORDS, free, out=path)


def test_a_problem_without_a_plan_is_a_row_that_says_why():
    scene = seqopt.load_scene(WORDS[0])
    weak = replace(scene.with_robots(*(replace(r, payload=1.0) for r in scene.robots)), name="weak")
    found = sweep([scene, weak], free)
    assert [*found["status"]] == ["optimal", "infeasible"]
    assert "it becomes possible" in found["why"][1]
    with pytest.raises(ProblemError, match="two problems are called wall 2 x 1; give scenes names"):
        sweep([scene, scene.with_grips(1e6)], free)


def told(*words):
    return main(["sweep", *words, "--schedule", "free", "--aim", "F_largest,steps"])


def test_a_command_sweeps_ranges_and_options(tmp_path, capsys):
    out = tmp_path / "s"
    words = ["wall:columns=2,courses=1..2/2", "--over", "payload=1,400", "--out", str(out)]
    assert told(*words) == 0
    assert "4 problems: 2 infeasible, 2 optimal" in capsys.readouterr().out
    rows = pd.read_csv(out / "sweep.csv")
    assert [*rows["payload"]] == [1, 400, 1, 400]
    assert [*rows["scene"]] == [word for word in WORDS for _ in range(2)]
    assert rows["F_largest"].notna().tolist() == [False, True, False, True]
    assert (out / "sweep.png").stat().st_size > 5000
    assert told(*words) == 0  # all rows are there
    assert pd.read_csv(out / "sweep.csv").equals(rows)
    assert told("wall:columns=2,courses=1", "--over", "payload=1") == 3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["wall:columns=2..x/2"], "range 2..x/2: could not convert"),
        (["arch:span=1..2/0"], "give from 1 to"),
        (["arch25", "--over", "payloads=2"], "no option payloads (did you mean payload?)"),
    ],
)
def test_ranges_that_are_none_are_refused(words, said, capsys):
    assert told(*words) == 2
    assert said in capsys.readouterr().err


def test_workers_begin_with_the_largest_of_a_range():
    """Ranges go up: else the largest problem would end alone."""
    begun = []

    def refused(own):
        begun.append(own["size"])
        raise ProblemError("too large")

    given = {f"p{size}": {"size": size} for size in (1, 2, 3, 4)}
    with ThreadPoolExecutor(1) as executor:
        found = sweep(given, refused, executor=executor)
    assert begun == [4, 3, 2, 1]
    assert [*found["size"]] == [1, 2, 3, 4]  # as they were given
    begun.clear()
    sweep(given, refused)
    assert begun == [1, 2, 3, 4]
