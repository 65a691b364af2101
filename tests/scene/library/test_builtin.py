"""Scenes that are built in, and arches by their form."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st

from seqopt.contact.assembly import bare_assembly
from seqopt.errors import SceneError
from seqopt.exchange._doubts import find_doubts
from seqopt.network.network import build_network
from seqopt.scene.boxes import _boxes, _separations, box_corners
from seqopt.scene.library import ArchForm, WallShape, arch, chain, wall
from seqopt.scene.scene_file import ABOUT, _parse_scene, builtin_scenes, dump_scene, load_scene
from seqopt.scene.shape import clip, polygon_moments
from tests.refusals import one_line

PRINTED = (2.670, 4.350)  # m; sides of the plan, section 3.1 of Bruun et al.
NARROWEST, WIDEST = 0.0015, 0.0265  # m; between the faces of bricks that touch


@pytest.fixture(scope="module")
def vault():
    return load_scene("vault338")


def own_pairs(scene, bricks):
    """Pairs of which one at least is not of the arch, and how far they are apart."""
    pairs, distance = _separations(bricks)
    kept = pairs.max(axis=1) >= 25
    names = np.array([brick.name for brick in bricks])
    return {frozenset(pair) for pair in names[pairs[kept]].tolist()}, distance[kept], pairs[kept]


@pytest.mark.parametrize("name", builtin_scenes())
def test_every_built_in_scene_is_named_drawn_from_text_and_not_odd(name):
    scene = load_scene(name)
    assert scene.name == name
    assert scene.provenance
    assert not [*find_doubts(scene)]
    assert ABOUT[name]
    assert "\n" not in ABOUT[name]
    assert _parse_scene(dump_scene(scene)) == scene
    assert load_scene(name) == scene


@pytest.mark.parametrize("name", builtin_scenes())
def test_bricks_of_built_in_scenes_touch_and_do_not_interpenetrate(name):
    scene = load_scene(name)
    _, distance = _separations(scene.bricks)
    assert distance.min() > 0
    assembly = bare_assembly(build_network(scene), len(scene.bricks))
    assert (assembly.area > 0).all()


def test_the_vault_has_the_printed_count_and_plan(vault):
    assert len(vault.bricks) == 338
    corners = box_corners(vault.bricks).reshape(-1, 3)
    assert np.ptp(corners, axis=0)[:2] == pytest.approx(PRINTED, abs=0.001)


def test_the_vault_starts_with_the_arch(vault, arch25):
    assert vault.placed[:25] == arch25.placed
    assert vault.joints[:24] == arch25.joints
    assert vault.grounds[:2] == arch25.grounds
    assert vault.build_order == tuple(range(1, 339))
    later = vault.bricks[25:]
    assert {(b.dimensions, b.density) for b in later} == {((0.246, 0.116, 0.053), 2420.0)}


def test_bricks_of_the_vault_are_a_joint_apart_and_all_neighbors_are_joined(vault):
    pairs, distance, _ = own_pairs(vault, vault.bricks)
    assert distance.min() > NARROWEST
    every, apart = _separations(vault.bricks)
    names = np.array([brick.name for brick in vault.bricks])
    near = {*map(frozenset, names[every][apart < 2 * WIDEST].tolist())}
    assert near == {frozenset(joint.bricks) for joint in vault.joints}
    assert near - pairs == {frozenset(joint.bricks) for joint in vault.joints[:24]}


def test_stiffness_of_the_vault_is_that_of_the_arch_by_contact_area(vault, arch25):
    assembly = bare_assembly(build_network(vault), 338)
    index = {brick.name: i for i, brick in enumerate(vault.placed)}
    area = dict(zip(map(tuple, assembly.bodies.tolist()), assembly.area, strict=True))
    given = arch25.joints[0]
    for joint in vault.joints[24:]:
        share = area[tuple(sorted(index[b] for b in joint.bricks))] / (0.116 * 0.053)
        for name in ("translational_stiffness", "rotational_stiffness"):
            wanted = share * np.array(getattr(given, name))
            assert getattr(joint, name) == pytest.approx(wanted, rel=1e-9)


def pushed(brick, way):
    place = np.array(brick.position) + 0.03 * np.array(way)
    return replace(brick, position=tuple(place.tolist()))


@pytest.mark.parametrize(
    "change",
    [
        lambda b: pushed(b, b.length_axis),
        lambda b: pushed(b, b.width_axis),
        lambda b: replace(b, dimensions=(0.296, 0.166, 0.053)),
    ],
)
def test_a_moved_or_swollen_brick_is_found(vault, change):
    """Negative control of the check that nothing interpenetrates."""
    moved = [change(b) if b.name == 200 else b for b in vault.bricks]
    _, distance, _ = own_pairs(vault, moved)
    assert distance.min() < 0


def test_the_dome_is_round_and_of_the_size_of_benchmarks():
    scene = load_scene("dome163")
    assert len(scene.bricks) == 163
    lowest = _boxes(scene.bricks[:22])[0]
    assert np.ptp(np.linalg.norm(lowest[:, :2], axis=1)) < 1e-12


# laws of generated scenes: nothing interpenetrates, all touch, and engines agree on them
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
    assert not [*find_doubts(scene)]
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


# arches by span and rise; where faces overlap
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


RISE = "arch: rise is 1.2 m; a circular arch rises at most half of its span, 1: give less"
LONG = "arch: 40 bricks, 8 m together, are longer than its curve; give shorter ones, or fewer"
WIDE = "arch: joints between 5 bricks would be wider than 30 mm; give more of them"
THICK = "arch:span=1,rise=0.5,bricks=7,dimensions=0.2x0.1x0.15"
INTO = "arch of 7: bricks . and . interpenetrate by .* mm; give another number of bricks"
APART = "vault:span=2,rise=0.8,columns=2,courses=25,dimensions=0.05x0.1x0.06,gap=0.06"
WRONG = {  # words, and what is said of them
    "chain:bricks=1": "chain: bricks is 1; give a whole number from 2",
    "chain:bricks=3": "chain of 3: bricks 2 and 3 interpenetrate by 17.6 mm; give more bricks",
    "chain:bricks=1000000000": "chain: bricks is 1000000000; give a whole number from 2 to 20000",
    "wall:columns=0,courses=1": "wall: columns is 0; give a whole number",
    "wall:columns=2.5,courses=2": "columns is '2.5'; give a whole number, as 12",
    "wall:columns=4": "courses is missing; a wall in running bond: wall:columns=6",
    "wall:columns=4,courses=0": "wall: courses is 0; give a whole number from 1",
    "arch:spn=2": r"'spn' is none of its numbers \(did you mean span\?\); give span, rise",
    "arch:span=x": "span is 'x'; give a number alone, as 0.5",
    "arch:span=2,rise=1,dimensions=1x2": "dimensions is '1x2'; give it as 0.2x0.1x0.06",
    "arch:span=2,rise=1.2": RISE,
    "arch:span=2,rise=.7,bricks=40": LONG,
    "arch:span=2,rise=0.7,bricks=5": WIDE,
    "arch:span=2,rise=0.7,dimensions=200x100x60": "arch: 2 bricks, 400 m together, are longer",
    "arch:span=2,rise=0.7,gap=10": "wider than 30 mm; give more of them, longer ones, or a smaller",
    THICK: INTO,
    "arch:span=1e9,rise=7": "arch: .* bricks; give numbers that make at",
    "arch:span=1e300,rise=7": "numbers are too large; give smaller",
    APART: r"joint \(1, 3\): the faces of its bricks do not overlap",
}


@pytest.mark.parametrize("words", WRONG)
def test_words_that_make_no_scene(words):
    with one_line(SceneError, WRONG[words]):
        load_scene(words)


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
