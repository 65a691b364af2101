"""All methods and formulations side by side."""

from __future__ import annotations

import pytest

from seqopt.placement.formulation import formulations
from seqopt.report.comparison import compare
from seqopt.study.presets import EQUATIONS


@pytest.mark.slow
def test_all_methods_and_formulations_are_rows(engine25):
    result = compare(engine25, EQUATIONS)
    assert {"sequential", "cantilever", "published", "modified-sequential"} <= set(
        result.table.index
    )
    assert set(formulations()) <= set(result.table.index)
    assert result.table.loc["overlap_dp", "gap"] == pytest.approx(0)
    assert result.table.loc["published", "gap"] > 0
    assert set(result.tables) == set(result.table.index)
