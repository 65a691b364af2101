"""Laws of the order: what stands whole does not know it, and any order builds what is held."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError
from seqopt.network.build import build_network
from seqopt.responses.quantities import CHOSEN_BY, lengths
from seqopt.sequence.schedule import islands
from tests.strategies import arches, both_sided

few = settings(max_examples=8, deadline=None)
scenes = st.one_of(arches(max_bricks=6, min_bricks=3), both_sided())
NAMES = ("T_max", "M_sup", "D_max", "C_max")


def worst(engine, bricks, grips):
    """The responses of a state by name, and the force at every grip."""
    fields = engine.solve(bricks, np.array([grips], dtype=int).reshape(1, -1), Want.ALL)
    found = [float(CHOSEN_BY[name].of(engine.network, fields)[0]) for name in NAMES]
    return np.array([*found, *lengths(fields.grip_force)[0]])


@given(scene=scenes, data=st.data())
@few
def test_the_whole_structure_does_not_know_its_order(scene, data):
    order = data.draw(st.permutations(scene.build_order))
    nodes = [n for brick in scene.bricks for n in brick.nodes if n not in scene.blocked_nodes]
    grips = data.draw(st.lists(st.sampled_from(nodes), min_size=1, max_size=3, unique=True))
    own, other = (ComplianceEngine(build_network(scene, o)) for o in (None, order))
    count = len(scene.bricks)
    expected = worst(own, count, grips)
    assert worst(other, count, grips) == pytest.approx(expected, rel=1e-7, abs=1e-12)


def spread(points):
    """How far points are from lying in one line, over how far they are apart."""
    apart = np.array(points) - points[0]
    return np.linalg.svd(apart, compute_uv=False)[1] / np.abs(apart).max()


@given(scene=scenes, data=st.data())
@few
def test_any_order_builds_what_is_tied_or_held(scene, data):
    """Parts that no joint ties to the ground need grips that are in no line: a brick has none."""
    order = data.draw(st.permutations(scene.build_order))
    engine = ComplianceEngine(build_network(scene, order))
    count = data.draw(st.integers(1, len(order)))
    nodes = {brick.name: brick.nodes for brick in scene.bricks}
    parts = [sorted(n for b in part for n in nodes[b]) for part in islands(engine.network, count)]
    grips = [n for part in parts for n in part if n not in scene.blocked_nodes]
    fixed = [
        spread([scene.node_position(n) for n in part if n in grips]) if len(part) > 2 else 0.0
        for part in parts
    ]
    if min(fixed, default=1.0) > 0.1:
        assert np.isfinite(worst(engine, count, grips)).all()
    elif min(fixed) < 1e-9:
        with pytest.raises(MechanismError):
            worst(engine, count, grips)
    else:  # nearly in a line: whichever an engine says, it says no number that is none
        with suppress(MechanismError):
            assert np.isfinite(worst(engine, count, grips)).all()
