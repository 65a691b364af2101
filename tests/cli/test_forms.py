"""The three forms of an answer: text for people, paths alone, and JSON for scripts."""

from __future__ import annotations

import json
from importlib.metadata import version

import numpy as np
import pandas as pd
import pytest

from seqopt._cli.answer import plain
from tests.commands import beside_models
from tests.commands import command as run

SMALL = "chain:bricks=7"


def strict(text):
    """Parse JSON that other languages read too: no NaN, no Infinity."""

    def refuse(name):
        raise ValueError(name)

    return json.loads(text, parse_constant=refuse)


def test_json_of_other_languages_is_asked_for():
    with pytest.raises(ValueError, match="NaN"):
        strict('{"gap": NaN}')


@pytest.mark.parametrize(
    "words", [("scene", "--list"), ("assess", SMALL, "--method", "sequential")]
)
def test_json_is_one_document_with_the_same_keys_everywhere(capsys, words):
    status, out, _ = run(capsys, *words, "--json")
    found = strict(out)
    assert (found["command"], found["seqopt"]) == (words[0], version("seqopt"))
    assert (found["exit_status"], found["written"], found["failures"]) == (status, [], [])
    assert isinstance(found["notes"], list)


def test_json_of_optimize_is_its_summary_and_its_plan(capsys, tmp_path):
    words = ("optimize", SMALL, "--formulation", "overlap_dp", "--out", tmp_path / "a")
    status, out, err = run(capsys, *words, "--json")
    found = strict(out)
    assert (status, beside_models(err)) == (0, "")
    assert set(err.splitlines()) == set(found["notes"])
    assert found["proof"].endswith("no other plan is better")
    assert found["written"] == [str(tmp_path / "a")]
    stored = json.loads((tmp_path / "a" / "summary.json").read_text(encoding="utf-8"))
    assert found["summary"]["objective"] == stored["objective"]
    assert len(found["plan"]) == len(pd.read_csv(tmp_path / "a" / "plan.csv"))


def test_an_answer_that_does_not_hold_is_still_a_document(capsys):
    status, out, err = run(capsys, "assess", SMALL, "--mortar", "dry", "--json")
    found = strict(out)
    assert (status, err.count("\n")) == (1, len(found["notes"]))
    assert found["exit_status"] == 1
    assert found["verdicts"]["dry"]["does not stand"]


def test_quiet_prints_the_paths_of_what_is_written(capsys, tmp_path):
    folder, path = tmp_path / "a", tmp_path / "s.json"
    words = ("optimize", SMALL, "--formulation", "overlap_dp", "--out", folder)
    assert run(capsys, *words, "--quiet") == (0, f"{folder}\n", "")
    assert run(capsys, "report", folder, "--quiet") == (0, f"{folder / 'report.html'}\n", "")
    assert run(capsys, "scene", "--export", path, "--quiet") == (0, f"{path}\n", "")
    words = ("analyze", "--method", "cantilever", "--out", tmp_path / "c.csv")
    _, out, err = run(capsys, *words)
    over = "payload exceeded: rob2 holds up to 409.4 N, more than its payload of 392.4 N (step 47)"
    said = f"{over}\nrobots: rob3 never grips\n"
    assert (out.startswith("49 steps"), beside_models(err)) == (True, said)
    assert run(capsys, *words, "--quiet") == (0, f"{tmp_path / 'c.csv'}\n", "")


def test_values_as_json_can_hold_them():
    table = pd.DataFrame({"a": [1, 2], "b": [0.1, np.inf]})
    assert plain(table) == [{"a": 1, "b": 0.1}, {"a": 2, "b": "inf"}]
    assert plain({1: np.float64("nan"), "n": np.int64(3)}) == {"1": None, "n": 3}
    assert plain((True, None, -np.inf, np.arange(2))) == [True, None, "-inf", [0, 1]]
    assert plain(1 / 3) == 1 / 3
