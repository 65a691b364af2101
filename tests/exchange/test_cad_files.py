"""Files that rhino3dm, trimesh and COMPAS wrote become the blocks that were put into them."""

from __future__ import annotations

import numpy as np
import pytest
import rhino3dm as rhino
import trimesh
from compas.geometry import Box, Frame

from seqopt.errors import SceneError
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene, read_content

DENSE = Given(density=2000.0)
WHERE = {  # lowest and highest corner of the blocks of a tower, mm
    "foot": ((0, 0, 0), (400, 200, 100)),
    "left": ((0, 0, 100), (200, 200, 200)),
    "lid": ((0, 0, 200), (300, 200, 300)),
}


def placed(scene):
    """Masses, and centroids in mm, of bricks by their numbers."""
    return {
        brick.name: (round(brick.mass, 4), *(round(1e3 * x, 4) for x in brick.position))
        for brick in scene.bricks
    }


TOWER = {
    1: (16.0, 200.0, 100.0, 50.0),
    2: (8.0, 100.0, 100.0, 150.0),
    3: (12.0, 150.0, 100.0, 250.0),
}


def corners(low, high):
    return rhino.BoundingBox(rhino.Point3d(*low), rhino.Point3d(*high))


def brep(low, high):
    return rhino.Brep.CreateFromBoundingBox(corners(low, high))


def extrusion(low, high):
    return rhino.Extrusion.CreateBoxExtrusion(rhino.Box(corners(low, high)), cap=True)


def mesh(low, high):
    """A box as Rhino's mesh: quadrangles, and vertices of their own for each of them."""
    out = rhino.Mesh()
    solid = trimesh.creation.box(bounds=(low, high))
    for triangle in solid.triangles:
        for corner in triangle:
            out.Vertices.Add(*corner)
        out.Faces.AddFace(*(len(out.Vertices) - 3 + k for k in range(3)))
    return out


class Rhino:
    """A file of Rhino."""

    def __init__(self, unit=rhino.UnitSystem.Millimeters):
        self.file = rhino.File3dm()
        self.file.Settings.ModelUnitSystem = unit

    def layer(self, name, *, visible=True):
        layer = rhino.Layer()
        layer.Name, layer.Visible = name, visible
        return self.file.Layers.Add(layer)

    def add(self, shape, name="", layer=0, *, visible=True):
        own = rhino.ObjectAttributes()
        own.Name, own.LayerIndex, own.Visible = name, layer, visible
        self.file.Objects.Add(shape, own)

    def written(self, folder):
        path = folder / "model.3dm"
        assert self.file.Write(str(path), 8)
        return path


@pytest.mark.parametrize("kind", [brep, extrusion, mesh])
def test_rhino_solids_bring_their_unit_and_names(tmp_path, kind):
    model = Rhino()
    model.layer("Stones")
    for name, (low, high) in WHERE.items():
        model.add(kind(low, high), name)
    model.add(rhino.LineCurve(rhino.Point3d(0, 0, 0), rhino.Point3d(1, 0, 0)))
    scene = import_scene(model.written(tmp_path), given=DENSE)
    assert placed(scene) == TOWER
    assert "1 objects are left out: curves, points, text" in scene.provenance
    assert "from 1 in the file's order: foot is 1, left is 2, lid is 3" in scene.provenance
    assert "turned" not in scene.provenance  # faces look outward as they are
    sides = 12 if kind is mesh else 6
    assert [len(read_content(tmp_path / "model.3dm").blocks[i].faces) for i in range(3)] == [
        sides
    ] * 3
    with pytest.raises(SceneError, match="its lengths are known in mm; give no other unit"):
        import_scene(tmp_path / "model.3dm", given=Given(unit="m", density=1.0))


def test_rhino_blocks_stand_where_they_are_put(tmp_path):
    """An instance of a block of Rhino that holds another one."""
    model = Rhino()
    own = rhino.ObjectAttributes()
    low, high = WHERE["left"]
    table = model.file.InstanceDefinitions
    base = rhino.Point3d(0, 0, 0)
    table.Add("stone", "", "", "", base, (brep((0, 0, 0), (200, 200, 100)),), (own,))
    (stone,) = [item.Id for item in table]
    for height in (0, 100):
        shift = rhino.Transform.Translation(50, 0, height)
        model.file.Objects.AddInstanceObject(rhino.InstanceReference(stone, shift), own)
    scene = import_scene(model.written(tmp_path), given=DENSE)
    assert placed(scene) == {1: (8.0, 150.0, 100.0, 50.0), 2: (8.0, 150.0, 100.0, 150.0)}
    assert (low, high) == ((0, 0, 100), (200, 200, 200))


def profile():
    """The outline of an L."""
    out = rhino.Polyline(7)
    for x, y in ((0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3), (0, 0)):
        out.Add(x, y, 0)
    return out.ToPolylineCurve()


def drum(*_):
    cylinder = rhino.Cylinder(rhino.Circle(1.0), 2.0)
    return rhino.Brep.CreateFromCylinder(cylinder, capBottom=True, capTop=True)


@pytest.mark.parametrize(
    ("unit", "shape", "said"),
    [
        ("None", brep, "does not say its unit of length, and is 400 by 200 by 100 large; give"),
        ("Yards", brep, "its unit is Yards; save it in one of m, cm, mm, in, ft"),
        (
            "Meters",
            lambda *_: rhino.Brep.CreateTrimmedPlane(rhino.Plane.WorldXY(), profile()),
            "'foot' is an open surface; close it",
        ),
        ("Meters", drum, r"object 'foot' has faces that are curved .* turn it into a mesh"),
        (
            "Meters",
            lambda *_: rhino.Point(rhino.Point3d(0, 0, 0)),
            "solid is visible; 1 objects are left out: curves, points",
        ),
    ],
)
def test_what_a_rhino_file_lacks_is_one_line(tmp_path, unit, shape, said):
    model = Rhino(getattr(rhino.UnitSystem, unit))
    model.add(shape(*WHERE["foot"]), "foot")
    with pytest.raises(SceneError, match=said) as caught:
        import_scene(model.written(tmp_path), given=DENSE)
    assert "\n" not in str(caught.value)


def scene_of_trimesh(up="z"):
    """The tower in m, as nodes that move one box each."""
    out = trimesh.Scene()
    turn = (
        np.eye(4)
        if up == "z"
        else np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    )
    for name, bounds in WHERE.items():
        low, high = np.array(bounds) / 1e3
        box = trimesh.creation.box(high - low)
        shift = trimesh.transformations.translation_matrix(0.5 * (low + high))
        out.add_geometry(box, node_name=name, geom_name=f"mesh of {name}", transform=turn @ shift)
    return out


def test_a_glb_is_in_meters_with_y_up_unless_said_otherwise(tmp_path):
    path = tmp_path / "tower.glb"
    path.write_bytes(scene_of_trimesh("y").export(file_type="glb"))
    scene = import_scene(path, given=DENSE)
    assert placed(scene) == TOWER
    assert (
        "lengths are in m, as the format has them; say --unit if they are not" in scene.provenance
    )
    assert "y is up in the file, as the format has it" in scene.provenance
    assert "foot is 1, left is 2, lid is 3" in scene.provenance
    path.write_bytes(scene_of_trimesh().export(file_type="glb"))
    assert placed(import_scene(path, given=Given(up="z", density=2000.0))) == TOWER
    small = import_scene(path, given=Given(up="z", unit="mm", density=2000.0))
    assert small.bricks[0].mass == pytest.approx(16e-9)


@pytest.mark.parametrize("form", ["glb", "3dm", "ply"])
def test_a_file_that_is_broken_is_one_line(tmp_path, form):
    path = tmp_path / f"broken.{form}"
    path.write_bytes(b"OFX 1 2 3")
    with pytest.raises(SceneError, match=f"no {form} file that can be read") as caught:
        import_scene(path, given=DENSE)
    assert "\n" not in str(caught.value)


def boxes():
    """The blocks of the tower as boxes of COMPAS, m."""
    out = {}
    for name, bounds in WHERE.items():
        low, high = np.array(bounds) / 1e3
        out[name] = Box(*(high - low), frame=Frame(0.5 * (low + high), [1, 0, 0], [0, 1, 0]))
    return out
