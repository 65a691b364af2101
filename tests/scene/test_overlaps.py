"""Solids that interpenetrate, and how deep: boxes by arithmetic, others by a program of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from seqopt.scene.boxes import _find_overlaps, as_vectors
from tests.blocks import C_SHAPE, box, prism

BRICK = (0.2, 0.1, 0.06)
TOLERATED = 0.003


def found(*solids, tolerated=TOLERATED):
    """Depths in mm and overlaps of bounds in mm, by pair."""
    out = _find_overlaps(solids, [tolerated] * len(solids))
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
