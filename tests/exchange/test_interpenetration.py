"""Blocks that interpenetrate, or stand there twice, are named and never pass in silence."""

from __future__ import annotations

import pytest

from seqopt.errors import SceneError, SceneWarning
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene
from tests.blocks import box
from tests.documents import obj

BRICK = (0.2, 0.1, 0.06)


def bricks(*places):
    return [box(BRICK, at=(x, 0.0, z)) for x, z in places]


HALF = bricks((0.0, 0.0), (0.1, 0.0), (0.05, 0.06))
SIDE = bricks((0.0, 0.0), (0.18, 0.0), (0.09, 0.06))
SUNK = bricks((0.0, 0.0), (0.2, 0.0), (0.1, 0.055))
GOOD = bricks((0.0, 0.0), (0.2, 0.0), (0.1, 0.06))
REFUSED = {
    "half": (HALF, "blocks block_0 and block_1 interpenetrate by 60 mm (their bounds by 100 mm"),
    "side": (SIDE, "blocks block_0 and block_1 interpenetrate by 20 mm"),
    "sunk": (SUNK, "blocks block_1 and block_2 interpenetrate by 5 mm"),
}


@pytest.fixture
def read(tmp_path):
    def import_one(shapes, **given):
        path = tmp_path / "wall.obj"
        path.write_text(obj(*shapes), encoding="utf-8")
        return import_scene(path, given=Given(unit="m", density=2000.0, **given))

    return import_one


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("gap", [None, 0.2])
def test_blocks_that_interpenetrate_are_refused_whatever_the_gap(read, name, gap):
    """They came in as blocks beside each other, and every step stood."""
    shapes, said = REFUSED[name]
    with pytest.raises(SceneError) as caught:
        read(shapes, gap=gap)
    assert said in str(caught.value)
    assert "wider gap" not in str(caught.value)
    assert "(--accept-overlaps)" in str(caught.value)
    assert "faces tolerate 3 mm" in str(caught.value)


def test_what_only_touches_is_not_refused(read):
    assert len(read(GOOD).joints) == 3
    nearly = bricks((0.0, 0.0), (0.199, 0.0), (0.1, 0.058))
    assert len(read(nearly).joints) == 3
    with pytest.raises(SceneError, match=r"interpenetrate by 2 mm .* faces tolerate 1 mm"):
        read(nearly, gap=0.001)


def test_accepted_overlaps_are_said_first_and_warned_of(read):
    with pytest.warns(SceneWarning, match="bricks 0 and 1 interpenetrate by 60 mm"):
        scene = read(HALF, accept_overlaps=True)
    assert scene.provenance.splitlines()[1].startswith("blocks block_0 and block_1 interpenetrate")
    assert len(scene.joints) == 2
    with pytest.raises(
        SceneError, match="block_2; move block_2 out of the block that it"
    ) as caught:
        read(SUNK, accept_overlaps=True)
    assert "gap" not in str(caught.value)


def test_a_block_that_is_there_twice_is_refused(read):
    """It weighed twice as much: both were one block of twelve faces."""
    with pytest.raises(SceneError, match="blocks block_2 and block_3 interpenetrate by 60 mm"):
        read([*GOOD, GOOD[2]])
