"""What heuristics lose on random arches."""

from __future__ import annotations

import pandas as pd

from experiments.harness.results import RESULTS
from experiments.placement.heuristic_gaps import COMPARED, gaps, summary

STORED = pd.read_csv(RESULTS / "heuristic_gaps.csv")


def test_the_stored_rows_can_be_drawn_again():
    again = pd.DataFrame(gaps(2)).set_index(["draw", "criterion", "formulation"])["gap"]
    stored = STORED.set_index(["draw", "criterion", "formulation"])["gap"].loc[again.index]
    assert (again - stored).abs().max() <= 1e-3 * stored.max()
    assert set(summary(STORED).index.get_level_values("criterion")) == set(COMPARED)
