"""Blocks of COMPAS models stand where COMPAS places them, and touch where they do."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from seqopt.errors import FileError, SceneError
from seqopt.exchange._compas_models import read_model
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene
from seqopt.scene.scene_file import _parse_scene, dump_scene
from tests.blocks import box
from tests.documents import BOXES, DOCUMENTS, HIGH, LOW, TOP, element, matrix, model, nested, obj

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


def turned(**more):
    document = model()
    document["data"] |= {"transformation": LYING, **more}
    return document


def test_faces_follow_blocks_that_compas_moved(tmp_path):
    """COMPAS moves the blocks of a model, and leaves the contacts where it found them."""
    path = tmp_path / "lying.json"
    path.write_text(json.dumps(turned()), encoding="utf-8")
    lying = import_scene(path, given=Given(unit="m"))
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


@pytest.mark.parametrize(
    ("name", "content", "given", "said"),
    [
        ("a.json", DOCUMENTS["assembly"], Given(density=1.0), "does not say its unit of length"),
        ("a.json", DOCUMENTS["assembly"], Given(unit="m"), "block 4 has no density; give one"),
        ("a.json", DOCUMENTS["assembly"], Given(unit="m", density=1.0, robots=0), "robots is 0"),
        (
            "a.json",
            DOCUMENTS["assembly"],
            Given(unit="m", density=1.0, supports=["5"]),
            "there is no block '5'; known are '0, 4, 7'",
        ),
        (
            "a.json",
            DOCUMENTS["assembly"],
            Given(unit="m", density=1.0, supports=["0", "4", "7"]),
            "all blocks are supports",
        ),
        ("a.json", DOCUMENTS["assembly"], Given(unit="m", density=1.0, gap=0.0), "gap is 0"),
        ("a.obj", obj(LOW, box((1, 1, 1), at=(0, 0, 5))), METERS, "1 blocks touch nothing"),
        ("a.obj", "v 0 0 0\n", METERS, "it has no faces"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", METERS, "line 2: there is no vertex '2'; 1 stand before"),
        ("a.obj", obj(LOW).replace("f 4//1 3//1 2//1 1//1\n", ""), METERS, "one side only; close"),
        ("a.stl", b"solid x\nfacet", METERS, "a .stl cannot be read; open it in Rhino or Blender"),
        ("a.csv", BOXES.replace("yaw", "angle"), METERS, "column 'angle' is not known"),
        ("a.csv", BOXES.replace(".75,", "nan,", 1), METERS, "row 2: x is 'nan'; give a number"),
        ("a.csv", MASSES.replace("2.4", "-2.4"), METERS, "row 1: mass is -2.4; give a positive nu"),
        (
            "a.csv",
            MASSES.replace("mass", "mass,density").replace("2.4", "2.4,1800"),
            METERS,
            "block 1: its mass of 2.4 kg is 2000 kg/m³ in 0.0012 m³, its density 1800 kg/m³; give",
        ),
        ("a.xyz", "0 0 0\n", METERS, "its format is not known; give one of compas_assembly"),
        (
            "a.dxf",
            "0\nSECTION\n",
            METERS,
            "a .dxf cannot be read; open it in Rhino or FreeCAD, and export closed meshes",
        ),
        ("a.json", "{", METERS, "not JSON, line 1"),
        ("a.json", '{"node": NaN}', METERS, "NaN stands where a number should"),
        ("a.json", {"format": "seqopt-scene"}, METERS, "a scene of seqopt already"),
        ("a.json", {"unit": "meter", "nodes": []}, METERS, "no assembly that is known"),
        ("a.json", {"dtype": "compas.scene/Scene", "data": {}}, METERS, "a scene cannot be read"),
        ("a.json", {"node": {"0": {"block": None}}}, METERS, "block 0 is None"),
        (
            "a.json",
            [{"vertices": [[0, 0, 1e300]] * 4, "faces": []}],
            METERS,
            "a finite number up to 1e",
        ),
        ("a.json", [{"vertex": {}, "face": {"0": [1]}}], METERS, "there is no vertex 1"),
    ],
)
def test_what_a_file_lacks_or_has_wrong_is_one_line(read, name, content, given, said):
    with pytest.raises(SceneError, match=said.replace("(", r"\(")) as caught:
        read(name, content, given)
    assert "\n" not in str(caught.value)
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
