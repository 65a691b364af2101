"""Where faces overlap: closed forms, and sums over the parts of a cut."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seqopt.scene.shape import clip, polygon_moments

numbers = st.floats(-1, 1)


def rectangle(wide, high, x=0.0, y=0.0, turn=0.0):
    corners = 0.5 * np.array([[-wide, -high], [wide, -high], [wide, high], [-wide, high]])
    c, s = np.cos(turn), np.sin(turn)
    return (corners @ np.array([[c, s], [-s, c]]) + [x, y])[None]


def overlap(first, second):
    """Area, centroid, and second moments about the two axes of what both cover."""
    shared = clip(first[0], second[0])
    area, center, spread = polygon_moments(shared) if len(shared) > 2 else (0.0, 0.0, 0.0)
    if not area > 1e-15:
        return 0.0, np.zeros(2), np.zeros(2)
    return area, center, np.array([spread[1, 1], spread[0, 0]])


def about_origin(found):
    """Area, first and second moments about the origin's axes, which parts add up to."""
    area, (x, y), (about_x, about_y) = found
    return np.array([area, area * x, area * y, about_x + area * y**2, about_y + area * x**2])


@given(wide=st.floats(0.1, 2), high=st.floats(0.1, 2), x=numbers, y=numbers)
def test_a_face_on_itself(wide, high, x, y):
    face = rectangle(wide, high, x, y)
    area, center, moments = overlap(face, face)
    assert area == pytest.approx(wide * high)
    assert center == pytest.approx([x, y], abs=1e-12)
    assert moments == pytest.approx([wide * high**3 / 12, wide**3 * high / 12])


@given(x=numbers, y=numbers, first=numbers, turn=st.floats(-3, 3), cut=st.floats(-0.4, 0.4))
def test_parts_of_a_cut_add_up(x, y, first, turn, cut):
    """A long rectangle, cut in two across its length, overlaps another as its parts do."""
    face = rectangle(0.8, 0.5, first, 0.2, first)
    whole = overlap(face, rectangle(1.2, 0.6, x, y, turn))
    c, s = np.cos(turn), np.sin(turn)
    total = np.zeros(5)
    for low, high in ((-0.6, cut), (cut, 0.6)):
        middle = 0.5 * (low + high)
        part = overlap(face, rectangle(high - low, 0.6, x + c * middle, y + s * middle, turn))
        total += about_origin(part)
    assert about_origin(whole) == pytest.approx(total, abs=1e-9)
    assert 0 <= whole[0] <= 0.4 + 1e-9


def test_faces_apart_share_nothing():
    found = overlap(rectangle(1, 1), rectangle(1, 1, 2.0, 0.3, 0.4))
    assert found[0] == 0
