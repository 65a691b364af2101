"""Laws of generated scenes: nothing interpenetrates, all touch, and engines agree on them."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st

from seqopt.contact.faces import bare_assembly
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.scene.boxes import _separations
from seqopt.scene.library import ArchForm, WallShape, arch, chain, wall
from seqopt.scene.scene_file import _find_warnings, _scene_by_words, load_scene


@st.composite
def small_walls(draw):
    return wall(
        WallShape(
            columns=draw(st.integers(1, 5)),
            courses=draw(st.integers(1, 5)),
            dimensions=draw(st.tuples(*[st.floats(0.05, 0.4)] * 3)),
            gap=draw(st.sampled_from([0.0, 0.002, 0.01])),
            corbel=draw(st.sampled_from([0.0, 0.01])),
        )
    )


@st.composite
def small_arches(draw):
    """Arches by span and rise whose bricks fit; those that do not are refused in a line."""
    span, curve = (draw(st.floats(1.0, 4.0)), draw(st.sampled_from(["circular", "catenary"])))
    form = ArchForm(
        span=span,
        rise=span * draw(st.floats(0.15, 0.5)),
        curve=curve,
        pattern=draw(st.sampled_from(["V", "VLR"])),
    )
    try:
        return arch(form)
    except SceneError:
        reject()


@st.composite
def small_vaults(draw):
    sides = st.floats(0.1, 0.4), st.floats(0.05, 0.15), st.floats(0.03, 0.06)
    words = f"span={draw(st.floats(1.0, 2.0))},rise={draw(st.floats(0.2, 0.4))}"
    size = "x".join(map(str, draw(st.tuples(*sides))))
    try:
        return load_scene(f"vault:{words},columns={draw(st.integers(1, 3))},dimensions={size}")
    except SceneError:
        reject()


chains = st.builds(chain, st.integers(7, 40), pattern=st.sampled_from(["VLR", "V", "LR", "VL"]))
GENERATED = st.one_of(chains, small_arches(), small_walls(), small_vaults())


@settings(max_examples=10)
@given(scene=GENERATED)
def test_no_two_bricks_are_in_one_place(scene):
    assume(len(scene.bricks) > 1)
    _, distance = _separations(scene.bricks)
    thin = min(min(brick.dimensions) for brick in scene.bricks)
    assert distance.min(initial=0.0) >= -1e-6 * thin
    assert not [*_find_warnings(scene)]
    joined = {frozenset(joint.bricks) for joint in scene.joints}
    assert len(joined) == len(scene.joints)
    place = {brick.name: brick.position for brick in scene.bricks}
    longest = max(math.hypot(*brick.dimensions) for brick in scene.bricks)
    assert all(math.dist(*(place[name] for name in pair)) < longest for pair in joined)


@settings(max_examples=8)
@given(scene=GENERATED)
def test_every_joint_lies_between_the_faces_of_its_bricks(scene):
    """The contact checks say so: gap, overlap, position. Areas are those that contact finds."""
    network = build_network(scene)
    count = len(scene.bricks)
    assembly = bare_assembly(network, count)
    assert (assembly.area > 0).all()
    if scene.name.startswith(("wall", "vault")):  # in a chain joints have one stiffness
        stiffness = network.springs.translational_stiffness[network.springs.acting(count), 0]
        assert stiffness == pytest.approx(1.5e9 * assembly.area, rel=1e-9)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: chain(1), "chain: bricks is 1; give a whole number from 2"),
        (
            lambda: chain(3),
            "chain of 3: bricks 2 and 3 interpenetrate by 17.6 mm; give more bricks",
        ),
        (lambda: WallShape(columns=0, courses=1), "wall: columns is 0; give a whole number"),
        (
            lambda: arch(ArchForm(span=2.0, rise=1.2)),
            "arch: rise is 1.2 m; a circular arch rises at most half of its span, 1: give less",
        ),
        (
            lambda: arch(ArchForm(span=2.0, rise=0.7, bricks=40)),
            "arch: 40 bricks are longer than its curve; give fewer than 40",
        ),
        (
            lambda: arch(ArchForm(span=2.0, rise=0.7, bricks=5)),
            "arch: joints between 5 bricks would be wider than 30 mm; give more than 5",
        ),
        (
            lambda: arch(ArchForm(span=1.0, rise=0.5, bricks=7, dimensions=(0.2, 0.1, 0.15))),
            "arch of 7: bricks . and . interpenetrate by .* mm; give another number of bricks",
        ),
        (lambda: chain(10**9), "chain: bricks is 1000000000; give a whole number from 2 to 20000"),
        (lambda: arch(ArchForm(span=1e9, rise=7.0)), "arch: .* bricks; give numbers that make at"),
        (lambda: _scene_by_words("arch:span=1e300,rise=7"), "numbers are too large; give smaller"),
    ],
)
def test_one_line_says_what_is_wrong(make, named):
    with pytest.raises(SceneError, match=named) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_bricks_that_are_apart_have_no_joint():
    words = "vault:span=2,rise=0.8,columns=2,courses=25,dimensions=0.05x0.1x0.06,gap=0.06"
    with pytest.raises(SceneError, match=r"joint \(1, 3\): the faces of its bricks do not overlap"):
        load_scene(words)
