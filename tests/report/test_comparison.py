"""All methods and formulations side by side."""

from __future__ import annotations

from dataclasses import replace

import pytest

from seqopt.engines.registry import make_engine
from seqopt.graph.formulation import formulations
from seqopt.report.comparison import LARGEST, compare
from seqopt.study.published import CRITERIA, EQUATIONS
from tests.builders import small_arch


@pytest.mark.slow
@pytest.mark.xdist_group("comparison")
def test_all_methods_and_formulations_are_rows(compared25):
    result = compared25
    assert {"sequential", "cantilever", "published", "modified-sequential"} <= set(
        result.table.index
    )
    assert set(formulations("costs")) <= set(result.table.index)
    assert result.table.loc["overlap_dp", "gap"] == pytest.approx(0)
    assert result.table.loc["published", "gap"] > 0
    assert set(result.tables) == set(result.table.index)


def test_without_weight_nothing_is_above_the_best():
    """Found by fuzzing: all responses are zero, and so is what gaps are relative to."""
    scene = replace(small_arch(4), gravity=(0.0, 0.0, 0.0))
    table = compare(make_engine("compliance", scene), EQUATIONS).table
    assert table.loc["free", ["objective", "gap"]].tolist() == [0.0, 0.0]


@pytest.mark.slow
@pytest.mark.xdist_group("comparison")
def test_the_free_schedule_is_compared_by_the_criterion_that_is_asked_for(engine25, compared25):
    """No figure of the row is above the least of the closed rows and the published plan."""
    published = CRITERIA["worst-ratio-published"]
    asked = compare(engine25, published)
    assert asked.table.loc["free", "objective"] == pytest.approx(0.840088, rel=1e-5)
    assert asked.criteria["free"] == published
    ranks = compared25
    for table in (asked.table, ranks.table):
        others = table.loc[["sequential", "cantilever", "published"], [*LARGEST]]
        assert (table.loc["free", [*LARGEST]] <= others.min()).all()
    least = ranks.criteria["free"].limits
    assert dict(least)["F_largest"] == pytest.approx(others["F_rob"].min())
    assert dict(least)["D_max"] == pytest.approx(1e-6 * others["D_max"].min())
