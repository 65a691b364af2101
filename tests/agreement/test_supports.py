"""Independent routes agree on what every ground end carries, not on the first one's share alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.contact.mortar import Mortar
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.registry import AutoEngine
from seqopt.engines.rigid._mixed import solve_mixed
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from tests.builders import from_both_sides
from tests.direct_solve import solve_dense

STRONG = Mortar(friction=1.0, tensile_strength=1e12, cohesion=1e12)
ROUTES = {
    "dense": lambda net, *asked: solve_dense(net, asked[0], grip_columns(net, *asked)),
    "mixed": lambda net, *asked: solve_mixed(net, asked[0], grip_columns(net, *asked)),
    "frame": lambda net, *asked: FrameEngine(net).solve(*asked),
    "discrete": lambda net, *asked: DiscreteEngine(net, STRONG).solve(*asked),
    "auto": lambda net, *asked: AutoEngine(net, STRONG).solve(*asked),
}
TOLERANCE = {"frame": 5e-6, "discrete": 1e-7}  # of the largest force or moment; else 1e-9
STATES = [(1, [[1]]), (4, [[2, 12]]), (7, [[2, 7], [6, 11]])]


def gap(route, scene, bricks, grips):
    """Return the largest difference from the compliance engine for every end, relative."""
    net = build_network(scene)
    sets = np.array(grips, dtype=np.int64).reshape(len(grips), -1)
    exact = ComplianceEngine(net).solve(bricks, sets, Want.ALL).support
    found = ROUTES[route](net, bricks, sets).support
    assert found.shape == exact.shape == (len(grips), 2, 6)
    return np.abs(found - exact).max(axis=(0, 2)) / np.abs(exact).max()


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize(("bricks", "grips"), STATES)
def test_every_end_is_the_same_by_every_route(route, bricks, grips):
    scene = from_both_sides(7, "VLR")
    assert gap(route, scene, bricks, grips).max() <= TOLERANCE.get(route, 1e-9)


def test_a_softer_second_end_is_seen():
    """Negative control: the routes get scenes that differ in the second end alone."""
    scene = from_both_sides(7, "VLR")
    far = scene.grounds[1]
    soft = replace(far, rotational_stiffness=tuple(0.5 * k for k in far.rotational_stiffness))
    other = replace(scene, grounds=(scene.grounds[0], soft))
    one, two = (
        solve_dense(net, 7, grip_columns(net, 7, [[2, 7]])).support
        for net in map(build_network, (scene, other))
    )
    assert (np.abs(one - two).max(axis=(0, 2)) > 1e-4 * np.abs(one).max()).all()
