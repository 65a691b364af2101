"""Where blocks touch; blocks of a mesh are found where its faces close."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from seqopt._cli.main import main
from seqopt.errors import SceneError, SceneWarning
from seqopt.exchange._content import Given
from seqopt.exchange._mesh_files import read_obj
from seqopt.exchange._meshes import repair_shape
from seqopt.exchange.contacts import face_ground, face_joint, flat_face, touching_faces
from seqopt.exchange.imports import import_scene, read_content
from seqopt.scene._checks import as_vectors
from seqopt.scene.library.common import MASONRY, _touching_order
from seqopt.scene.scene_file import load_scene
from seqopt.scene.shape import Polyhedron
from tests.blocks import C_SHAPE, L_SHAPE, box, prism
from tests.documents import HIGH, LOW, TOP, obj

GAP = 1e-3


def areas(shapes, gap=GAP):
    return {blocks: face.area for blocks, face in touching_faces(shapes, gap)}


def test_boxes_on_boxes():
    low, high = box((2, 1, 1)), box((2, 1, 1), at=(0.5, 0.25, 1.0))
    ((blocks, found),) = touching_faces([low, high], GAP)
    assert blocks == (0, 1)
    assert found.axes[0] == pytest.approx([0, 0, 1])
    assert found.area == pytest.approx(1.5 * 0.75)
    assert found.center == pytest.approx([1.25, 0.625, 1.0])
    assert found.moments == pytest.approx((1.5 * 0.75**3 / 12, 0.75 * 1.5**3 / 12))


@pytest.mark.parametrize(("apart", "touch"), [(0.0, 1), (0.9 * GAP, 1), (-0.9 * GAP, 1), (2e-3, 0)])
def test_a_gap_is_allowed_up_to_its_width(apart, touch):
    shapes = [box((1, 1, 1)), box((1, 1, 1), at=(0, 0, 1 + apart))]
    assert len(touching_faces(shapes, GAP)) == touch


def test_blocks_that_share_an_edge_or_a_corner_do_not_touch():
    assert touching_faces([box((1, 1, 1)), box((1, 1, 1), at=(1, 0, 1))], GAP) == ()
    assert touching_faces([box((1, 1, 1)), box((1, 1, 1), at=(1, 1, 1))], GAP) == ()


def test_a_face_that_is_not_convex_is_cut_into_pieces_that_are():
    """A plate on an L: the whole L; a C inside a C: three arms."""
    for outline, area in ((L_SHAPE, 4.0), (C_SHAPE, 7.0)):
        shapes = [prism(outline), prism(outline, at=(0, 0, 1))]
        faces = touching_faces(shapes, GAP)
        assert 2 <= len(faces) <= 3
        flats = [flat for _, flat in faces]
        assert sum(flat.area for flat in flats) == pytest.approx(area)
        assert all(face_joint((1, 2), flat, MASONRY).face for flat in flats)


def test_what_cannot_touch_is_one_line():
    with pytest.raises(SceneError, match="gap is 'x'; give a positive number"):
        touching_faces([box((1, 1, 1))], "x")
    with pytest.raises(SceneError, match="shapes: 3 is not a shape; give each as Polyhedron"):
        touching_faces([3], GAP)
    with pytest.raises(SceneError, match="a face has no area"):
        flat_face([[0, 0, 0], [1, 0, 0], [2, 0, 0]])


def test_blocks_without_number_in_one_place_are_refused(monkeypatch):
    monkeypatch.setattr("seqopt.exchange.contacts._MOST_PAIRS", 5)
    with pytest.raises(SceneError, match="more than 5 pairs of blocks are in one place"):
        touching_faces([box((1, 1, 1))] * 4, GAP)


def test_a_turned_assembly_touches_as_it_did():
    frame = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    shapes = [prism(L_SHAPE), box((2, 1, 1), at=(0.5, 0.3, 1.0)), box((1, 1, 1), at=(3, 0, 0))]
    turned = [replace(s, vertices=as_vectors(s.points @ frame.T + 5.0)) for s in shapes]
    assert areas(turned) == pytest.approx(areas(shapes))


def test_joints_and_ground_ends_over_a_face():
    """A bed of springs: the stiffness is area, and second moments, times the law's."""
    corners = np.array([[0, 0, 2], [0.4, 0, 2], [0.4, 0.2, 2], [0, 0.2, 2]])
    face = flat_face(corners, np.array([0.0, 0.0, -1.0]))
    joint = face_joint((1, 2), face, MASONRY)
    assert joint.along == pytest.approx((0, 0, -1))
    assert abs(joint.across[0]) == pytest.approx(1.0)
    assert joint.translational_stiffness == pytest.approx((1.2e8, 1.2e7, 1.2e7))
    about_x, about_y = 0.4 * 0.2**3 / 12, 0.2 * 0.4**3 / 12
    expected = (1.5e8 * (about_x + about_y), 1.5e9 * about_x, 1.5e9 * about_y)
    assert joint.rotational_stiffness == pytest.approx(expected)
    found = {tuple(np.round(c, 9)) for c in joint.corners}
    assert found == {tuple(c) for c in corners.tolist()}
    ground = face_ground(1, flat_face(corners, np.array([0.0, 0.0, 1.0])), MASONRY, stub=0.1)
    assert ground.anchor == pytest.approx((0.2, 0.1, 1.9))


# blocks of a mesh are found where its faces close, mended or refused, and put into an order


def wedge(first, second):
    """A voussoir between two angles; neighbors share four corners."""
    outline = [(r * np.cos(t), r * np.sin(t)) for t in (first, second) for r in (1.0, 1.2)]
    around = [outline[k] for k in (0, 1, 3, 2)]
    points = np.array([(x, y, z) for y in (0.0, 0.3) for x, z in around])
    sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
    return Polyhedron(as_vectors(points), [(3, 2, 1, 0), (4, 5, 6, 7), *sides])


ANGLES = np.linspace(np.pi, 0.0, 16)
SHAPES = [wedge(a, b) for a, b in pairwise(ANGLES)]


def shared(shapes):
    """OBJ of blocks as one mesh of triangles, whose corners in one place are one."""
    corners = np.vstack([shape.points for shape in shapes]).round(9)
    points, place = np.unique(corners, axis=0, return_inverse=True)
    out, before = ["v {} {} {}".format(*row) for row in points], 0
    for shape in shapes:
        own = 1 + place.reshape(-1)[before:][: len(shape.points)]
        fans = [(f[0], f[k], f[k + 1]) for f in shape.faces for k in range(1, len(f) - 1)]
        out += ["f {} {} {}".format(*own[list(face)]) for face in fans]
        before += len(shape.points)
    return "\n".join(out) + "\n"


def loose(*, turned=False):
    """OBJ in which every face has vertices of its own, and there are no names; or its y is up."""
    out, before = [], 1
    for shape in SHAPES:
        for face in shape.faces:
            corners = shape.points[list(face)]
            corners = corners[:, [0, 2, 1]] * [1, 1, -1] if turned else corners
            out += ["v {:.6f} {:.6f} {:.6f}".format(*corner) for corner in corners]
            out.append("f " + " ".join(str(before + k) for k in range(len(face))))
            before += len(face)
    return "\n".join(out) + "\n"


FILES = {"shared.obj": lambda: shared(SHAPES), "loose.obj": loose}


@pytest.mark.parametrize("name", FILES)
def test_an_arch_is_its_bricks_without_names(name, tmp_path):
    path = tmp_path / name
    path.write_text(FILES[name](), "utf-8")
    blocks = read_content(path).blocks
    assert [block.key for block in blocks] == [str(i) for i in range(len(SHAPES))]
    for block, shape in zip(blocks, SHAPES, strict=True):
        solid = repair_shape(block).solid
        assert solid.volume == pytest.approx(shape.volume, rel=1e-4)
        np.testing.assert_allclose(solid.centroid, shape.centroid, atol=1e-5)
    scene = import_scene(path, given=Given(unit="m", density=2000.0))
    assert (len(scene.bricks), len(scene.joints), len(scene.grounds)) == (15, 14, 2)


def keys(text):
    return {block.key: len(block.faces) for block in read_obj(text, "file").blocks}


def test_blocks_keep_the_names_of_objects_and_groups():
    assert keys(obj(LOW, HIGH, TOP)) == {"block_0": 6, "block_1": 6, "block_2": 6}
    grouped = obj(LOW, HIGH).replace("o block_0", "o all\ng low one").replace("o block_", "g ")
    assert keys(grouped) == {"low one": 6, "1": 6}
    assert keys(obj(LOW, HIGH).replace("o block_1\n", "")) == {"block_0": 6, "block_0-2": 6}
    assert keys(obj(LOW, HIGH).replace("o block_0\n", "")) == {"0": 6, "1": 6}


def lines(text, kind):
    return [line for line in text.splitlines() if line.startswith(kind)]


def test_faces_in_turn_from_two_blocks_are_two_blocks():
    text = obj(LOW, box((1.0, 1.0, 1.0), at=(9.0, 0.0, 0.0)))
    faces = lines(text, "f")
    mixed = [face for pair in zip(faces[:6], faces[6:], strict=True) for face in pair]
    assert keys("\n".join([*lines(text, "v"), *mixed])) == {"0": 6, "1": 6}


def test_blocks_that_share_a_vertex_alone_are_two():
    first, second = box((1.0, 1.0, 1.0)), box((1.0, 1.0, 1.0), at=(1.0, 1.0, 1.0))
    text = shared([first, second])
    assert len(lines(text, "v")) == 15
    assert len(keys(text)) == 2


def test_what_is_open_is_said_to_be_open(tmp_path):
    """Also where every face has vertices of its own, so that none says what belongs together."""
    path = tmp_path / "open.obj"
    path.write_text(loose().rsplit("f ", 1)[0], encoding="utf-8")
    last = len(SHAPES) - 1
    with pytest.raises(SceneError, match=f"block {last}: shape: edge .* close the shape"):
        import_scene(path, given=Given(unit="m", density=2000.0))


def test_a_file_whose_y_is_up_stands_if_that_is_said(tmp_path):
    """An arch that lies on its side rests on the ground with all blocks: a doubt, and a way out."""
    path = tmp_path / "arch.obj"
    path.write_text(loose(turned=True), encoding="utf-8")
    with pytest.warns(SceneWarning, match=r"15 of 15 blocks rest on the ground; .* \(--up y\)"):
        lying = import_scene(path, given=Given(unit="m", density=2000.0))
    assert len(lying.grounds) == 15
    scene = import_scene(path, given=Given(unit="m", density=2000.0, up="y"))
    assert len(scene.grounds) == 2
    for brick, shape in zip(scene.bricks, SHAPES, strict=True):
        np.testing.assert_allclose(brick.position, shape.centroid, atol=1e-5)
    with pytest.raises(SceneError, match="up is 'x'; give one of z, y"):
        import_scene(path, given=Given(unit="m", density=2000.0, up="x"))
    out = tmp_path / "scene.json"
    words = ["--unit", "m", "--density", "2000", "--up", "y", "--out", str(out)]
    assert main(["import", str(path), *words]) == 0
    assert load_scene(out).grounds == scene.grounds


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


@given(
    count=st.integers(1, 12),
    links=st.lists(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=30),
    rank=st.lists(st.integers(0, 5), min_size=12, max_size=12),
)
def test_each_touches_what_stands(count, links, rank):
    pairs = [(a, b) for a, b in links if a < count and b < count and a != b]
    order = _touching_order(rank[:count], pairs, [0])
    reached, before = {0}, set()
    while reached != before:
        before = set(reached)
        reached |= {b for pair in pairs for a, b in (pair, pair[::-1]) if a in reached}
    assert sorted(order) == sorted(reached)
    for k, i in enumerate(order):
        assert i == 0 or any({i, j} in ({a, b} for a, b in pairs) for j in order[:k])
