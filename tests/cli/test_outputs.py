"""Where the command line writes: never over its input, never two results into one file."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from seqopt._cli.main import main

PLAN = "step,type,bricks,rob1_node,rob2_node,rob3_node\n1,place,1,1,,\n"


def refused(capsys, *words):
    assert main(list(map(str, words))) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


@pytest.mark.skipif(os.name != "posix", reason="devices are POSIX's")
def test_a_device_is_no_output(capsys):
    assert "device" in refused(capsys, "scene", "--export", "/dev/null")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_an_input_is_not_overwritten(capsys, tmp_path):
    scene, plan = tmp_path / "plan.csv", tmp_path / "steps.csv"  # a scene under an output's name
    assert main(["scene", "--export", str(scene)]) == 0
    plan.write_text(PLAN, encoding="utf-8")
    capsys.readouterr()
    before = scene.read_bytes()
    for words in (
        ("scene", scene, "--export", scene),
        ("analyze", "--plan", plan, "--out", plan),
        ("analyze", scene, "--plan", plan, "--out", scene),
        ("assess", "--plan", plan, "--out", plan),
        ("optimize", scene, "--formulation", "overlap_dp", "--out", tmp_path),
    ):
        assert "it is the input" in refused(capsys, *words)
    assert scene.read_bytes() == before
    assert plan.read_text(encoding="utf-8") == PLAN
    assert len(list(tmp_path.iterdir())) == 2
