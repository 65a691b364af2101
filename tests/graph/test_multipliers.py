"""The highest Lagrangian bound, against one linear program over all paths at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from seqopt.graph._budgets import Plane, Polyhedron, highest_bound

BUDGETS, WEIGHTS, SHARES = range(3)


def drawn(rng, kind):
    """The planes of a dozen paths, and the multipliers that may be chosen."""
    size = int(rng.integers(1, 5))
    slopes = rng.uniform(0.0, 10.0 ** rng.integers(-3, 4), (12, size))
    if kind == BUDGETS:
        caps = np.quantile(slopes, 0.5, axis=0)
        scale = 10.0 ** rng.integers(-3, 4)
        return rng.uniform(0.0, scale, 12), slopes - caps, Polyhedron(1e6, units=caps)
    counts = np.ones(size) if kind == WEIGHTS else rng.integers(1, 4, size).astype(float)
    most = max(1.0 / size, 0.6) if kind == WEIGHTS else np.inf
    return np.zeros(12), slopes, Polyhedron(most, counts=counts)


def at_once(constants, slopes, polyhedron):
    """The highest point below all planes."""
    size, scale = slopes.shape[1], np.abs(slopes).max()
    sums = polyhedron.counts is not None
    found = linprog(
        [*[0.0] * size, -1.0],
        A_ub=np.column_stack([-slopes / scale, np.ones(len(slopes))]),
        b_ub=constants,
        A_eq=[[*polyhedron.counts, 0.0]] if sums else None,
        b_eq=[1.0] if sums else None,
        bounds=[*[(0.0, polyhedron.most if sums else None)] * size, (None, None)],
    )
    return -found.fun * (scale if sums else 1.0)


@pytest.mark.parametrize("kind", [BUDGETS, WEIGHTS, SHARES])
@pytest.mark.parametrize("seed", range(4))
def test_the_highest_bound_is_that_of_one_program(kind, seed):
    constants, slopes, polyhedron = drawn(np.random.default_rng(seed), kind)

    def oracle(multipliers):
        heights = constants + slopes @ multipliers
        least = int(np.argmin(heights))
        return Plane(constants[least], slopes[least], heights[least])

    size = slopes.shape[1]
    counts = np.ones(size) if polyhedron.counts is None else polyhedron.counts
    start = np.zeros(size) if kind == BUDGETS else 1 / counts / size
    found = highest_bound(oracle, start, polyhedron, lambda _: False, rounds=100, closed=1e-9)
    assert found.bound == oracle(found.multipliers).bound  # it is proven, whatever it is
    assert found.bound == pytest.approx(at_once(constants, slopes, polyhedron), rel=1e-6)
    first = highest_bound(oracle, start, polyhedron, lambda _: True, rounds=100, closed=1e-9)
    assert first.bound == oracle(start).bound <= found.bound  # stopped after one plane


def test_no_path_is_no_bound_on_any():
    polyhedron = Polyhedron(1e6, units=np.ones(2))
    found = highest_bound(
        lambda _: None, np.zeros(2), polyhedron, lambda _: False, rounds=9, closed=0
    )
    assert found.bound == np.inf
