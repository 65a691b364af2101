"""Blocks that are open, in pieces, or with faces inside: mended, said, or refused by name."""

from __future__ import annotations

import pytest

from seqopt.errors import SceneError
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene
from tests.blocks import L_SHAPE, box, prism
from tests.documents import obj

GIVEN = Given(unit="m", density=2000.0)
TOWER = [box((0.4, 0.2, 0.1), at=(0.0, 0.0, 0.1 * i)) for i in range(3)]


@pytest.fixture
def imported(tmp_path):
    def of(text):
        path = tmp_path / "tower.obj"
        path.write_text(text, encoding="utf-8")
        return import_scene(path, given=GIVEN)

    return of


def test_faces_without_area_are_no_blocks(imported):
    """As programs write them that cut every face into triangles."""
    assert len(imported(obj(*TOWER) + "f 4 4 8\nf 4 8 8\n").bricks) == len(TOWER)


def test_faces_inside_a_block_are_named(imported):
    """A wall across an L, between edges of which each has two faces without it."""
    shape, corners = prism(L_SHAPE, 0.1, at=(0.0, 0.0, 0.1)), len(L_SHAPE)
    wall = f"f 1 4 {4 + corners} {1 + corners}\n"
    with pytest.raises(SceneError, match=r"block 0: .* 2 of its edges have more than two faces"):
        imported(obj(shape).replace("o block_0\n", "").replace("f ", f"{wall}f ", 1))


def test_an_object_of_several_blocks_is_said(imported):
    cubes = [box((0.2, 0.2, 0.1), at=(x, 0, 0)) for x in (0.0, 0.3)]
    said = imported(obj(*cubes).replace("o block_1\n", "")).provenance
    assert "2 closed pieces are called block_0: each is a block of its own" in said
