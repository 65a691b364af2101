"""All methods and formulations side by side."""

from __future__ import annotations

import pytest

from seqopt.placement.formulation import formulations
from seqopt.report.comparison import compare_methods
from seqopt.report.contest import contest
from seqopt.study.presets import EQUATIONS


def test_contest(engine25):
    result = contest(engine25, compare_methods(engine25), EQUATIONS)
    assert {"sequential", "cantilever", "published plan", "modified-sequential"} <= set(
        result.table.index
    )
    assert set(formulations()) <= set(result.table.index)
    assert result.table.loc["overlap_dp", "gap"] == pytest.approx(0)
    assert result.table.loc["published plan", "gap"] > 0
    assert set(result.tables) == set(result.table.index)
