"""Boxes written as polyhedra with faces of their own: the same answers by every engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seqopt.contact.mortar import DRY
from seqopt.engines.registry import make_engine
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.responses.table import analyze
from seqopt.sequence.methods import METHODS
from seqopt.stability._steps import assess_steps
from tests.blocks import with_shapes
from tests.builders import six_bricks

PLAIN = build_network(six_bricks())
SHAPED = build_network(with_shapes(six_bricks()))


def numbers(engine, network):
    table = analyze(make_engine(engine, network), METHODS["cantilever"](network, ()))
    return table.select_dtypes("number").to_numpy()


@pytest.mark.parametrize("engine", ["compliance", "frame", "discrete", "auto"])
def test_every_engine(engine):
    one, other = (numbers(engine, network) for network in (PLAIN, SHAPED))
    assert other == pytest.approx(one, rel=1e-7, abs=1e-7 * np.nanmax(np.abs(one)), nan_ok=True)


def test_stability():
    one, other = (
        assess_steps(network, METHODS["cantilever"](network, ())[::4], DRY, ["bond", "friction"])
        for network in (PLAIN, SHAPED)
    )
    assert [s.verdict for s in one] == [s.verdict for s in other]
    assert [s.bond for s in one] == pytest.approx([s.bond for s in other], rel=1e-6)
    assert [s.friction for s in one] == pytest.approx([s.friction for s in other], rel=1e-6)


def moved_nodes(scene, *offsets):
    """A scene whose second brick is held where offsets from its centroid say."""
    bricks = [replace(b, node_offsets=offsets) if b.name == 2 else b for b in scene.bricks]
    return build_network(replace(scene, bricks=tuple(bricks)))


def turned(brick, *shares):
    """Points on a brick's long axis, shares of its length from its centroid."""
    return [tuple(s * brick.dimensions[0] * x for x in brick.length_axis) for s in shares]


@pytest.mark.parametrize("shares", [(-0.1, 0.4), (0.05, 0.3)])
def test_weights_act_at_centroids_wherever_nodes_are(shares):
    """Nodes on the long axis but not on either side: exact bricks and frame find the same."""
    scene = six_bricks("V")
    network = moved_nodes(scene, *turned(scene.bricks[1], *shares))
    one, other = (numbers(engine, network) for engine in ("compliance", "frame"))
    assert one == pytest.approx(other, rel=1e-6, abs=1e-6 * np.nanmax(np.abs(one)), nan_ok=True)
    free = make_engine("compliance", network).solve(4, np.zeros((1, 0), int))
    plain = make_engine("compliance", build_network(scene)).solve(4, np.zeros((1, 0), int))
    assert free.support == pytest.approx(plain.support, rel=1e-9, abs=1e-9)
    assert free.brick_twist == pytest.approx(plain.brick_twist, rel=1e-9, abs=1e-18)


def test_nodes_above_the_centroid_will_do_and_nodes_beside_it_not():
    scene = six_bricks("V")
    moved_nodes(scene, (-0.05, 0.0, 0.05), (0.05, 0.0, 0.05)).inner_weight.sum()
    network = moved_nodes(scene, (-0.05, 0.05, 0.0), (0.05, 0.05, 0.0))
    with pytest.raises(SceneError, match="weight turns it about the line through its nodes"):
        network.inner_weight.sum()
