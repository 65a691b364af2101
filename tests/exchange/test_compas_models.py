"""Models of COMPAS are read as they are meant, and files by what is in them."""

import copy
import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from seqopt._cli.main import main
from seqopt.errors import FileError, SceneError, SceneWarning
from seqopt.exchange._building import _touching_order
from seqopt.exchange._compas_models import read_model
from seqopt.exchange._content import Given
from seqopt.exchange._formats import read_file
from seqopt.exchange._meshes import read_obj, repair_shape
from seqopt.exchange.contacts import face_ground, face_joint, flat_face, touching_faces
from seqopt.exchange.imports import import_scene
from seqopt.scene._checks import as_vectors
from seqopt.scene.library.common import MASONRY
from seqopt.scene.scene_file import _parse_scene, dump_scene, load_scene
from seqopt.scene.shape import Polyhedron
from tests.blocks import C_SHAPE, L_SHAPE, box, prism
from tests.documents import BOXES, DOCUMENTS, HIGH, LOW, TOP, element, matrix, model, nested, obj
from tests.refusals import one_line

LYING = matrix([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0]])
# of `nested`, as ``modelgeometry.aabb()`` of compas_model 0.9.3 gives them: lowest and highest
BY_COMPAS = {
    "1": ((0.002, 0.0185, 0.0), (0.003, 0.019, 0.002)),
    "2": ((0.003, 0.0175, 0.00025), (0.0035, 0.0185, 0.00125)),
    "3": ((0.0, 0.0125, 0.0), (0.002, 0.013, 0.001)),
}


def corners(block):
    return np.array([block.vertices.min(axis=0), block.vertices.max(axis=0)])


def test_blocks_stand_where_compas_places_them():
    content = read_model(nested(), "nested")
    assert [block.key for block in content.blocks] == list(BY_COMPAS)
    for block in content.blocks:
        np.testing.assert_allclose(corners(block), BY_COMPAS[block.key], atol=1e-15)
    assert content.said == ("1 groups only place what is in them",)


def affine(draw):
    out = np.eye(4)
    turn = draw(st.tuples(*[st.floats(-3, 3)] * 3))
    out[:3, :3] = draw(st.sampled_from((1e-3, 1.0, 2.0))) * Rotation.from_rotvec(turn).as_matrix()
    out[:3, 3] = draw(st.tuples(*[st.floats(-5, 5)] * 3))
    return out


@st.composite
def trees(draw):
    """A model of blocks in a tree, and where each of them belongs."""
    whole = affine(draw)
    placed, nodes, rows = [], [], []
    root = {"children": []}
    for i in range(draw(st.integers(1, 6))):
        above = draw(st.integers(-1, i - 1))
        own = affine(draw)
        placed.append((placed[above] if above >= 0 else whole) @ own)
        nodes.append({"element": str(i), "children": []})
        (nodes[above] if above >= 0 else root)["children"].append(nodes[i])
        shape = box((1.0, 2.0, 3.0))
        rows.append(element(str(i), shape, transformation=matrix(own[:3].tolist())))
    order = draw(st.permutations(range(len(rows))))
    data = {
        "transformation": matrix(whole[:3].tolist()),
        "elements": {str(i): rows[i] for i in order},
        "tree": {"root": root},
    }
    return {"dtype": "compas_dem.models/BlockModel", "data": data}, [placed[i] for i in order]


@given(trees())
def test_transformations_are_composed_from_the_model_down(drawn):
    document, placed = drawn
    local = np.array(box((1.0, 2.0, 3.0)).vertices)
    for block, at in zip(read_model(document, "tree").blocks, placed, strict=True):
        np.testing.assert_allclose(block.vertices, local @ at[:3, :3].T + at[:3, 3], atol=1e-12)


def turned():
    document = model()
    document["data"] |= {"transformation": LYING}
    return document


def test_faces_follow_blocks_that_compas_moved(read):
    """COMPAS moves the blocks of a model, and leaves the contacts where it found them."""
    lying = read("lying.json", turned(), Given(unit="m"))
    assert [round(brick.position[1], 9) for brick in lying.placed] == [-0.75, -1.25]
    assert [round(spring.position[1], 9) for spring in (*lying.grounds, *lying.joints)] == [
        -0.5,
        -1.0,
    ]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"tree": {"root": {"children": [{"element": "x"}]}}}, "element 'x' of the tree is not"),
        ({"tree": {"root": {"children": [{"element": "a"}] * 2}}}, "tree occurs twice"),
        (
            {"transformation": {"matrix": [*[[1, 0, 0, 0]] * 3, [0, 0, 1, 1]]}},
            r"ends in \[0.0, 0.0, 1.0, 1.0\]; give a matrix that ends in 0, 0, 0, 1",
        ),
    ],
)
def test_a_tree_that_is_none_is_one_line(change, said):
    document = copy.deepcopy(model())
    document["data"] |= change
    with pytest.raises(SceneError, match=said):
        read_model(document, "m")


# what files of others say becomes what they mean, whichever version wrote them
METERS = Given(unit="m", density=2400.0)


@pytest.fixture
def read(tmp_path):
    """Import a document, text or bytes under a name."""

    def import_one(name, content, given=METERS, form=None):
        path = tmp_path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            text = content if isinstance(content, str) else json.dumps(content)
            path.write_text(text, encoding="utf-8")
        return import_scene(path, form, given)

    return import_one


def measures(scene):
    """Masses by name, and areas of joints and ground ends by their stiffness."""
    masses = {brick.name: round(brick.mass, 6) for brick in scene.bricks}
    areas = [round(spring.translational_stiffness[0] / 1.5e9, 9) for spring in scene.joints]
    ends = [round(spring.translational_stiffness[0] / 1.5e9, 9) for spring in scene.grounds]
    return masses, areas, ends


@pytest.mark.parametrize(
    ("name", "masses", "areas", "ends"),
    [
        ("assembly", {4: 1200.0, 7: 2400.0}, [1.0], [1.0]),
        ("legacy", {0: 2400.0, 1: 1200.0, 2: 2400.0}, [1.0, 1.0], [2.0]),
        ("model", {1: 1000.0, 2: 2000.0}, [1.0], [1.0]),
        ("meshes", {0: 2400.0, 1: 1200.0, 2: 2400.0}, [1.0, 1.0], [2.0]),
    ],
)
def test_blocks_faces_and_supports(read, name, masses, areas, ends):
    scene = read(f"{name}.json", DOCUMENTS[name])
    assert measures(scene) == (masses, areas, ends)
    assert _parse_scene(dump_scene(scene)) == scene
    heights = [brick.position[2] for brick in scene.placed]
    assert heights == sorted(heights)


def test_meshes_of_every_kind(read):
    parts = [LOW, HIGH, TOP]
    scene = read("wall.obj", obj(*parts))
    assert measures(scene) == ({0: 2400.0, 1: 1200.0, 2: 2400.0}, [1.0, 1.0], [2.0])
    assert "numbered as in their names: block_0 is 0, block_1 is 1" in scene.provenance
    names = obj(*parts).replace("block_1", "sill")
    assert "from 1 in the file's order: block_0 is 1, sill is 2" in read("a.obj", names).provenance
    assert len(scene.bricks[0].shape.faces) == 6  # polygons stay what they are


def test_a_table_of_boxes(read):
    scene = read("boxes.csv", BOXES)
    assert measures(scene) == ({2: 1200.0}, [], [1.0])
    turned = BOXES.replace(",90,", ",45,")
    assert read("boxes.csv", turned).bricks[0].mass == pytest.approx(1200.0)
    names = BOXES.replace("yaw,support", "yaw,name").replace(",0,1\n", ",0,base\n")
    assert "numbered from 1" in read("boxes.csv", names.replace(",90,", ",90,top")).provenance


TWINS = "x,y,z,length,width,height,name,density\n0,0,1,2,1,2,a1,9\n0,0,2.5,2,1,1,a1,9\n"
MASSES = "x,y,z,length,width,height,mass\n0,0,.03,.2,.1,.06,2.4\n0,0,.09,.2,.1,.06,1.92\n"


def test_masses_of_a_table_become_densities(read):
    """2.4 kg in 0.2 x 0.1 x 0.06 m are 2,000 kg/m³; a density beside it must agree."""
    small = MASSES.replace(".2,.1,.06", "200,100,60").replace(".03", "30").replace(".09", "90")
    for table, unit in ((MASSES, "m"), (small, "mm")):
        scene = read("boxes.csv", table, Given(unit=unit))
        assert [brick.mass for brick in scene.bricks] == pytest.approx([2.4, 1.92])
        assert [brick.density for brick in scene.bricks] == pytest.approx([2000.0, 1600.0])
    assert "density of 2 blocks is their mass over their volume" in scene.provenance
    both = (
        MASSES.replace("mass", "mass,density").replace("2.4", "2.4,2000").replace("92", "92,1600")
    )
    assert read("boxes.csv", both, METERS).bricks[1].density == pytest.approx(1600.0)
    half = MASSES.replace(",1.92", ",")
    assert [b.density for b in read("boxes.csv", half).bricks] == pytest.approx([2000.0, 2400.0])
    with pytest.raises(SceneError, match="block 2 has no density"):
        read("boxes.csv", half, Given(unit="m"))


def test_a_surface_that_is_ground_is_told_how_to_say_so(read):
    floor = "o Floor 3\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf -4 -3 -2 -1\n"
    wall = obj(LOW, HIGH) + floor
    with pytest.raises(
        SceneError, match=r'block Floor 3: .*; if it is ground, say --supports "Flo'
    ):
        read("a.obj", wall)
    scene = read("a.obj", wall, Given(unit="m", density=2400.0, supports=["Floor 3"]))
    assert (len(scene.bricks), len(scene.joints), len(scene.grounds)) == (2, 1, 1)


LINE = {"dtype": "compas.geometry/Line", "data": {"start": [0, 0, 0], "end": [0, 0, 3]}}


def test_lines_are_no_blocks(read):
    for document in ({"lines": [LINE]}, [LINE, LINE], LINE, {"a": LINE}):
        with pytest.raises(SceneError, match=r"left out: line\. Lines, .* no blocks: give mesh"):
            read("a.json", document)
    scene = read("a.json", [*DOCUMENTS["meshes"], LINE])
    assert len(scene.bricks) == 3
    assert "1 objects are left out: line" in scene.provenance
    with pytest.raises(SceneError, match="it has no faces; points and lines are no blocks: give c"):
        read("a.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n")


def bent(index=4, by=0.01):
    """The lowest block with a corner that is off: three faces are not flat."""
    rows = [list(row) for row in LOW.vertices]
    rows[index][0] += by
    rows[index][2] += by
    return rows


def test_what_can_be_mended_is_mended_and_said(read):
    faces = [list(face) for face in LOW.faces]
    vertex = {str(i): dict(zip("xyz", row, strict=True)) for i, row in enumerate(bent())}
    crooked = {"vertex": vertex, "face": {str(i): face for i, face in enumerate(faces)}}
    assert "cut into triangles: 2" in read("a.json", [crooked]).provenance
    flat = {"vertices": [list(row) for row in LOW.vertices], "faces": faces}
    inside_out = {**flat, "faces": [face[::-1] for face in faces]}
    assert "all agree which side is outside: 6" in read("a.json", [inside_out]).provenance
    one_turned = {**flat, "faces": [faces[0][::-1], *faces[1:]]}
    assert "all agree which side is outside: 1" in read("a.json", [one_turned]).provenance
    doubled = {**flat, "faces": [*faces, *(face[::-1] for face in faces)]}
    with pytest.raises(SceneError, match="blocks 0 and 1 interpenetrate"):
        read("a.json", [doubled])
    each = {**flat, "faces": [side for face in faces for side in (face, face[::-1])]}
    assert "twice are left out: 6" in read("a.json", [each]).provenance
    soup = {
        "vertices": [list(LOW.vertices[v]) for face in faces for v in face],
        "faces": [[4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3] for i in range(6)],
    }
    scene = read("a.json", [soup])
    assert "in one place are united: 16" in scene.provenance
    assert scene.bricks[0].mass == pytest.approx(2400.0)


LACKING = {  # what the assembly is given: what is said
    "does not say its unit of length": {"unit": None},
    "block 4 has no density; give one": {"density": None},
    "robots is 0": {"robots": 0},
    "there is no block '5'; known are '0, 4, 7'": {"supports": ["5"]},
    "all blocks are supports": {"supports": ["0", "4", "7"]},
    "gap is 0": {"gap": 0.0},
}


@pytest.mark.parametrize("said", LACKING)
def test_what_an_assembly_lacks_is_one_line(read, said):
    with one_line(SceneError, said):
        read("a.json", DOCUMENTS["assembly"], replace(METERS, **LACKING[said]))


WRONG = {  # what is said: a file and what is in it
    "1 blocks touch nothing": ("a.obj", obj(LOW, box((1, 1, 1), at=(0, 0, 5)))),
    "it has no faces": ("a.obj", "v 0 0 0\n"),
    "line 2: there is no vertex '2'; 1 stand before": ("a.obj", "v 0 0 0\nf 1 2 3\n"),
    "one side only; close": ("a.obj", obj(LOW).replace("f 4//1 3//1 2//1 1//1\n", "")),
    "a .stl cannot be read; open it in Rhino or Blender": ("a.stl", b"solid x\nfacet"),
    "column 'angle' is not known": ("a.csv", BOXES.replace("yaw", "angle")),
    "row 2: x is 'nan'; give a number": ("a.csv", BOXES.replace(".75,", "nan,", 1)),
    "more cells than the": ("a.csv", BOXES + "0,0,9,1,1,1,90,1,1,1,1,1,1,1\n"),
    "block a1 occurs twice; give each its own name": ("a.csv", TWINS),
    "row 1: mass is -2.4; give a positive nu": ("a.csv", MASSES.replace("2.4", "-2.4")),
    "block 1: its mass of 2.4 kg is 2000 kg/m³ in 0.0012 m³, its density 1800 kg/m³; give": (
        "a.csv",
        MASSES.replace("mass", "mass,density").replace("2.4", "2.4,1800"),
    ),
    "its format is not known; give one of compas_assembly": ("a.xyz", "0 0 0\n"),
    "a .dxf cannot be read; open it in Rhino or FreeCAD, and export closed meshes": (
        "a.dxf",
        "0\nSECTION\n",
    ),
    "not JSON, line 1": ("a.json", "{"),
    "NaN stands where a number should": ("a.json", '{"node": NaN}'),
    "a scene of seqopt already": ("a.json", {"format": "seqopt-scene"}),
    "no assembly that is known": ("a.json", {"unit": "meter", "nodes": []}),
    "a scene cannot be read": ("a.json", {"dtype": "compas.scene/Scene", "data": {}}),
    "block 0 is None": ("a.json", {"node": {"0": {"block": None}}}),
    "a finite number up to 1e": ("a.json", [{"vertices": [[0, 0, 1e300]] * 4, "faces": []}]),
    "there is no vertex 1": ("a.json", [{"vertex": {}, "face": {"0": [1]}}]),
}


@pytest.mark.parametrize("said", WRONG)
def test_what_a_file_has_wrong_is_one_line(read, said):
    with one_line(SceneError, said) as caught:
        read(*WRONG[said])
    assert len(str(caught.value)) < 600


def test_what_is_no_file_or_too_large_is_refused(tmp_path, monkeypatch):
    with pytest.raises(FileError, match="cannot read"):
        import_scene(tmp_path / "none.json")
    monkeypatch.setattr("seqopt._files._LARGEST_INPUT", 10)
    path = tmp_path / "large.obj"
    path.write_bytes(b"x" * 11)
    with pytest.raises(FileError, match="more than"):
        import_scene(path)


def test_an_assembly_of_nobodys_size_is_refused(read, monkeypatch):
    monkeypatch.setattr("seqopt.exchange._building.MOST_CORNERS", 60)
    with pytest.raises(SceneError, match="its blocks have 72 corners; 60 is the most"):
        read("a.json", DOCUMENTS["assembly"])


# where blocks touch; blocks of a mesh are found where its faces close
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
    blocks = read_file(path).blocks
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


def test_what_is_open_is_said_to_be_open(read):
    """Also where every face has vertices of its own, so that none says what belongs together."""
    last = len(SHAPES) - 1
    with pytest.raises(SceneError, match=f"block {last}: shape: edge .* close the shape"):
        read("open.obj", loose().rsplit("f ", 1)[0])


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


TOWER = [box((0.4, 0.2, 0.1), at=(0.0, 0.0, 0.1 * i)) for i in range(3)]


def test_faces_without_area_are_no_blocks(read):
    """As programs write them that cut every face into triangles."""
    assert len(read("tower.obj", obj(*TOWER) + "f 4 4 8\nf 4 8 8\n").bricks) == len(TOWER)


def test_faces_inside_a_block_are_named(read):
    """A wall across an L, between edges of which each has two faces without it."""
    shape, corners = prism(L_SHAPE, 0.1, at=(0.0, 0.0, 0.1)), len(L_SHAPE)
    wall = f"f 1 4 {4 + corners} {1 + corners}\n"
    with pytest.raises(SceneError, match=r"block 0: .* 2 of its edges have more than two faces"):
        read("tower.obj", obj(shape).replace("o block_0\n", "").replace("f ", f"{wall}f ", 1))


def test_an_object_of_several_blocks_is_said(read):
    cubes = [box((0.2, 0.2, 0.1), at=(x, 0, 0)) for x in (0.0, 0.3)]
    said = read("tower.obj", obj(*cubes).replace("o block_1\n", "")).provenance
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
