"""Solids that interpenetrate, and how deep: boxes by arithmetic, others by a program of its own."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from seqopt.errors import SceneError
from seqopt.exchange._doubts import find_overlaps
from seqopt.scene._checks import as_vectors
from seqopt.scene.boxes import _separations, block_brick, overlapping, require_apart
from seqopt.scene.parts import Brick
from tests.blocks import C_SHAPE, L_SHAPE, box, prism
from tests.refusals import one_line

BRICK = (0.2, 0.1, 0.06)
TOLERATED = 0.003


def found(*solids, tolerated=TOLERATED):
    """Depths in mm and overlaps of bounds in mm, by pair."""
    out = find_overlaps(solids, [tolerated] * len(solids))
    return {e.pair: (1e3 * e.depth, tuple(1e3 * np.array(e.bounds))) for e in out}


@pytest.mark.parametrize(
    ("at", "depth", "bounds"),
    [
        ((0.1, 0.0, 0.0), 60.0, (100.0, 100.0, 60.0)),  # half of it in the other one
        ((0.1, 0.0, 0.055), 5.0, (100.0, 100.0, 5.0)),
        ((0.0, 0.0, 0.0), 60.0, (200.0, 100.0, 60.0)),
    ],
)
@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_how_deep_boxes_interpenetrate(at, depth, bounds, scale):
    pair = [box(scale * np.array(BRICK)), box(scale * np.array(BRICK), at=scale * np.array(at))]
    ((where, (deep, shared)),) = found(*pair, tolerated=scale * TOLERATED).items()
    assert where == (0, 1)
    assert deep == pytest.approx(scale * depth, rel=1e-3)
    assert shared == pytest.approx(tuple(scale * b for b in bounds))


@pytest.mark.parametrize(
    "at", [(0.2, 0.0, 0.0), (0.1, 0.0, 0.06), (0.1, 0.05, 0.06), (0.198, 0.0, 0.0), (0.3, 0.0, 0.0)]
)
def test_what_touches_or_is_tolerated_does_not(at):
    assert found(box(BRICK), box(BRICK, at=at)) == {}


@pytest.mark.parametrize(("into", "depth"), [(0.0, None), (0.02, 20.0)])
def test_what_stands_in_the_mouth_of_another_is_apart_until_it_reaches_into_it(into, depth):
    """Their hulls interpenetrate by 1 m: no plane passes between them."""
    mouth, bar = prism(C_SHAPE), box((2.5, 1.0, 1.0), at=(1.0 - into, 1.0, 0.0))
    depths = [deep for deep, _ in found(mouth, bar).values()]
    assert depths == ([] if depth is None else [pytest.approx(depth, rel=1e-3)])


numbers = st.floats(-1, 1)
turns = st.tuples(numbers, numbers, numbers).map(
    lambda v: Rotation.from_rotvec(np.pi * np.array(v)).as_matrix()
)


def radius_of_both(first, second):
    """The largest ball in two convex solids, from the planes of their faces."""
    rows, offsets = [], []
    for solid in (first, second):
        for a, b, c in (solid.points[list(face[:3])] for face in solid.faces):
            normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
            rows.append([*normal, 1.0])
            offsets.append(normal @ a)
    program = linprog([0, 0, 0, -1], rows, offsets, bounds=[(None, None)] * 3 + [(-9, 9)])
    assert program.status == 0
    return program.x[3]


@settings(max_examples=8)
@given(
    size=st.tuples(*[st.floats(0.1, 0.5)] * 3),
    turn=turns,
    at=st.tuples(*[st.floats(-0.4, 0.4)] * 3),
)
def test_the_depth_of_convex_solids_is_that_of_a_program(size, turn, at):
    first = box((0.4, 0.3, 0.2), at=(-0.2, -0.15, -0.1))
    points = (box(size).points - 0.5 * np.array(size)) @ turn + at
    second = replace(box(size), vertices=as_vectors(points))
    depth, limit = 2 * radius_of_both(first, second), 0.01
    out = found(first, second, tolerated=limit)
    if depth < 0.99 * limit:
        assert out == {}
    elif depth > 1.5 * limit:
        assert out[0, 1][0] == pytest.approx(1e3 * depth, rel=5e-3)


PARTS = [box((3, 1, 1)), box((1, 3, 1)), box((3, 1, 1), at=(0, 2, 0))]  # of the C, as boxes


@pytest.mark.slow
@settings(max_examples=8)
@given(
    size=st.tuples(*[st.floats(0.2, 1.5)] * 3),
    turn=turns,
    at=st.tuples(*[st.floats(0.0, 3.0)] * 2, st.floats(0.0, 1.0)),
)
def test_a_solid_that_is_not_convex_is_as_deep_as_its_parts(size, turn, at):
    points = (box(size).points - 0.5 * np.array(size)) @ turn + at
    turned = replace(box(size), vertices=as_vectors(points))
    depth, limit = 2 * max(radius_of_both(part, turned) for part in PARTS), 0.02
    out = found(prism(C_SHAPE), turned, tolerated=limit)
    if depth < 0:
        assert out == {}
    elif depth > 1.5 * limit:
        assert out[0, 1][0] >= 0.99e3 * min(depth, 1.5 * limit)


# bricks as boxes: apart or not, told by two routes that share nothing
MOST = 10.0


def half_spaces(brick):
    """Return normals (6, 3) and offsets (6,) of a box: it is where normals @ x <= offsets."""
    length, width = np.array(brick.length_axis), np.array(brick.width_axis)
    frame = np.stack([length, width, np.cross(length, width)])
    normals = np.concatenate([frame, -frame])
    half = 0.5 * np.array([*brick.dimensions, *brick.dimensions])
    return normals, normals @ np.array(brick.position) + half


@st.composite
def bricks(draw, name):
    frame = draw(turns)
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
    pairs_of_parts = zip(half_spaces(first), half_spaces(second), strict=True)
    normals, offsets = (np.concatenate(parts) for parts in pairs_of_parts)
    program = np.column_stack([normals, np.ones(len(normals))])
    found = linprog([0, 0, 0, -1], program, offsets, bounds=[(None, None)] * 3 + [(-MOST, MOST)])
    assert found.status == 0
    radius = found.x[3]  # of the largest ball in both; negative if they are apart
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


def test_bricks_of_a_scene_as_boxes_and_as_shapes():
    halves = [block_brick(i, box(BRICK, at=(0.1 * i, 0.0, 0.0)), 2000.0) for i in (1, 2, 4)]
    boxes = [replace(brick, shape=None, node_offsets=None) for brick in halves]
    for bricks in (halves, boxes, [boxes[0], *halves[1:]]):
        ((a, b, depth),) = overlapping(bricks)
        assert (a, b) == (1, 2)
        assert depth == pytest.approx(0.06, rel=1e-3)
        assert overlapping(bricks[1:]) == []


# polyhedra: volume, centroid and axes in closed form, and what is refused
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


FACES, BLOCK = CUBE.faces, block_brick(1, CUBE, 2000.0)
made = partial(block_brick, density=2000.0)
WRONG = {  # what is said, and what it is said of
    "face on one side only": lambda: replace(CUBE, faces=FACES[:-1]),
    "do not agree|one side only": lambda: replace(CUBE, faces=(*FACES[:-1], FACES[-1][::-1])),
    "volume is -1": lambda: replace(CUBE, faces=tuple(face[::-1] for face in FACES)),
    "not flat": lambda: replace(CUBE, vertices=((0, 0, 0.5), *CUBE.vertices[1:])),
    "name vertices from 0 to 7": lambda: replace(CUBE, faces=(*FACES[:-1], (0, 1, 99, 4))),
    "three vertices or more": lambda: replace(CUBE, faces=((0, 1, 1), *FACES[1:])),
    "whole number": lambda: replace(CUBE, faces=((0.5, 1, 2), *FACES[1:])),
    "brick 1: shape is 'box'; give a Polyhedron": lambda: made(1, "box"),
    "its name is 'a'; give a whole number": lambda: made("a", CUBE),
    r"nodes are \[1\]; give two different numbers": lambda: made(1, CUBE, nodes=(1,)),
    "centroid of its shape is": lambda: replace(BLOCK, shape=CUBE),
    "its shape extends": lambda: replace(BLOCK, dimensions=(1.0, 1.0, 2.0)),
    "shape is 3; give a Polyhedron": lambda: replace(BLOCK, shape=3),
    "two different points": lambda: replace(BLOCK, node_offsets=((0, 0, 0), (0, 0, 0))),
}


@pytest.mark.parametrize("said", WRONG)
def test_what_is_no_polyhedron_or_no_brick_of_it_is_refused(said):
    with one_line(SceneError, said):
        WRONG[said]()
