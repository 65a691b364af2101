"""Residuals in twice the digits, and what is answered or refused by them on every processor."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from seqopt.engines.interface import Want
from seqopt.engines.rigid import _mixed as mixed
from seqopt.engines.rigid._mixed import add_products, solve_mixed
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SolverError
from seqopt.network.build import build_network
from tests.limit_scenes import chain, loosened
from tests.reference_chain import solve_exactly

EPS = np.finfo(float).eps
BEYOND = [(43,), (48,), (31,), (12, 20, 32), (13, 45), (5, 25, 40)]  # the loose joint: 12-13


def exactly(start, matrix, factors):
    """The sums of products as fractions."""
    rows = matrix.toarray()
    return [
        Fraction(a) + sum((Fraction(m) * Fraction(x) for m, x in zip(row, factors, strict=True)))
        for a, row in zip(start.tolist(), rows.tolist(), strict=True)
    ]


@given(st.integers(0, 2**32 - 1), st.integers(0, 7), st.integers(1, 9))
def test_sums_of_products_are_those_of_fractions(seed, width, rows):
    """Though all but sixteen digits cancel."""
    rng = np.random.default_rng(seed)
    dense = rng.normal(size=(rows, width)) * (rng.random((rows, width)) < 0.6)
    matrix, factors = sparse.csr_array(dense), rng.normal(size=width) * 10.0 ** rng.integers(-9, 9)
    start = -(dense @ factors)
    found, wanted = add_products(start, matrix, factors), exactly(start, matrix, factors)
    size = np.abs(dense) @ np.abs(factors) + np.abs(start)
    for one, true, scale in zip(found, wanted, size, strict=True):
        allowed = EPS * abs(true) + Fraction((width + 1) ** 2 * (EPS * EPS) * scale)
        assert abs(Fraction(float(one)) - true) <= allowed


def test_plain_sums_of_products_are_not():
    """The control: a third times three, less one."""
    matrix, third = sparse.csr_array([[3.0, 1e-3]]), np.array([1 / 3, 0.0])
    start = np.array([-1.0])
    (true,) = exactly(start, matrix, third)
    assert abs(true) == Fraction(1, 2**54)
    assert add_products(start, matrix, third)[0] == float(true)
    assert (start + matrix @ third)[0] == 0.0


def off(net, columns, fields):
    """The largest difference from sixty digits, relative to the largest of each field."""
    exact = solve_exactly(net, len(net.inner), columns)
    wrench, nodes = fields.joint_wrench[0], net.inner.ravel()
    pairs = (
        (fields.displacement[0, nodes], exact.displacement),
        (wrench[:, :3], exact.joint_wrench[:, :3]),
        (wrench[:, 3:], exact.joint_wrench[:, 3:]),
    )
    return max(np.abs(a - b).max() / np.abs(b).max() for a, b in pairs)


@pytest.fixture(scope="module")
def hinge():
    """A chain of which one joint has 1e-8 of the others' stiffness in turning."""
    return build_network(loosened(chain(25), 1e-8, only_turning=True))


@pytest.mark.parametrize("held", BEYOND[::2])
def test_loose_sets_are_answered_as_sixty_digits_do(hinge, held):
    """By residuals in doubles, half of them were refused, others on other processors."""
    columns = np.array(held)
    assert off(hinge, columns, solve_mixed(hinge, 25, columns[None])) <= 1e-9
    numbers = [[hinge.node_name[i] for i in hinge.inner.ravel()[columns]]]
    fields = ComplianceEngine(hinge).solve(25, numbers, Want.ALL)
    assert off(hinge, columns, fields) <= 1e-9


def spoiled():
    """Sums without the last digit of doubles, another way in each."""
    rng = np.random.default_rng(0)

    def add(start, matrix, factors):
        size = np.abs(start) + abs(matrix) @ np.abs(factors)
        lost = 10 * EPS * size * rng.choice([-1, 1], len(size))
        return add_products(start, matrix, factors) + lost

    return add


def test_corrections_that_stall_refuse(hinge, monkeypatch):
    """The control of the test before."""
    monkeypatch.setattr(mixed, "add_products", spoiled())
    with pytest.raises(SolverError, match="too close to a mechanism"):
        solve_mixed(hinge, 25, np.array([(43,)]))


@pytest.mark.parametrize(("power", "refused"), [(7, False), (13, True)])
def test_what_last_digits_decide_is_refused(power, refused):
    """How far the part beyond turns about its grips: by moments that are nothing but rounding."""
    net = build_network(loosened(chain(25), 10.0**-power, only_turning=True))
    for held in BEYOND[:3]:
        if refused:
            with pytest.raises(SolverError, match="too close to a mechanism"):
                solve_mixed(net, 25, np.array([held]))
        else:
            assert off(net, np.array(held), solve_mixed(net, 25, np.array([held]))) <= 1e-10
