"""Blocks of COMPAS models stand where COMPAS places them, and touch where they do."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from seqopt.errors import SceneError
from seqopt.exchange._compas_models import read_model
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene
from tests.blocks import box
from tests.documents import element, matrix, model, nested

LYING = matrix([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0]])
# of `nested`, as ``modelgeometry.aabb()`` of compas_model 0.9.3 gives them: lowest and highest
BY_COMPAS = {
    "1": ((0.002, 0.0185, 0.0), (0.003, 0.019, 0.002)),
    "2": ((0.003, 0.0175, 0.00025), (0.0035, 0.0185, 0.00125)),
    "3": ((0.0, 0.0125, 0.0), (0.002, 0.013, 0.001)),
}


def corners(block):
    return np.array([block.vertices.min(axis=0), block.vertices.max(axis=0)])


def test_blocks_stand_where_compas_places_them():
    content = read_model(nested(), "nested")
    assert [block.key for block in content.blocks] == list(BY_COMPAS)
    for block in content.blocks:
        np.testing.assert_allclose(corners(block), BY_COMPAS[block.key], atol=1e-15)
    assert content.said == ("1 groups only place what is in them",)


def affine(draw):
    out = np.eye(4)
    turn = draw(st.tuples(*[st.floats(-3, 3)] * 3))
    out[:3, :3] = draw(st.sampled_from((1e-3, 1.0, 2.0))) * Rotation.from_rotvec(turn).as_matrix()
    out[:3, 3] = draw(st.tuples(*[st.floats(-5, 5)] * 3))
    return out


@st.composite
def trees(draw):
    """A model of blocks in a tree, and where each of them belongs."""
    whole = affine(draw)
    placed, nodes, rows = [], [], []
    root = {"children": []}
    for i in range(draw(st.integers(1, 6))):
        above = draw(st.integers(-1, i - 1))
        own = affine(draw)
        placed.append((placed[above] if above >= 0 else whole) @ own)
        nodes.append({"element": str(i), "children": []})
        (nodes[above] if above >= 0 else root)["children"].append(nodes[i])
        shape = box((1.0, 2.0, 3.0))
        rows.append(element(str(i), shape, transformation=matrix(own[:3].tolist())))
    order = draw(st.permutations(range(len(rows))))
    data = {
        "transformation": matrix(whole[:3].tolist()),
        "elements": {str(i): rows[i] for i in order},
        "tree": {"root": root},
    }
    return {"dtype": "compas_dem.models/BlockModel", "data": data}, [placed[i] for i in order]


@given(trees())
def test_transformations_are_composed_from_the_model_down(drawn):
    document, placed = drawn
    local = np.array(box((1.0, 2.0, 3.0)).vertices)
    for block, at in zip(read_model(document, "tree").blocks, placed, strict=True):
        np.testing.assert_allclose(block.vertices, local @ at[:3, :3].T + at[:3, 3], atol=1e-12)


def turned(**more):
    document = model()
    document["data"] |= {"transformation": LYING, **more}
    return document


def test_faces_follow_blocks_that_compas_moved(tmp_path):
    """COMPAS moves the blocks of a model, and leaves the contacts where it found them."""
    path = tmp_path / "lying.json"
    path.write_text(json.dumps(turned()), encoding="utf-8")
    lying = import_scene(path, given=Given(unit="m"))
    assert [round(brick.position[1], 9) for brick in lying.placed] == [-0.75, -1.25]
    assert [round(spring.position[1], 9) for spring in (*lying.grounds, *lying.joints)] == [
        -0.5,
        -1.0,
    ]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"tree": {"root": {"children": [{"element": "x"}]}}}, "element 'x' of the tree is not"),
        ({"tree": {"root": {"children": [{"element": "a"}] * 2}}}, "tree occurs twice"),
        (
            {"transformation": {"matrix": [*[[1, 0, 0, 0]] * 3, [0, 0, 1, 1]]}},
            r"ends in \[0.0, 0.0, 1.0, 1.0\]; give a matrix that ends in 0, 0, 0, 1",
        ),
    ],
)
def test_a_tree_that_is_none_is_one_line(change, said):
    document = copy.deepcopy(model())
    document["data"] |= change
    with pytest.raises(SceneError, match=said):
        read_model(document, "m")
