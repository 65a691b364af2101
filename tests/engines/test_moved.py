"""Grips that are not where they should be."""

from __future__ import annotations

import numpy as np
import pytest

from seqopt.engines._grip_compliance import read_compliance
from seqopt.engines.diagnosis import Finding, diagnose
from seqopt.engines.interface import _NAMES, Want, grip_columns
from seqopt.engines.registry import ENGINES
from seqopt.errors import GripError
from seqopt.network.build import build_network
from tests.builders import apart, six_bricks
from tests.direct_solve import solve_dense

SETS = [[3, 8, 11], [4, 5, 9]]  # two hold one brick in the second


def drawn(sets, size, seed=0):
    return size * np.random.default_rng(seed).normal(size=(*np.shape(sets), 3))


@pytest.fixture(params=ENGINES)
def engine(request):
    return ENGINES[request.param](build_network(six_bricks("VLR")))


def test_held_nodes_go_along_and_answers_add_up(engine):
    """Small enough that no joint leaves its elastic limits, for engines that have any."""
    net = engine.network
    ways = [drawn(SETS, 1e-8, seed) for seed in range(2)]
    still, one, two, both = (
        engine.solve(6, SETS, Want.ALL, m) for m in (None, *ways, ways[0] + ways[1])
    )
    nodes = net.inner.ravel()[grip_columns(net, 6, SETS)[0]]
    assert one.displacement[0, nodes] == pytest.approx(ways[0][0], rel=1e-4, abs=1e-14)
    for name in _NAMES:
        a, b, c, d = (getattr(f, name) for f in (still, one, two, both))
        assert np.abs(b + c - a - d).max() <= 1e-5 * max(np.abs(each).max() for each in (a, b, c))
        assert np.abs(a - b).max() > 1e-3 * np.abs(a).max() or name == "grip_moment"
    assert apart(engine.solve(6, SETS, Want.ALL, np.zeros((2, 3, 3))), still) <= 1e-12


def test_engines_agree(engine):
    net = engine.network
    moved = drawn(SETS, 1e-8)
    columns = grip_columns(net, 6, SETS)
    direct = solve_dense(net, 6, columns, read_compliance(net, columns, SETS, moved))
    assert apart(engine.solve(6, SETS, Want.ALL, moved), direct) <= 1e-5
    assert apart(engine.solve(6, SETS, Want.ALL), direct) > 1e-3  # the measure can fail


@pytest.mark.parametrize(
    ("moved", "named"),
    [
        ([[0.1, 0.0, 0.0]], r"moved has shape \(1, 3\); give lengths in meters.*\(2, 3, 3\)"),
        (np.full((2, 3, 3), np.nan), "moved: a length is not finite"),
        ("far", "moved: give lengths in meters"),
    ],
)
def test_wrong_ways_are_refused(engine, moved, named):
    with pytest.raises(GripError, match=named):
        engine.solve(6, SETS, Want.RESPONSES, moved)


def test_a_brick_is_not_stretched(engine25):
    """Along it both of its nodes go halfway; all else is as asked."""
    net, grips = engine25.network, np.array([[22, 23, 3]])
    first, second = (net.node_position[net.node_name.index(int(n))] for n in grips[0, :2])
    axis = (second - first) / np.linalg.norm(second - first)
    moved = drawn(grips, 1e-4)
    stretched = moved + np.array([[-2e-3, 6e-3, 0.0]])[..., None] * axis
    along = moved + np.array([[2e-3, 2e-3, 0.0]])[..., None] * axis
    one, other = (engine25.solve(18, grips, Want.ALL, m) for m in (stretched, along))
    assert apart(one, other) <= 1e-12
    assert apart(engine25.solve(18, grips, Want.ALL, moved), other) > 1e-3
    edge = np.flatnonzero((net.edge_spring < 0) & (net.edge_brick == 11))
    assert not one.edge_force[0, edge].any()


def test_a_hand_that_takes_all_force_away(engine25):
    """Moved where the node goes by itself, a grip bears nothing: forces undo no displacements."""
    net = engine25.network
    free = engine25.solve(9, np.zeros((1, 0), dtype=int), Want.ALL)
    node = net.node_name.index(13)
    found = engine25.solve(9, [[13]], Want.ALL, free.displacement[:, [node]])
    assert np.abs(found.grip_force).max() <= 1e-8
    assert np.abs(found.displacement - free.displacement).max() <= 1e-12


def test_diagnosis_asks_where_hands_are(engine25):
    moved = drawn([3, 20, 33], 4e-4)
    found = diagnose(engine25, 18, [3, 20, 33], moved)
    assert found.finding is Finding.SOLVED_WELL
    assert diagnose(engine25.network, 18, [3, 20, 33], moved).finding is Finding.SOLVED_WELL

    class Still:
        """An engine that takes hands for still."""

        network = engine25.network

        def solve(self, bricks, grips, want=Want.RESPONSES, moved=None):
            return engine25.solve(bricks, grips, want)

    assert diagnose(Still(), 18, [3, 20, 33], moved).residuals.grips > 0.1
