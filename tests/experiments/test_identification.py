"""The identification of the reference arch: its start, its steps, its stored numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from experiments.calibration.identify_arch25 import (
    OFFSETS,
    SHAPE,
    beside_shipped,
    fit,
    holds,
    report,
    residuals,
    scene_of,
    starting_guess,
    target,
)
from experiments.harness.results import RESULTS
from seqopt.study.published import printed_steps


@pytest.mark.slow
def test_a_few_iterations_improve_the_start(monkeypatch):
    monkeypatch.setattr("experiments.calibration.identify_arch25.SOFTENING", (0.1,))
    start = starting_guess()
    wanted = target([printed_steps("sequential")])
    before = np.abs(residuals(scene_of(start, SHAPE), wanted))
    numbers, _ = fit(start, SHAPE, wanted, 6)
    after = np.abs(residuals(scene_of(numbers, SHAPE), wanted))
    assert np.minimum(after, 0.1).sum() < 0.8 * np.minimum(before, 0.1).sum()


def test_the_stored_numbers_describe_the_shipped_scene_and_worse_ones_fail():
    numbers = pd.read_csv(RESULTS / "identify_arch25.csv")["value"].to_numpy()
    groups = (*SHAPE, OFFSETS)
    same = beside_shipped(report(numbers, groups), scene_of(numbers, groups))
    assert same["difference"].abs().max() <= 0.01
    assert holds(same, quick=False)
    off = numbers * np.where(np.arange(len(numbers)) == 35, 1.1, 1.0)  # the gap
    worse = beside_shipped(report(off, groups), scene_of(off, groups))
    assert not holds(worse, quick=False)
    assert holds(worse, quick=True)  # a quick fit is not judged, the shipped one is
