"""Arches by span and rise; where faces overlap."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from seqopt.errors import SceneError
from seqopt.scene.library import ArchForm, WallShape, arch, wall
from seqopt.scene.scene_file import _parse_scene, dump_scene, load_scene
from seqopt.scene.shape import clip, polygon_moments


def off_circle(x, z, span, rise):
    radius = (span**2 / 4 + rise**2) / (2 * rise)
    return np.hypot(x - span / 2, z - (rise - radius)) - radius


def off_catenary(x, z, span, rise):
    """With the scale a found from the points themselves: cosh((x - c) / a) = 1 + (rise - z) / a."""
    low, high = 1e-3 * span, 1e3 * span
    for _ in range(200):  # bisection on the springing
        a = math.sqrt(low * high)
        low, high = (a, high) if a * (math.cosh(span / (2 * a)) - 1) > rise else (low, a)
    return z - (rise - a * (np.cosh((x - span / 2) / a) - 1))


OFF = {"circular": off_circle, "catenary": off_catenary}


@settings(max_examples=8)
@given(
    span=st.floats(0.8, 6.0),
    share=st.floats(0.1, 1.0),
    curve=st.sampled_from([*OFF]),
    pattern=st.sampled_from(["V", "VL", "VLR"]),
)
def test_joints_lie_on_the_curve_and_supports_are_level_at_the_span(span, share, curve, pattern):
    rise = span * (0.12 + share * 0.38)
    form = ArchForm(span=span, rise=rise, curve=curve, pattern=pattern)
    try:
        scene = arch(form)
    except SceneError:  # bricks that do not fit this curve
        reject()
    first, last = (np.array(ground.position) for ground in scene.grounds)
    assert first == pytest.approx(0, abs=1e-12)
    assert last == pytest.approx([span, 0, 0], abs=1e-9 * span)
    x, y, z = np.array([joint.position for joint in scene.joints]).T
    assert y == pytest.approx(0, abs=1e-12)
    assert OFF[curve](x, z, span, form.rise) == pytest.approx(0, abs=1e-9 * span)
    assert not np.allclose(OFF[curve](x, z + 1e-3 * span, span, form.rise), 0, atol=1e-5 * span)
    assert len({joint.thickness for joint in scene.joints}) == 1


def test_a_corbelled_wall_steps_out_and_shares_less_face():
    shape = WallShape(columns=3, courses=4)
    upright, out = wall(shape), wall(replace(shape, corbel=0.025))
    assert [b.position[1] for b in out.placed[::3]] == pytest.approx([0, 0.025, 0.05, 0.075])
    beds = [
        (one.translational_stiffness[0], other.translational_stiffness[0])
        for one, other in zip(upright.joints, out.joints, strict=True)
        if abs(one.along[2]) > 0.5
    ]
    assert beds
    for straight, corbelled in beds:
        assert corbelled == pytest.approx(0.75 * straight)  # of a width of 0.1 m


@pytest.mark.parametrize(
    ("words", "made"),
    [
        ("arch:span=2,rise=0.7,bricks=12", lambda: arch(ArchForm(span=2, rise=0.7, bricks=12))),
        (
            "arch:span=2,rise=1.2,curve=catenary,dimensions=0.24x0.11x0.05",
            lambda: arch(
                ArchForm(span=2, rise=1.2, curve="catenary", dimensions=(0.24, 0.11, 0.05))
            ),
        ),
        ("wall:columns=4,courses=3", lambda: wall(WallShape(columns=4, courses=3))),
    ],
)
def test_scenes_in_words_are_those_of_the_library(words, made):
    scene = load_scene(words)
    assert replace(scene, provenance="") == replace(made(), provenance="")
    assert scene.provenance.endswith(f"In words: {words}.")
    assert _parse_scene(dump_scene(scene)) == scene


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("arch:spn=2", "'spn' is none of its numbers (did you mean span?); give span, rise"),
        ("arch:span=x", "span is 'x'; give a number alone, as 0.5"),
        ("arch:span=2,rise=1,dimensions=1x2", "dimensions is '1x2'; give it as 0.2x0.1x0.06"),
        ("wall:columns=4", "courses is missing; a wall in running bond: wall:columns=6"),
        ("wall:columns=4,courses=0", "wall: courses is 0; give a whole number from 1"),
    ],
)
def test_words_that_make_no_scene(words, said):
    with pytest.raises(SceneError) as caught:
        load_scene(words)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


# where faces overlap: closed forms, and sums over the parts of a cut


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
