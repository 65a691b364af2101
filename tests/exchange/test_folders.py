"""A folder with a mesh for each block, in every format that is read."""

from __future__ import annotations

import json

import compas
import numpy as np
import pytest
import rhino3dm
import trimesh
from compas.datastructures import Mesh

from seqopt._cli.main import main
from seqopt.errors import SceneError
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene
from seqopt.scene.scene_file import load_scene
from tests.blocks import L_SHAPE, box, prism
from tests.documents import obj

COUNT = 11  # more than 10: 10 comes after 9, not after 1
TOWER = [box((0.4, 0.2, 0.1), at=(0.0, 0.0, 0.1 * i)) for i in range(COUNT)]
GIVEN = Given(unit="m", density=2000.0, supports=["0"])


def alone(shape):
    """OBJ of one shape without a name."""
    return obj(shape).replace("o block_0\n", "")


def triangles(shape):
    fans = [(f[0], f[k], f[k + 1]) for f in shape.faces for k in range(1, len(f) - 1)]
    return trimesh.Trimesh(shape.points, fans, process=False)


def of_rhino(shape, path):
    file, mesh = rhino3dm.File3dm(), rhino3dm.Mesh()
    for row in shape.vertices:
        mesh.Vertices.Add(*row)
    for face in triangles(shape).faces.tolist():
        mesh.Faces.AddFace(*face)
    file.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    file.Objects.AddMesh(mesh)
    assert file.Write(str(path), 8)


def of_compas(shape):
    mesh = Mesh.from_vertices_and_faces(shape.vertices, [list(face) for face in shape.faces])
    return compas.json_dumps(mesh).encode()


WRITERS = {
    "obj": lambda shape: alone(shape).encode(),
    "stl": lambda shape: triangles(shape).export(file_type="stl"),
    "ply": lambda shape: triangles(shape).export(file_type="ply"),
    "glb": lambda shape: triangles(shape).export(file_type="glb"),
    "json": of_compas,
}


def folder(tmp_path, form, shapes=TOWER):
    path = tmp_path / "tower"
    path.mkdir(parents=True)
    for i, shape in enumerate(shapes):
        if form == "3dm":
            of_rhino(shape, path / f"{i}.3dm")
        else:
            (path / f"{i}.{form}").write_bytes(WRITERS[form](shape))
    return path


@pytest.mark.parametrize("form", [*WRITERS, "3dm"])
def test_a_tower_of_a_block_a_file(tmp_path, form):
    given = Given(
        unit=None if form == "3dm" else "m",
        up="z" if form == "glb" else None,
        density=2000.0,
        supports=["0"],
        gap=1e-3,
    )
    scene = import_scene(folder(tmp_path, form), given=given)
    assert scene.name == "tower"
    assert scene.build_order == (*range(1, COUNT),)
    assert (len(scene.joints), len(scene.grounds)) == (COUNT - 2, 1)
    assert "supports are blocks 0, as given" in scene.provenance
    assert f"a folder of {COUNT} files of" in scene.provenance


def test_what_else_is_in_the_folder_is_said(tmp_path):
    path = folder(tmp_path, "obj")
    (path / "LICENSE").write_text("MIT", encoding="utf-8")
    (path / "settings.json").write_text("{}", encoding="utf-8")
    (path / ".hidden.obj").write_text("", encoding="utf-8")
    (path / "more").mkdir()
    said = import_scene(path, given=GIVEN).provenance
    assert "3 other files are left out: LICENSE, more, settings.json" in said
    assert "left out" not in import_scene(folder(tmp_path / "more", "obj"), given=GIVEN).provenance


def test_names_that_are_no_numbers_come_in_natural_order(tmp_path):
    path = folder(tmp_path, "obj")
    for file in path.iterdir():
        file.rename(path / f"stone {file.stem} a.obj")
    scene = import_scene(path, given=Given(unit="m", density=2000.0, supports=["stone 0 a"]))
    assert [round(brick.position[2], 6) for brick in scene.bricks] == pytest.approx(
        [0.05 + 0.1 * i for i in range(1, COUNT)]
    )
    assert "stone 2 a is 3" in scene.provenance


def test_faces_without_area_are_no_blocks(tmp_path):
    """As programs write them that cut every face into triangles."""
    path = folder(tmp_path, "obj")
    for file in path.iterdir():
        file.write_text(file.read_text(encoding="utf-8") + "f 4 4 8\nf 4 8 8\n", encoding="utf-8")
    assert len(import_scene(path, given=GIVEN).bricks) == COUNT - 1


def cubes(*places):
    return obj(*(box((0.2, 0.2, 0.1), at=at) for at in places))


@pytest.mark.parametrize("place", [(0.2, 0, 0.1), (0.3, 0, 0.1), (0.2, 0.2, 0.1), (0.1, 0, 0.1)])
def test_a_file_of_several_pieces_is_refused_by_name(tmp_path, place):
    """Face on face, apart, on an edge, or within each other."""
    path = folder(tmp_path, "obj")
    (path / "1.obj").write_text(cubes((0, 0, 0.1), place), encoding="utf-8")
    with pytest.raises(SceneError, match=r"1\.obj: its mesh is 2 pieces; unite them to one closed"):
        import_scene(path, given=GIVEN)


def test_a_block_that_is_open_is_named(tmp_path):
    path = folder(tmp_path, "obj")
    text = alone(TOWER[1]).rsplit("f ", 1)[0]
    (path / "1.obj").write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=r"block 1: .* one side only; close the shape; if it is"):
        import_scene(path, given=GIVEN)


def test_faces_inside_a_block_are_named(tmp_path):
    """A wall across an L, between edges of which each has two faces without it."""
    shape, path = prism(L_SHAPE, 0.1, at=(0.0, 0.0, 0.1)), folder(tmp_path, "obj", TOWER[:2])
    corners = len(L_SHAPE)
    wall, text = f"f 1 4 {4 + corners} {1 + corners}\n", alone(shape)
    (path / "1.obj").write_text(text.replace("f ", f"{wall}f ", 1), encoding="utf-8")
    with pytest.raises(SceneError, match=r"block 1: .* 2 of its edges have more than two faces"):
        import_scene(path, given=GIVEN)
    (path / "1.obj").write_text(text + wall, encoding="utf-8")
    with pytest.raises(SceneError, match=r"1\.obj: its mesh is 2 pieces"):
        import_scene(path, given=GIVEN)


def test_an_object_of_several_blocks_is_said(tmp_path):
    text = cubes((0, 0, 0), (0.3, 0, 0)).replace("o block_1\n", "")
    path = tmp_path / "two.obj"
    path.write_text(text, encoding="utf-8")
    said = import_scene(path, given=Given(unit="m", density=2000.0)).provenance
    assert "2 closed pieces are called block_0: each is a block of its own" in said


def test_what_is_no_folder_of_blocks_is_one_line(tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(SceneError, match="empty: a folder without meshes; give one with a block"):
        import_scene(empty, given=GIVEN)
    path = folder(tmp_path, "obj")
    with pytest.raises(SceneError, match="it has 0 files of stl; give 1 to"):
        import_scene(path, "stl", GIVEN)
    (path / "0.stl").write_bytes(WRITERS["stl"](TOWER[0]))
    with pytest.raises(SceneError, match=r"meshes in obj and stl; choose one \(--format\)"):
        import_scene(path, given=GIVEN)
    assert len(import_scene(path, "obj", GIVEN).bricks) == COUNT - 1
    with pytest.raises(SceneError, match=r"a folder of meshes; seqopt import .*tower --unit m"):
        load_scene(path)


def test_from_a_folder_to_a_plan(tmp_path, capsys):
    path, out = folder(tmp_path, "obj", TOWER[:4]), tmp_path / "scene.json"
    words = ["--unit", "m", "--density", "2000", "--supports", "0", "--out", str(out)]
    assert main(["import", str(path), *words]) == 0
    assert "tower: 3 bricks, 2 joints, 1 ground ends" in capsys.readouterr().out
    assert main(["optimize", str(out), "--schedule", "free", "--out", str(tmp_path / "plan")]) == 0
    assert "optimal" in capsys.readouterr().out
    assert json.loads(out.read_text(encoding="utf-8"))["name"] == "tower"
    assert np.isclose(load_scene(out).bricks[0].mass, 16.0)
