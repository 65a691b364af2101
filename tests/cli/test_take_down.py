"""Take-downs on the command line."""

from __future__ import annotations

import json

import pytest

from seqopt.scene.scene_file import save_scene
from tests.builders import small_arch
from tests.commands import command as run


@pytest.fixture
def arch(tmp_path):
    path = tmp_path / "arch.json"
    save_scene(small_arch(5), path)
    return str(path)


DOWN = ("--schedule", "free", "--direction", "take-down")


@pytest.mark.slow
def test_a_take_down_is_written_and_read_everywhere(capsys, tmp_path, arch):
    out = tmp_path / "down"
    aim = ("--aim", "minmax,steps")
    status, said, _ = run(capsys, "optimize", arch, *DOWN, *aim, "--out", str(out))
    assert (status, "optimal" in said) == (0, True)
    assert json.loads((out / "summary.json").read_text())["rules"]["direction"] == "take-down"
    plan = ("--plan", str(out / "plan.csv"))
    assert run(capsys, "analyze", arch, *plan)[0] == 0
    status, said, _ = run(capsys, "assess", arch, *plan, "--mortar", "epoxy")
    assert (status, "nothing stands" in said) == (0, True)
    status, said, _ = run(capsys, "replan", str(out), "--at", "3")
    assert (status, "the new plan is the old one" in said) == (0, True)


def test_a_part_is_kept(capsys, tmp_path, arch):
    out = tmp_path / "part"
    status, *_ = run(capsys, "optimize", arch, *DOWN, "--to", "2", "--out", str(out))
    assert status == 0
    assert (out / "plan.csv").read_text().splitlines()[-1].split(",")[2] == "2"


PROPPED = ("--props", "5,capacity=300"), ("--props", "5,push")
CLOSE = ("--grips", "1e6", "--limit", "tolerance=1nm", "--limit", "T_max=500")


@pytest.mark.parametrize("words", [*PROPPED, CLOSE], ids=" ".join)
def test_what_limits_follow_from_the_scene_goes_with_it(capsys, tmp_path, arch, words):
    """Props that bear only so much, and a tolerance beside other limits; also planned again."""
    out = tmp_path / "propped"
    status, said, _ = run(
        capsys, "optimize", arch, *DOWN, *words, "--no-stability", "--out", str(out)
    )
    assert (status, "optimal" in said) == (0, True)
    assert (out / "plan.csv").read_text().splitlines()[-1].split(",")[2] == "0"
    assert len(json.loads((out / "summary.json").read_text())["limits"]) == (
        2 if words == CLOSE else 1
    )
    status, said, _ = run(capsys, "replan", str(out), "--at", "2", "--no-stability")
    assert (status, "optimal" in said) == (0, True)
    assert run(capsys, "analyze", str(out))[0] == 0
