"""Every command that computes postures keeps them in a folder, and takes them from there."""

from __future__ import annotations

import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.arms import _tables
from seqopt.arms._tables import _known
from tests.arms.boxes import beside_a_wall, boxes

pytest.importorskip("pinocchio")
pytest.importorskip("coal")

FREE = ("--schedule", "free", "--rule", "least_grips=0", "--rule", "newest=free")


@pytest.fixture
def folder(tmp_path, monkeypatch, capsys):
    """A plan of a wall with an arm; commands run beside it, in processes without any posture."""
    monkeypatch.chdir(tmp_path)
    scene = beside_a_wall(boxes(tmp_path / "arm.urdf"), faces=("thickness",))
    seqopt.save_scene(scene, "s.json")
    assert main(["optimize", "s.json", *FREE, "--aim", "steps", "--out", "plan"]) == 0
    capsys.readouterr()
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        ["report", "plan", "--no-stability"],
        ["replan", "plan", "--no-stability"],
        ["export", "plan", "--format", "tasks"],
        ["reach", "s.json"],
    ],
)
def test_postures_are_kept_and_taken(folder, words, monkeypatch):
    _known.cache_clear()
    assert main([*words, "--cache", "kept"]) == 0
    assert [*(folder / "kept").glob("postures-*.npz")]
    _known.cache_clear()
    monkeypatch.setattr(_tables, "_compute_table", lambda *_: pytest.fail("computed again"))
    assert main([*words, "--cache", "kept"]) == 0
