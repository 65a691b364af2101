"""Engines at their limits against sixty digits, small; the stored large cases, and wrong ones."""

from __future__ import annotations

import pandas as pd
import pytest

from tests.quality.engine_limits import STORE, judge, measured

STORED = pd.read_csv(STORE)


@pytest.mark.slow
def test_engines_are_as_exact_as_promised_on_small_sizes():
    parts = judge(measured(quick=True))
    assert [text for text, holds in parts.items() if not holds] == []


def test_they_are_on_the_stored_cases():
    assert all(judge(STORED).values())


@pytest.mark.parametrize(
    ("column", "value", "where"),
    [
        ("error", 2e-9, {"engine": "fast", "sweep": STORED["sweep"].iloc[0], "bricks": 25}),
        ("error", 1e-10, {"engine": "fast", "bricks": 338}),  # worse than direct in walls
        ("status", "solved", {"engine": "fast", "mechanism": True}),
        ("backward_error", 1e-12, {"engine": "frame"}),
    ],
)
def test_a_wrong_answer_is_seen(column, value, where):
    rows = (STORED[[*where]] == pd.Series(where)).all(axis=1)
    assert rows.any()
    wrong = STORED[column].astype(object).where(~rows, value).infer_objects()
    assert not all(judge(STORED.assign(**{column: wrong})).values())
