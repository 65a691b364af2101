"""Bricks as boxes: apart or not, told by two routes that share nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from seqopt.errors import SceneError
from seqopt.scene.boxes import _separations, require_apart
from seqopt.scene.parts import Brick

MOST = 10.0


def half_spaces(brick):
    """Return normals (6, 3) and offsets (6,) of a box: it is where normals @ x <= offsets."""
    length, width = np.array(brick.length_axis), np.array(brick.width_axis)
    frame = np.stack([length, width, np.cross(length, width)])
    normals = np.concatenate([frame, -frame])
    half = 0.5 * np.array([*brick.dimensions, *brick.dimensions])
    return normals, normals @ np.array(brick.position) + half


def shared_radius(first, second):
    """Return the radius of the largest ball in both of two boxes; negative if they are apart."""
    normals, offsets = (
        np.concatenate(parts) for parts in zip(half_spaces(first), half_spaces(second), strict=True)
    )
    program = np.column_stack([normals, np.ones(len(normals))])
    found = linprog([0, 0, 0, -1], program, offsets, bounds=[(None, None)] * 3 + [(-MOST, MOST)])
    assert found.status == 0
    return found.x[3]


numbers = st.floats(-1, 1)
turns = st.tuples(numbers, numbers, numbers).map(
    lambda v: Rotation.from_rotvec(np.pi * np.array(v))
)


@st.composite
def bricks(draw, name):
    frame = draw(turns).as_matrix()
    sizes = draw(st.tuples(*[st.floats(0.05, 0.5)] * 3))
    place = 0.3 * np.array(draw(st.tuples(numbers, numbers, numbers)))
    return Brick(
        name=name,
        position=tuple(place.tolist()),
        length_axis=tuple(frame[0].tolist()),
        width_axis=tuple(frame[1].tolist()),
        dimensions=sizes,
        density=1000.0,
        nodes=(2 * name, 2 * name + 1),
        placing_node=2 * name,
    )


@given(first=bricks(1), second=bricks(2))
def test_planes_and_a_program_agree_on_what_is_apart(first, second):
    pairs, distance = _separations([first, second])
    radius = shared_radius(first, second)
    if len(pairs) == 0:
        assert radius < 0
    elif abs(radius) > 1e-7:
        assert (distance[0] < 0) == (radius > 0)
        if radius > 0:  # a ball in both is no wider than the way to part them
            assert 2 * radius <= -distance[0] + 1e-7


def test_a_moved_brick_is_found(arch25):
    require_apart("arch", arch25.bricks, "none")
    first, second, *rest = arch25.bricks
    nearer = np.array(second.position) - 0.02 * np.array(second.width_axis)
    with pytest.raises(SceneError, match=r"arch: bricks 1 and 2 interpenetrate by .* mm; move it$"):
        require_apart(
            "arch", [first, replace(second, position=tuple(nearer.tolist())), *rest], "move it"
        )
    require_apart("one brick", [first], "none")
