"""The command ``assess``: mortars, and what enters no verdict."""

from __future__ import annotations

import json
from dataclasses import replace

import pandas as pd
import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.scene.scene_file import load_scene, save_scene

ARCH = "arch:span=1,rise=0.4,pattern=VLR"
WORDS = ["assess", ARCH, "--method", "sequential", "--mortar", "dry"]


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
    both = [seqopt.assess_steps(network, steps, mortar) for mortar in ("dry", "epoxy")]
    assert [e.verdict.value for each in both for e in each] == table["verdict"].tolist()


@pytest.mark.parametrize(
    ("fall", "said"),
    [(-0.005, "leaves their balance"), pytest.param(-0.5, "not small", marks=pytest.mark.slow)],
)
def test_a_movement_of_the_ground_is_said_to_enter_no_verdict(capsys, tmp_path, fall, said):
    """It was left out without a word; of ground at rest nothing is said."""
    scene = load_scene(ARCH)
    first, second = scene.grounds
    down = replace(second, movement=(0.0, 0.0, fall))
    save_scene(replace(scene, grounds=(first, down)), path := tmp_path / "settled.json")
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
