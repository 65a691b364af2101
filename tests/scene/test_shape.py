"""Polyhedra: volume, centroid and axes in closed form, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from seqopt.errors import SceneError
from seqopt.scene.boxes import as_vectors, block_brick
from seqopt.scene.shape import Polyhedron
from tests.blocks import C_SHAPE, L_SHAPE, box, prism

ANGLES = st.tuples(*[st.floats(-3, 3)] * 3)
SIZES = st.lists(st.floats(0.1, 10.0), min_size=3, max_size=3)


@given(size=SIZES, turn=ANGLES, at=st.tuples(*[st.floats(-5, 5)] * 3))
def test_a_box_in_any_pose(size, turn, at):
    plain = box(size)
    frame = Rotation.from_rotvec(turn).as_matrix()
    moved = replace(plain, vertices=as_vectors(plain.points @ frame.T + at))
    assert moved.volume == pytest.approx(np.prod(size), rel=1e-9)
    middle = frame @ (0.5 * np.array(size)) + at
    assert moved.centroid == pytest.approx(middle, abs=1e-9 * (10 + np.abs(at).max()))
    lengths = np.diff(np.sort(size))
    if lengths.min() > 1e-2:  # else other axes will do as well
        assert moved.extents(moved.axes) == pytest.approx(np.sort(size)[::-1], rel=1e-6)
    assert moved.contains(moved.centroid)


def test_an_l_shape_in_closed_form():
    """Two rectangles: 3 x 1 at (1.5, 0.5) and 1 x 1 at (0.5, 1.5)."""
    shape = prism(L_SHAPE, 2.0)
    assert shape.volume == pytest.approx(8.0)
    assert shape.centroid == pytest.approx([(3 * 1.5 + 0.5) / 4, (3 * 0.5 + 1.5) / 4, 1.0])
    assert shape.contains(np.array([0.5, 1.5, 1.0]))
    assert not shape.contains(np.array([2.0, 1.5, 1.0]))


def test_nodes_of_a_block_that_is_hollow_in_the_middle_lie_in_it():
    own = prism(C_SHAPE)
    low, high = (np.array(node) + own.centroid for node in own.nodes())
    assert own.contains(low)
    assert own.contains(high)
    assert low + high == pytest.approx(2 * own.centroid)
    assert not own.contains(own.centroid + np.array([0.75, 0.0, 0.0]))  # where a box would have one


CUBE = box((1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("vertices", "faces", "said"),
    [
        (CUBE.vertices, CUBE.faces[:-1], "face on one side only"),
        (CUBE.vertices, (*CUBE.faces[:-1], CUBE.faces[-1][::-1]), "do not agree|one side only"),
        (CUBE.vertices, tuple(face[::-1] for face in CUBE.faces), "volume is -1"),
        (((0, 0, 0.5), *CUBE.vertices[1:]), CUBE.faces, "not flat"),
        (CUBE.vertices, (*CUBE.faces[:-1], (0, 1, 99, 4)), "name vertices from 0 to 7"),
        (CUBE.vertices, ((0, 1, 1), *CUBE.faces[1:]), "three vertices or more"),
        (CUBE.vertices, ((0.5, 1, 2), *CUBE.faces[1:]), "whole number"),
    ],
)
def test_what_is_no_polyhedron_is_refused(vertices, faces, said):
    with pytest.raises(SceneError, match=said) as caught:
        Polyhedron(vertices, faces)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "shape", "more", "said"),
    [
        (1, "box", {}, "brick 1: shape is 'box'; give a Polyhedron"),
        ("a", CUBE, {}, "its name is 'a'; give a whole number"),
        (1, CUBE, {"nodes": (1,)}, r"nodes are \[1\]; give two different numbers"),
    ],
)
def test_what_makes_no_brick_is_one_line(name, shape, more, said):
    with pytest.raises(SceneError, match=said):
        block_brick(name, shape, 2000.0, **more)


def test_a_brick_and_its_shape_agree():
    brick = block_brick(1, CUBE, 2000.0)
    with pytest.raises(SceneError, match="centroid of its shape is"):
        replace(brick, shape=CUBE)
    with pytest.raises(SceneError, match="its shape extends"):
        replace(brick, dimensions=(1.0, 1.0, 2.0))
    with pytest.raises(SceneError, match="shape is 3; give a Polyhedron"):
        replace(brick, shape=3)
    with pytest.raises(SceneError, match="two different points"):
        replace(brick, node_offsets=((0, 0, 0), (0, 0, 0)))
