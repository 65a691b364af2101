"""`compare --speed`: what it prints and writes, and what it refuses."""

from __future__ import annotations

import json

import pandas as pd
import pytest

from seqopt._cli.main import main

WALL = "wall:columns=2,courses=2"


@pytest.mark.slow
def test_a_comparison_with_speed(tmp_path, capsys):
    out = tmp_path / "speed"
    words = ["compare", WALL, "--no-stability"]
    assert main([*words, "--speed", "20", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    block = said.split("Speed against regret\n")[1].split("written to")[0]
    assert all(len(line) <= 80 for line in block.splitlines())
    rows = pd.read_csv(out / "speed.csv")
    assert {"compliance", "frame"} <= {*rows["engine"]}
    assert {"loop", "free"} == {*rows["schedule"]}
    sentence = " ".join(block.partition("\n\n")[0].split())
    assert sentence.startswith("Take ")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert f'alt="{sentence}"' in page
    assert page.count("data:image/png;base64,") == 2  # for wide screens and for narrow ones
    assert (out / "speed.png").exists()
    assert "speed.csv" in said
    assert main([*words, "--json"]) == 0
    assert "speed" not in json.loads(capsys.readouterr().out)
