"""Counterparts of the paper's figures and tables: none is missing, the page says what is stored."""

from __future__ import annotations

import pandas as pd
import pytest

from experiments.study.paper_counterparts import ITEMS, KNOWN, faults, page
from experiments.study.parts.counterpart_rows import COUNTERPARTS, ours, tabulate
from tests.builders import ROOT

STORED = pd.read_csv(ROOT / "experiments" / "results" / "paper_counterparts.csv")
PAGE = (ROOT / "docs" / "counterparts.md").read_text(encoding="utf-8")
WITH_NUMBERS = [item for item in ITEMS if item.numbers]


def test_whatever_has_numbers_has_a_counterpart():
    labels = {item.label for item in WITH_NUMBERS}
    assert labels == set(COUNTERPARTS) == set(STORED["id"])
    assert STORED[["printed", "ours", "difference", "error_pct"]].notna().all(axis=None)
    for item in ITEMS:
        assert f"`{item.label}`" in PAGE


@pytest.mark.slow
def test_what_is_computed_is_what_is_stored():
    own = ours()
    values = pd.concat([tabulate(item.label, own) for item in WITH_NUMBERS], ignore_index=True)
    for column in ("id", "quantity", "at"):
        assert [*values[column]] == [*STORED[column]]
    assert values["ours"].to_numpy(float) == pytest.approx(
        STORED["ours"].to_numpy(float), rel=1e-4, abs=1e-4
    )


def test_an_item_without_counterpart_is_found():
    missing = WITH_NUMBERS[3].label
    assert faults(WITH_NUMBERS, STORED) == []
    assert faults(WITH_NUMBERS, STORED[STORED["id"] != missing]) == [
        f"{missing} has no counterpart"
    ]


def test_a_fourth_disagreement_fails_the_claim_and_so_does_one_less():
    item = next(item for item in WITH_NUMBERS if item.label == "table:2robot_forces")
    bad = STORED.assign(error_pct=STORED["error_pct"].where(STORED["id"] != item.label, 50.0))
    assert len(faults(WITH_NUMBERS, bad)) == 1
    good = STORED.assign(error_pct=STORED["error_pct"].where(~STORED["id"].isin(KNOWN), 0.0))
    assert len(faults(WITH_NUMBERS, good)) == len(KNOWN)


def test_the_page_is_what_is_stored():
    assert page(STORED) == PAGE
    assert page(STORED.assign(ours=1.1 * STORED["ours"])) != PAGE  # the control
