"""Scenes in words of other numbers of bricks are as large as those of the words."""

from __future__ import annotations

import numpy as np
import pytest

from seqopt.errors import SceneError
from seqopt.scene._counts import scene_of_bricks
from seqopt.scene.scene_file import load_scene


def extent(scene):
    """How far its bricks and their nodes spread."""
    nodes = [scene.node_position(node) for brick in scene.bricks for node in brick.nodes]
    return np.ptp(np.array(nodes), axis=0)


@pytest.mark.parametrize(
    ("words", "bricks"),
    [
        ("arch:span=2,rise=0.8,pattern=VLR", (14, 19, 28)),
        ("arch:span=2,rise=0.7,curve=catenary", (8, 16)),
        ("wall:columns=4,courses=4,gap=0.01,corbel=0.02", (4, 36)),
        ("dome:courses=4,around=12", (20, 80)),
    ],
)
def test_they_are_as_large(words, bricks):
    own = extent(load_scene(words))
    for count in bricks:
        scene = scene_of_bricks(words, count)
        assert len(scene.bricks) == pytest.approx(count, rel=0.35)
        np.testing.assert_allclose(extent(scene), own, atol=0.15)


def test_arches_and_chains_have_exactly_so_many():
    assert len(scene_of_bricks("arch:span=2,rise=0.8", 21).bricks) == 21
    assert len(scene_of_bricks("chain:bricks=20", 31).bricks) == 31


@pytest.mark.parametrize("words", ["arch25", "my.json", "barrel:test=3"])
def test_others_have_a_fixed_number(words):
    with pytest.raises(SceneError, match="its number of bricks is fixed; others are for scenes in"):
        scene_of_bricks(words, 12)


def test_what_is_no_arch_is_a_line():
    with pytest.raises(SceneError, match="interpenetrate"):
        scene_of_bricks("arch:span=2,rise=0.8,pattern=VLR", 10)
