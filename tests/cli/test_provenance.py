"""What results came from: every summary names engine, reason, criterion with numbers, versions."""

from __future__ import annotations

import json
import platform
from importlib.metadata import version

import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.scene.scene_file import save_scene
from tests.builders import small_arch


@pytest.fixture
def arch(tmp_path):
    path = tmp_path / "arch.json"
    save_scene(small_arch(5), path)
    return str(path)


WRITES = {
    "loop": ("optimize",),
    "free": ("optimize", "--schedule", "free"),
    "order": ("optimize", "--schedule", "free", "--order", "search"),
    "robust": ("optimize", "--robust", "worst-peak", "--scenarios", "2"),
    "pareto": ("pareto", "--aim", "F_largest,steps"),
    "compare": ("compare", "--criteria", "worst-ratio"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITES)
def test_every_summary_says_what_it_came_from(capsys, tmp_path, arch, name):
    command, *words = WRITES[name]
    assert main([command, arch, *words, "--out", str(tmp_path / "out")]) == 0
    found = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    engine = found["engine"]
    assert (engine["name"], engine["reason"]) == ("auto", "the default")
    assert engine["level"]["engine"] == "compliance"
    for package in ("seqopt", "numpy", "scipy", "pandas", "highspy", "clarabel"):
        assert found["versions"][package] == version(package)
    assert found["versions"]["python"] == platform.python_version()
    if name == "compare":
        assert {*found["criteria"]} == {"three-robot", "free"}
        for criterion in found["criteria"].values():
            assert criterion["criterion"] == "worst-ratio"
            assert all(scale > 0 for scale in criterion["scales"].values())
    elif name == "pareto":
        assert (found["criterion"], found["aims"]) == (None, ["F_largest", "steps"])
    elif name in ("free", "order"):
        assert all(scale > 0 for scale in found["scales"].values())
    else:
        assert {*found["weights"]} == {"before_crown", "from_crown_on"}
        assert found["resolution"]["F"] > 0


@pytest.mark.parametrize("name", ["free"])
def test_a_free_schedule_says_which_level_an_automatic_engine_took(capsys, tmp_path, arch, name):
    command, *words = WRITES[name]
    arguments = [command, arch, *words, "--engine", "auto", "--mortar", "epoxy"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    assert "engine: compliance: the simplest, until a joint leaves" in capsys.readouterr().err
    found = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    engine = found["engine"]
    assert (engine["name"], engine["reason"]) == ("auto", "the default")
    assert engine["mortar"]["tensile_strength"] == seqopt.EPOXY.tensile_strength
    assert engine["level"]["engine"] == "compliance"
