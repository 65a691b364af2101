"""The command ``assess``; a limit of time."""

import json
import math
import signal
from functools import partial
from unittest.mock import Mock

import pandas as pd
import pytest

import seqopt
from seqopt._cli.arguments import request
from seqopt._cli.main import main
from seqopt.errors import TimeUpError
from seqopt.exchange.schedules import read_plan
from seqopt.plan import _answers
from seqopt.scene.scene_file import load_scene, save_scene
from seqopt.work import INTERRUPT, TIME, Clock
from tests.builders import with_part

ARCH = "arch:span=1,rise=0.4,pattern=VLR"
WORDS = ["assess", ARCH, "--method", "sequential", "--mortar", "dry"]


@pytest.mark.slow
def test_without_a_mortar_both_answers_are_given(capsys, tmp_path):
    """It said that every step stands, by an epoxy of 3 MPa that nobody had named."""
    out = tmp_path / "both.csv"
    assert main(["assess", ARCH, "--method", "sequential", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    table = pd.read_csv(out)
    own = {name: each["verdict"].value_counts() for name, each in table.groupby("mortar")}
    falls = own["dry"]["does not stand"]
    assert own["epoxy"].to_dict() == {"stands": 17}
    assert f"dry: 17 steps: {17 - falls} stand, {falls} do not stand" in said
    assert "with epoxy: 17 steps: 17 stand, 0 do not stand" in said
    assert main([*WORDS[:-1], "epoxy", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [*found["verdicts"]] == [*found["mortar"]] == ["epoxy"]
    assert main([*WORDS, "--out", str(out)]) == 1  # what is asked alone decides
    assert set(pd.read_csv(out)["mortar"]) == {"dry"}
    network = seqopt.build_network(load_scene(ARCH))
    steps = seqopt.sequential(network)
    both = [seqopt.assess(network, steps, mortar) for mortar in ("dry", "epoxy")]
    assert [e.verdict.value for each in both for e in each] == table["verdict"].tolist()


@pytest.mark.parametrize(
    ("fall", "said"),
    [(-0.005, "leaves their balance"), pytest.param(-0.5, "not small", marks=pytest.mark.slow)],
)
def test_a_movement_of_the_ground_is_said_to_enter_no_verdict(capsys, tmp_path, fall, said):
    """It was left out without a word; of ground at rest nothing is said."""
    scene = load_scene(ARCH)
    down = with_part(scene, "grounds", 1, movement=(0.0, 0.0, fall))
    save_scene(down, path := tmp_path / "settled.json")
    words = [str(path), "--method", "sequential", "--out", str(tmp_path / "x.csv")]
    assert main(["assess", *words]) == 0
    start = (
        f"stability: the movement of 1 ground end, up to {-1e3 * fall:.4g} mm, enters no verdict"
    )
    err = capsys.readouterr().err
    assert start in err
    assert said in err
    any_range = ["--rule", "payload=ignored", "--limit", "linear_range=any"]
    assert main(["optimize", str(path), "--schedule", "free", *any_range]) == 0
    assert start in capsys.readouterr().err
    assert main(["assess", ARCH, *words[1:]]) == 0
    assert "movement" not in capsys.readouterr().err


# a limit of time, and an interrupt, wherever a command is: what is there is not lost
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

    answer = request([*map(str, words)]).answer(tell)
    assert any(when in each for each in told)
    return answer


@pytest.mark.parametrize(
    ("words", "hows"),
    [(FREE, {TimeoutError: 0}), (LOOP, {TimeoutError: 0, KeyboardInterrupt: 130})],
)
def test_a_proof_that_is_ended_leaves_what_is_claimed(tmp_path, monkeypatch, words, hows):
    whole = tmp_path / "whole"
    assert main([*words, "--out", str(whole)]) == 0
    monkeypatch.setattr("seqopt.work.GRACE", math.inf)
    for how, status in hows.items():
        out = tmp_path / str(status)
        monkeypatch.setattr(_answers, "judge_schedule", Mock(side_effect=how))
        assert main([*words, "--out", str(out)]) == status
        known, found = (json.loads((f / "summary.json").read_text()) for f in (whole, out))
        assert found["objective"] == pytest.approx(known["objective"])
        assert found["bound"] == pytest.approx(known["bound"])
        assert (found["gap"], known["gap"]) == (None, 0)
        assert found["ended"] == ("interrupted" if status else "stopped")
        scene = seqopt.load_scene(out / "scene.json")
        assert read_plan(scene, out / "plan.csv") == read_plan(scene, whole / "plan.csv")
        if not status:  # verdicts, tables and page are made although the time is over
            assert {path.name for path in whole.iterdir()} == {path.name for path in out.iterdir()}
            assert {*found["stability"]} == {"dry", "epoxy"}


@pytest.mark.parametrize("words", [LOOP, ("pareto", WALL), ("instance", WALL)])
def test_a_limit_that_is_over_at_once_is_a_line(capsys, monkeypatch, tmp_path, words):
    """Whatever comes first, and where nothing is late the same words have an answer."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("seqopt.work.GRACE", 0.0)
    assert main([*words, "--time-limit", "0"]) == 4
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("seqopt: time is over: ")
    assert [*tmp_path.iterdir()] == []
    with pytest.raises(TimeUpError, match="takes longer; give more"), Clock(0.0).needed("all"):
        pass


def test_what_is_interrupted_keeps_what_is_there_and_has_a_status_of_its_own(tmp_path):
    for words in (LOOP, ("pareto", WALL)):
        answer = ended((*words, "--out", tmp_path / words[0]), "proving what stands")
        assert (answer.status, "stability: not proven; interrupted" in answer.notes) == (130, True)
    words = ("pareto", "chain:bricks=6", "--rule", "least_grips=1", "--aim", "F_largest,M_sup")
    answer = ended(words, "1 plans found")
    assert answer.status == 130
    assert not answer.facts["complete"]
    assert len(answer.facts["points"]) == 1
    with pytest.raises(KeyboardInterrupt):  # nothing is there that could be lost
        ended(words, "0 plans found")


def test_a_clock_ends_what_is_late_and_says_why(monkeypatch):
    clock = Clock(100.0)
    assert clock.tried(lambda: 3) == (3, "")
    assert (clock.late, 0 < clock.left <= 100.0) == (False, True)
    with pytest.raises(KeyboardInterrupt), clock.needed("b"):
        signal.raise_signal(signal.SIGINT)
    assert clock.tried(partial(signal.raise_signal, signal.SIGINT)) == (None, INTERRUPT)
    monkeypatch.setattr("seqopt.work.GRACE", 0.0)
    assert Clock(0.0).tried(lambda: 3) == (None, TIME)
    assert [clock.why(stopped) for stopped in (INTERRUPT, "memory", "")] == [
        *(INTERRUPT, "memory", "")
    ]
