"""A limit of time, and an interrupt, wherever a command is: what is there is not lost."""

from __future__ import annotations

import json
import math
import signal
from functools import partial

import pandas as pd
import pytest

import seqopt
from seqopt._cli import outputs
from seqopt._cli.answer import answer_of
from seqopt._cli.arguments import request
from seqopt._cli.main import main
from seqopt.errors import TimeUpError
from seqopt.plan import _answers as _paths
from seqopt.plan import _states
from seqopt.sequence.schedule_file import read_plan
from seqopt.work.progress import INTERRUPT, TIME, Clock

WALL = "wall:columns=2,courses=2"
FREE = ("optimize", WALL, "--schedule", "free", "--aim", "minmax,steps")
LOOP = ("optimize", WALL, "--formulation", "overlap_dp")


def ended(words, when, how=KeyboardInterrupt):
    """Run a command that is ended as it says that it begins with something; return its answer.

    As ``how``: an interrupt, or the end of the time, which comes between two instructions too.
    """
    told = []

    def tell(what):
        told.append(str(what))
        if when in told[-1] and sum(when in each for each in told) == 1:
            raise how

    answer = answer_of(request([*map(str, words)]).result(tell))
    assert any(when in each for each in told)
    return answer


@pytest.mark.parametrize(
    ("words", "how", "status"), [(FREE, KeyboardInterrupt, 130), (LOOP, TimeoutError, 0)]
)
def test_verdicts_that_are_ended_are_left_out(tmp_path, capsys, monkeypatch, words, how, status):
    monkeypatch.setattr("seqopt.work.progress.GRACE", math.inf)
    out = tmp_path / "out"
    answer = ended([*words, "--out", out], "proving what stands", how)
    assert answer.status == status
    why = "interrupted" if status else "time is over"
    assert f"stability: not proven; {why}" in answer.notes
    assert [f for f in answer.failures if "interrupted" in f] == list(answer.failures)
    assert len(answer.failures) == bool(status)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["stability"] == {}
    assert summary["bound"]
    assert {"plan.csv", "scene.json", "report.html"} <= {path.name for path in out.iterdir()}
    assert main([*words]) == 0
    assert "not proven" not in capsys.readouterr().err


def in_the_midst(monkeypatch, module, name, how):
    """Let a function of a module end as if time were over in it."""

    def ends(*_, **__):
        raise how

    monkeypatch.setattr(module, name, ends)


@pytest.mark.parametrize(
    ("words", "module", "judge", "how", "why", "status"),
    [
        (FREE, _states, "judge_schedule", TimeoutError, TIME, 0),
        (LOOP, _paths, "judge_path", KeyboardInterrupt, INTERRUPT, 130),
    ],
)
def test_a_proof_that_is_ended_leaves_what_is_claimed(
    tmp_path, monkeypatch, words, module, judge, how, why, status
):
    whole, out = tmp_path / "whole", tmp_path / "out"
    assert main([*words, "--out", str(whole)]) == 0
    in_the_midst(monkeypatch, module, judge, how)
    monkeypatch.setattr("seqopt.work.progress.GRACE", math.inf)
    assert main([*words, "--out", str(out)]) == status
    known, found = (json.loads((f / "summary.json").read_text()) for f in (whole, out))
    assert found["objective"] == pytest.approx(known["objective"])
    assert found["bound"] == pytest.approx(known["bound"])
    assert found["left_out"] == {"the proof": why}
    assert "left_out" not in known
    assert (found["gap"], known["gap"]) == (None, 0)
    assert found["ended"] == ("interrupted" if status else "stopped")
    scene = seqopt.load_scene(out / "scene.json")
    assert read_plan(scene, out / "plan.csv") == read_plan(scene, whole / "plan.csv")


@pytest.mark.parametrize(
    "words", [LOOP, ("pareto", WALL), ("analyze", WALL, "--method", "sequential")]
)
def test_a_limit_that_is_over_at_once_is_a_line(capsys, monkeypatch, tmp_path, words):
    """Whatever comes first, and where nothing is late the same words have an answer."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("seqopt.work.progress.GRACE", 0.0)
    assert main([*words, "--time-limit", "0"]) == 4
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("seqopt: time is over: ")
    assert [*tmp_path.iterdir()] == []
    with pytest.raises(TimeUpError, match="takes longer; give more"), Clock(0.0).needed("all"):
        pass


def test_a_page_that_is_ended_is_left_out(tmp_path, monkeypatch):
    """Without its tables too a plan is there, and its folder can be read again."""
    monkeypatch.setattr("seqopt.work.progress.GRACE", math.inf)
    in_the_midst(monkeypatch, seqopt.report._pages, "plan_page", KeyboardInterrupt)
    in_the_midst(monkeypatch, outputs, "plan_files", KeyboardInterrupt)
    out = tmp_path / "out"
    assert main([*FREE, "--out", str(out)]) == 130
    assert {p.name for p in out.iterdir()} == {"plan.csv", "scene.json", "summary.json"}
    left = json.loads((out / "summary.json").read_text())["left_out"]
    assert {*left} == {"its tables", "report.html"}
    assert main(["analyze", str(out), "--out", str(tmp_path / "x.csv")]) == 0


def test_without_responses_a_plan_is_its_steps(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("seqopt.work.progress.GRACE", math.inf)
    assert main([*FREE, "--out", str(tmp_path / "whole")]) == 0
    in_the_midst(monkeypatch, seqopt.plan.build, "what_was_enough", TimeoutError)
    capsys.readouterr()
    out = tmp_path / "out"
    assert main([*FREE, "--out", str(out)]) == 0
    said, err = capsys.readouterr()
    assert "minmax" in said
    assert "not done, time is over: the responses of its steps" in err
    rows, whole = (pd.read_csv(tmp_path / f / "plan.csv") for f in ("out", "whole"))
    pd.testing.assert_frame_equal(rows, whole[[*rows.columns]])
    known, found = (
        json.loads((tmp_path / f / "summary.json").read_text()) for f in ("whole", "out")
    )
    for name in ("objective", "bound", "gap", "status", "steps"):
        assert found[name] == known[name]


def test_an_interrupted_search_of_a_pareto_set_has_the_status_of_interrupts():
    words = ("pareto", "chain:bricks=6", "--rule", "least_grips=1", "--aim", "F_largest,M_sup")
    answer = ended(words, "1 plans found")
    assert answer.status == 130
    assert not answer.facts["complete"]
    assert len(answer.facts["points"]) == 1
    with pytest.raises(KeyboardInterrupt):  # nothing is there that could be lost
        ended(words, "0 plans found")


def test_a_clock_ends_what_is_late_and_names_it():
    clock = Clock(100.0)
    assert clock.spare("a", lambda: 3, 4) == 3
    assert (clock.left_out, clock.late, 0 < clock.left <= 100.0) == ({}, False, True)
    with pytest.raises(KeyboardInterrupt), clock.needed("b"):
        signal.raise_signal(signal.SIGINT)
    assert clock.spare("b", partial(signal.raise_signal, signal.SIGINT), 4) == 4
    assert (clock.left_out, clock.interrupted) == ({"b": INTERRUPT}, True)
    assert [clock.why(stopped) for stopped in (INTERRUPT, "memory", "")] == [
        *(INTERRUPT, "memory", "")
    ]
