"""Plans over scenarios on the command line."""

from __future__ import annotations

import json
import math

import pandas as pd
import pytest

from seqopt._cli.main import main
from seqopt._cli.outputs import _plain
from seqopt.scene.scene_file import save_scene
from tests.builders import six_bricks
from tests.commands import beside_models


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "six.json"
    save_scene(six_bricks(), path)
    return path


def optimize(capsys, tmp_path, scene, *words):
    """Exit status, standard output and standard error of one command."""
    try:
        status = main(["optimize", str(scene), *words, "--out", str(tmp_path / "out")])
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    return status, out, err


@pytest.mark.parametrize("aim", ["worst-peak", "worst-total", "cvar=0.5"])
def test_a_plan_over_scenarios_is_written(capsys, tmp_path, scene, aim):
    words = ("--robust", aim, "--scenarios", "4", "--seed", "5")
    more = ("--criteria", "weighted-published", "--vary", "stiffness=2", "--vary", "position=0")
    status, out, err = optimize(capsys, tmp_path, scene, *words, *more)
    assert (status, beside_models(err)) == (0, "")
    assert f"({aim})" in out
    assert "optimal over 4 scenarios" in out
    folder = tmp_path / "out"
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["scenarios"] == {
        "count": 4,
        "stiffness": [0.5, 2.0],
        "density": 0.1,
        "position_m": 0.0,
        "seed": 5,
    }
    assert summary["aims"] == [aim]
    assert summary["status"].endswith("optimal")
    assert summary["bound"][aim] <= summary["objective"][aim]
    steps = ("analyze", str(scene), "--plan", str(folder / "plan.csv"))
    assert main(list(steps)) == 0  # it can be read as a plan
    assert len(pd.read_csv(folder / "selection.csv")) > 0


def test_numbers_that_are_not_finite_are_null():
    report = {"a": {"b": math.inf, "c": 1.5}, "d": [1], "e": math.nan}
    assert _plain(report) == {"a": {"b": None, "c": 1.5}, "d": [1], "e": None}
