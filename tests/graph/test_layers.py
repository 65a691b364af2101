"""The problem that a schedule poses, its criteria and rankings."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import rankdata

from seqopt.problem.criteria import _mean_ranks, _ranks_of


def test_ranks():
    values = np.array([3.0, 1.0, 1.0, np.nan, 2.0])
    assert _ranks_of(values, 5) == pytest.approx([4, 1.5, 1.5, np.nan, 3], nan_ok=True)
    assert _ranks_of(np.array([1.2, 0.9, 1.4]), 3) == pytest.approx([2, 2, 2])  # all round to 1
    assert _ranks_of(np.full(3, np.nan), 3) == pytest.approx([2, 2, 2])


@given(values=st.lists(st.integers(-5, 5), min_size=1, max_size=30))
def test_ranks_are_those_of_scipy(values):
    found = _mean_ranks(np.array(values, dtype=float))
    assert found.tolist() == rankdata(values, method="average").tolist()
    assert found.sum() == pytest.approx(len(values) * (len(values) + 1) / 2)


@given(st.lists(st.integers(0, 9), min_size=12, max_size=12))
def test_shared_ranks_weigh_as_much_as_single_ones(values):
    """Ranks over pairs have the mean of ranks over single candidates."""
    pairs = _ranks_of(np.array(values, float).reshape(3, 4), 4)
    assert pairs.mean() == pytest.approx(_ranks_of(np.arange(4.0), 4).mean())
    assert 0.5 < pairs.min() <= pairs.max() < 4.5
