"""What a diagnosis says of sound, ill-conditioned and loose structures, and of spoiled fields."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.harness.scenes import running_bond
from seqopt.engines.diagnosis import _LEAST_DIAGONAL, UNRESISTED, WELL, Finding, _spectrum, diagnose
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.rigid._mixed import held_rows, ungripped_system
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SolverError
from seqopt.network.build import build_network
from tests.limit_scenes import HELD, LOOSE_AT, chain, loosened, without_joint
from tests.reference_chain import solve_exactly


def places(net, bricks, grips):
    return grip_columns(net, bricks, np.array(grips, dtype=int).reshape(1, -1))[0]


class Spoiled:
    """An engine whose answers are another engine's after a change."""

    def __init__(self, engine, change):
        self.engine, self.change, self.network = engine, change, engine.network

    def solve(self, bricks, grips, want):
        return self.change(self.engine.solve(bricks, grips, want))


@pytest.mark.parametrize("grips", [(), (20, 48, 33)])
def test_the_published_arch_is_solved_well(engine25, grips):
    for source in (engine25, engine25.network):
        told = diagnose(source, 25, grips)
        assert told.finding is Finding.SOLVED_WELL
        assert told.backward_error <= WELL
        assert told.smallest_eigenvalue > 1e-6
        assert np.abs(told.mode).max() == 1


@pytest.mark.parametrize("name", ["brick_twist", "joint_wrench", "grip_force"])
@pytest.mark.parametrize("share", [1e-6])
def test_spoiled_fields_are_seen(engine25, name, share):
    """Negative control: one entry of one field off by a share of the largest."""

    def change(fields):
        values = getattr(fields, name).copy()
        values.reshape(-1)[np.abs(values).argmax()] *= 1 + share
        return replace(fields, **{name: values})

    told = diagnose(Spoiled(engine25, change), 17, [20, 33])
    assert told.finding is Finding.ILL_CONDITIONED
    assert share / 100 < told.backward_error < 3 * share
    assert "do not solve the equations" in told.reason


def test_the_smallest_eigenvalue_is_that_of_the_dense_matrix():
    net = build_network(running_bond(3, 3))
    grips = places(net, 9, [13, 18])
    parts = ungripped_system(net, 9)
    dense = parts.deformation.toarray()
    matrix = dense.T * parts.stiffness @ dense
    scale = np.sqrt(np.maximum(matrix.diagonal(), _LEAST_DIAGONAL * matrix.diagonal().max()))
    null = np.linalg.svd(held_rows(parts, grips).rows / scale)[2][6:].T
    values, vectors = np.linalg.eigh(null.T @ (matrix / scale / scale[:, None]) @ null)
    lowest, condition, mode = _spectrum(net, 9, grips)
    assert lowest == pytest.approx(values[0], rel=1e-6)
    assert condition >= 0.99 * values[-1] / values[0]
    want = null @ vectors[:, 0] / scale
    want = want / want[np.abs(want).argmax()]
    assert mode.ravel() == pytest.approx(want, abs=1e-4)
    assert held_rows(parts, grips).rows @ mode.ravel() == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("grips", [(), (48, 49)])
def test_a_missing_joint_is_a_mechanism_beyond_it(grips):
    net = without_joint(chain(25))
    for engine in (ComplianceEngine(net), FrameEngine(net)):
        told = diagnose(engine, 25, grips)
        assert told.finding is Finding.MECHANISM
        assert told.residuals is None
        assert told.backward_error == np.inf
        assert np.abs(told.mode[: LOOSE_AT + 1]).max() < 1e-6
        assert np.abs(told.mode[LOOSE_AT + 1 :]).max() == 1
    assert told.smallest_eigenvalue < UNRESISTED


def test_nearly_loose_is_solved_or_refused_never_wrong():
    seen = set()
    for factor in (*(10.0**-power for power in range(0, 18, 6)), 0.0):
        for grips in ([], [49], [30, 49], HELD):
            net = build_network(loosened(chain(25), factor, only_turning=False))
            told = diagnose(ComplianceEngine(net), 25, grips)
            seen.add(told.finding)
            if told.residuals is not None:
                fields = ComplianceEngine(net).solve(25, [grips], Want.DISPLACEMENTS)
                exact = solve_exactly(net, 25, places(net, 25, grips)).displacement
                got = fields.displacement[0, net.inner.ravel()]
                assert np.abs(got - exact).max() <= 1e-9 * np.abs(exact).max()
            elif told.finding is Finding.ILL_CONDITIONED:
                assert told.condition > 1e10
                assert "refused" in told.reason
    assert seen == set(Finding)


@pytest.mark.slow
def test_a_long_chain_is_solved_well():
    told = diagnose(build_network(chain(1500)), 1500, [])
    assert told.finding is Finding.SOLVED_WELL
    assert told.backward_error < 1e-14
    assert told.condition > 1e12
    assert np.abs(told.mode).max(axis=1).argmax() == 1499
    engine = ComplianceEngine(build_network(chain(338)))
    assert diagnose(engine, 338, [675]).finding is Finding.SOLVED_WELL


@pytest.mark.parametrize("contrast", [1e2, 1e12])
def test_a_frame_at_a_bad_contrast_is_seen(contrast):
    told = diagnose(FrameEngine(build_network(chain(2)), contrast), 2, [3])
    assert told.finding is Finding.ILL_CONDITIONED
    assert told.backward_error > 1e-5
    assert told.condition < 1e3  # it is the frame, not the structure


def test_a_frame_is_corrected_as_long_as_that_helps():
    """Three corrections were not enough, and at another contrast none are: the control."""
    net, none = build_network(chain(100)), np.zeros((1, 0), dtype=int)
    exact = ComplianceEngine(net).solve(100, none).displacement
    found = FrameEngine(net).solve(100, none).displacement
    assert np.abs(found - exact).max() <= 2e-6 * np.abs(exact).max()
    with pytest.raises(SolverError, match="too ill-conditioned"):
        FrameEngine(net, 1e11).solve(100, none)
