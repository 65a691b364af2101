"""How stiff grips are, as the command line takes it."""

from __future__ import annotations

import json

import pandas as pd
import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.errors import SceneError
from seqopt.scene.scene_file import save_scene

ARCH = "arch:span=1,rise=0.4,bricks=6"


def test_a_stiffness_is_that_of_all_robots(tmp_path, capsys):
    path = tmp_path / "soft.json"
    words = ["scene", "arch25", "--grips", "1e6x1e6x5e5,turning=2e4", "--export", str(path)]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "grip of 1e+06 x 1e+06 x 500000 N/m, which resists turning by 20000 N m/rad" in out
    wanted = seqopt.load_scene("arch25").with_grips((1e6, 1e6, 5e5), 2e4)
    assert seqopt.load_scene(path) == wanted
    assert main(["scene", str(path), "--grips", "rigid", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert {*facts["scene"]["grips_N_per_m"].values()} == {None}


def test_a_file_may_say_one_number_or_three(tmp_path):
    scene, path = seqopt.load_scene("arch25").with_grips(2e6), tmp_path / "scene.json"
    save_scene(scene, path)
    assert seqopt.load_scene(path) == scene
    text = path.read_text()
    path.write_text(text.replace("[2000000.0, 2000000.0, 2000000.0]", "2e6"))
    assert seqopt.load_scene(path) == scene
    path.write_text(text.replace("[2000000.0, 2000000.0, 2000000.0]", "-1"))
    with pytest.raises(SceneError, match="robots"):
        seqopt.load_scene(path)


def test_analyses_follow(capsys, tmp_path):
    path = tmp_path / "steps.csv"
    assert (
        main(["analyze", ARCH, "--method", "cantilever", "--grips", "1e5", "--out", str(path)]) == 0
    )
    network = seqopt.build_network(seqopt.load_scene(ARCH).with_grips(1e5))
    wanted = seqopt.analyze(seqopt.make_engine("compliance", network), seqopt.cantilever(network))
    name = "D_max_1e-3mm"
    assert pd.read_csv(path)[name].to_numpy() == pytest.approx(wanted[name].to_numpy(), rel=1e-5)
    assert "compliance of robots" not in capsys.readouterr().err
