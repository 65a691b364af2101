"""The paper's tables and figures beside ours, from the package alone."""

from __future__ import annotations

import json

import pandas as pd
import pytest

from seqopt._paper import files
from seqopt._paper.files import NUMBERED, agreement_table, paper_files
from seqopt._paper.items import TITLES
from tests.builders import ROOT
from tests.commands import command

STORED = pd.read_csv(ROOT / "experiments" / "results" / "paper_counterparts.csv")


def quiet(_):
    """Hear nothing."""


def test_tables_stand_alone_where_nothing_draws(monkeypatch):
    monkeypatch.setattr(files, "find_spec", lambda _: None)
    made = paper_files(None, STORED, quiet)
    assert {name for name in made if not name.endswith(".csv")} == {"paper.md"}
    assert len(made) == len(NUMBERED) + 2  # all values, and the page
    assert sum(text.count("\n") - 1 for name, text in made.items() if "_" in name) == len(STORED)
    assert "Picture" not in made["paper.md"]
    assert "](" not in made["paper.md"]  # no link to a page that is not there


def test_every_item_is_said_to_agree_or_not():
    found = agreement_table(STORED).set_index("item")["agreement"]
    assert found["Table 3"] == "disagrees"
    assert found["Table 9"] == "agrees"
    assert found["Figure 1"] == "no numbers"
    worse = STORED.assign(
        error_pct=STORED["error_pct"].where(STORED["id"] != "table:optimization2", 50.0)
    )
    assert agreement_table(worse).set_index("item")["agreement"]["Table 9"] == "disagrees"


@pytest.mark.slow
def test_the_command_computes_what_is_stored(capsys, monkeypatch, tmp_path):
    """One figure is drawn; all are in the tests of the documentation's figures."""
    assert {item.picture for item in NUMBERED} <= {*TITLES}
    some = NUMBERED[0].picture
    monkeypatch.setattr(files, "TITLES", {some: TITLES[some]})
    status, out, _ = command(capsys, "paper", "--out", tmp_path / "paper", "--json")
    assert status == 0
    values = pd.DataFrame(json.loads(out)["values"])
    for column in ("id", "quantity", "at"):
        assert [*values[column]] == [*STORED[column]]
    assert values["ours"].to_numpy(float) == pytest.approx(
        STORED["ours"].to_numpy(float), rel=1e-4, abs=1e-4
    )
    names = {path.name for path in (tmp_path / "paper").iterdir()}
    assert {f"{some}.png", f"{some}.svg"} <= names
    assert {"counterparts.csv", "paper.md", "table_B1.csv", "figure_9.csv"} <= names
