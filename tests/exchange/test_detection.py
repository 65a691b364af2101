"""Where blocks touch: areas in closed form, pieces that are convex, and joints over them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seqopt.errors import SceneError
from seqopt.exchange.contacts import face_ground, face_joint, flat_face, touching_faces
from seqopt.scene.boxes import as_vectors
from seqopt.scene.library.common import MASONRY
from tests.blocks import C_SHAPE, L_SHAPE, box, prism

GAP = 1e-3


def areas(shapes, gap=GAP):
    return {f.blocks: flat_face(f.corners, f.normal).area for f in touching_faces(shapes, gap)}


def test_boxes_on_boxes():
    low, high = box((2, 1, 1)), box((2, 1, 1), at=(0.5, 0.25, 1.0))
    (face,) = touching_faces([low, high], GAP)
    assert face.normal == pytest.approx([0, 0, 1])
    found = flat_face(face.corners, face.normal)
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
        flats = [flat_face(face.corners, face.normal) for face in faces]
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
