"""The loop in C++ answers what the engine does, so that their times may be compared."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.engines.parts.plain_loop import PlainLoop, compiled
from experiments.harness.scenes import grip_sets


def test_it_agrees_with_the_engine(engine25):
    if compiled() is None:
        pytest.skip("there is no C++ compiler")
    assert np.float64(5e-324) * np.float64(1.0) > 0  # the smallest numbers are still there
    sets = grip_sets(engine25.network, 9, 40)
    loop = PlainLoop(engine25, 9, sets)
    loop()
    assert loop.off(engine25, 9, sets).max() <= 1e-9
    loop.out[:, 1] *= 1.001
    assert loop.off(engine25, 9, sets)[1] > 1e-4
