"""All methods and formulations side by side."""

from __future__ import annotations

from dataclasses import replace

import pytest

from seqopt.engines.registry import make_engine
from seqopt.placement.formulation import formulations
from seqopt.report.comparison import compare
from seqopt.study.presets import EQUATIONS
from tests.builders import small_arch


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


def test_without_weight_nothing_is_above_the_best():
    """Found by fuzzing: all responses are zero, and so is what gaps are relative to."""
    scene = replace(small_arch(4), gravity=(0.0, 0.0, 0.0))
    table = compare(make_engine("compliance", scene), EQUATIONS).table
    assert table.loc["free", ["objective", "gap"]].tolist() == [0.0, 0.0]
