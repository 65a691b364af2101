"""A scene that goes out as an assembly comes back as itself; other formats say what they lose."""

from __future__ import annotations

import json
from dataclasses import fields, replace

import pytest
from hypothesis import HealthCheck, given, settings

from experiments.harness.scenes import running_bond
from seqopt.errors import SceneError
from seqopt.exchange._content import Given
from seqopt.exchange.exports import EXPORTS, LOST, export_plan
from seqopt.exchange.imports import FORMATS, import_scene
from seqopt.scene.boxes import as_vectors, block_brick, vertices_of
from seqopt.scene.library.common import JointLaw
from seqopt.scene.parts import Robot, Sphere
from seqopt.scene.shape import Polyhedron
from seqopt.sequence.steps import Step, StepKind
from tests.blocks import with_shapes
from tests.builders import six_bricks
from tests.strategies import scenes_with_all

ENDS = {"compas_assembly": "json", "boxes": "csv", "obj": "obj"}


def first_step(scene):
    """A plan of one step that every scene has: a robot that need not reach it places a brick."""
    grips = (scene.placed[0].placing_node, *[None] * (len(scene.robots) - 1))
    return (Step(1, StepKind.PLACE, 1, grips),)


def written(scene, form, folder, change=None):
    """A scene as a file of a format, after a change of its document."""
    path = folder / f"scene.{ENDS[form]}"
    text = export_plan(scene, first_step(scene), form)
    if change is not None:
        document = json.loads(text)
        change(document["data"]["graph"]["data"])
        text = json.dumps(document)
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.filterwarnings("ignore::seqopt.errors.SceneWarning")  # bricks in one place, say
@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scene=scenes_with_all())
def test_an_assembly_is_the_scene(tmp_path, scene):
    assert import_scene(written(scene, "compas_assembly", tmp_path)) == scene


def test_every_part_of_a_scene_goes_out_and_back():
    """The control: the strategy leaves nothing at its default, so a new field must be drawn too."""
    seen = {}

    @settings(max_examples=60, database=None)
    @given(scene=scenes_with_all())
    def collect(scene):
        for part in (scene, *scene.bricks, *scene.joints, *scene.grounds, *scene.loads):
            kind = type(part).__name__
            for each in fields(part):
                seen.setdefault((kind, each.name), set()).add(repr(getattr(part, each.name)))

    collect()
    assert [name for name, values in seen.items() if len(values) == 1] == []


def test_shapes_that_are_no_boxes_and_faces_come_back(tmp_path):
    scene = with_shapes(running_bond(3, 2))
    assert import_scene(written(scene, "compas_assembly", tmp_path)) == scene


def moved(graph):
    graph["node"]["4"]["block"]["data"]["vertex"]["0"]["x"] += 1e-6


def without_brick(graph):
    del graph["node"]["4"]["brick"]


def with_unknown_brick(graph):
    graph["node"]["2"]["grounds"].append({**graph["node"]["1"]["grounds"][0], "brick": 99})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (moved, "not used: block 4 is not as that has it"),
        (without_brick, "not used"),
        (with_unknown_brick, "no brick 99"),
    ],
)
def test_blocks_that_were_changed_are_read_as_those_of_others(tmp_path, change, said):
    """The control: a scene that no longer fits its blocks is not believed."""
    scene = running_bond(3, 2)
    path = written(scene, "compas_assembly", tmp_path, change)
    found = import_scene(path, given=Given(density=2000.0))
    assert said in found.provenance
    assert found != scene
    assert len(found.bricks) == len(scene.bricks)
    assert found.build_order == scene.build_order  # the nodes say it
    if change is moved:
        assert found.bricks[0].density == scene.bricks[0].density  # these too


def test_what_is_changed_on_purpose_has_an_effect(tmp_path):
    scene = six_bricks()

    def soften(graph):
        graph["edge"]["1"]["2"]["joints"][0]["rotational_stiffness"] = [1.0, 2.0, 3.0]

    found = import_scene(written(scene, "compas_assembly", tmp_path, soften))
    softer = replace(scene.joints[0], rotational_stiffness=(1.0, 2.0, 3.0))
    assert found == replace(scene, joints=(softer, *scene.joints[1:]))

    def shorten(graph):
        del graph["node"]["6"], graph["edge"]["6"], graph["edge"]["5"]["6"]
        graph["edge"].pop("7", None)

    found = import_scene(written(scene, "compas_assembly", tmp_path, shorten))
    assert found.build_order == scene.build_order[:-1]
    assert found.joints == scene.joints[:-1]
    assert found.robots == scene.robots


def test_what_the_user_gives_goes_before_what_the_file_has(tmp_path):
    scene = running_bond(3, 2)
    path = written(scene, "compas_assembly", tmp_path)
    assert import_scene(path, given=Given(name="mine")) == replace(scene, name="mine")
    assert len(import_scene(path, given=Given(robots=2)).robots) == 2
    law = JointLaw(translational=(2e9, 1e9, 1e9))
    stiff = import_scene(path, given=Given(law=law))
    assert stiff.joints[0].translational_stiffness != scene.joints[0].translational_stiffness
    assert [b.mass for b in stiff.bricks] == pytest.approx([b.mass for b in scene.bricks])


def test_a_source_carries_the_scene_in_its_own_unit(tmp_path):
    """A plan goes back into the file that was imported, in millimeters, and this is the scene."""
    path = written(running_bond(3, 2), "compas_assembly", tmp_path)
    document = json.loads(path.read_text("utf-8"))
    graph = document["data"]["graph"]["data"]
    del graph["attributes"]["seqopt"]
    for node in graph["node"].values():
        node.pop("order", None)
        for vertex in node["block"]["data"]["vertex"].values():
            vertex |= {axis: 1e3 * vertex[axis] for axis in "xyz"}
    for ends in graph["edge"].values():
        for edge in ends.values():
            for face in edge.get("interfaces", ()):
                face["data"]["points"] = [[1e3 * x for x in p] for p in face["data"]["points"]]
    source, back = tmp_path / "mm.json", tmp_path / "back.json"
    source.write_text(json.dumps(document), "utf-8")
    scene = import_scene(source, given=Given(unit="mm", density=2000.0))
    reach = Sphere(center=(1.0, 2.0, 0.0), radius=9.0)
    scene = replace(scene, robots=(Robot(name="arm", payload=900.0, reach=reach),))
    back.write_text(export_plan(scene, first_step(scene), "compas_assembly", source), "utf-8")
    assert import_scene(back, given=Given(unit="mm")) == scene
    again = tmp_path / "again.json"  # a source that carries a scene already gets this one
    stronger = replace(scene, robots=(Robot(name="arm", payload=1900.0, reach=reach),))
    again.write_text(export_plan(stronger, first_step(stronger), "compas_assembly", back), "utf-8")
    assert import_scene(again, given=Given(unit="mm")) == stronger


def rounded(vector):
    return tuple(round(x, 6) + 0.0 for x in vector)


PARTS = {  # what a scene is without, by the words of LOST
    "shapes other than boxes": lambda s: [
        sorted(map(rounded, vertices_of(b)[0])) for b in s.bricks
    ],
    "densities": lambda s: [brick.density for brick in s.bricks],
    "the order": lambda s: s.build_order,
    "nodes": lambda s: [rounded(b.node_position(n)) for b in s.bricks for n in b.nodes],
    "joints": lambda s: [joint.translational_stiffness for joint in s.joints],
    "ground ends": lambda s: [rounded(ground.anchor) for ground in s.grounds],
    "robots": lambda s: s.robots,
    "loads": lambda s: (s.loads, s.wind, s.gravity, s.weight_factor),
    "steps": lambda s: None,
}


def full(scene):
    """A scene that has something of each part that a format may lose."""
    bricks = [*scene.bricks]
    lying = replace(bricks[-1], density=900.0, node_offsets=((-0.01, 0, 0), (0.02, 0, 0)))
    return replace(scene, bricks=(*bricks[:-1], lying), wind=(0.1, 0.0, 0.0))


def tapered(scene):
    """The last brick as a wedge, which is no box."""
    brick = scene.bricks[-1]
    points, faces = vertices_of(brick)
    roof = points[:, 2] > brick.position[2]
    middle = brick.position[0]
    points[roof, 0] = middle + 0.5 * (points[roof, 0] - middle)
    made = block_brick(brick.name, Polyhedron(as_vectors(points), faces), 1500.0, nodes=brick.nodes)
    return replace(scene, bricks=(*scene.bricks[:-1], made))


@pytest.mark.filterwarnings("ignore:.*interpenetrate")  # the wedge does, as a box
@pytest.mark.parametrize("form", ["boxes", "obj"])
def test_what_is_said_to_be_lost_is_lost_and_nothing_else(tmp_path, form):
    """Said and not lost would be as wrong as lost and not said."""
    scene = full(tapered(with_order(running_bond(3, 2))))
    path = written(scene, form, tmp_path)
    given = Given(unit="m", density=2000.0, gap=1e-3, accept_overlaps=form == "boxes")
    back = import_scene(path, given=given)
    assert [b.name for b in back.bricks] == [b.name for b in scene.bricks]
    lost = [name for name, part in PARTS.items() if name == "steps" or part(back) != part(scene)]
    assert sorted(lost) == sorted(LOST[form])


def with_order(scene):
    """Another order than from the bottom up, in which each brick touches what stands."""
    order = [*scene.build_order]
    order[0], order[1] = order[1], order[0]
    return replace(scene, build_order=tuple(order))


def test_every_format_that_goes_both_ways_says_what_it_loses():
    assert {*LOST} == {*EXPORTS} & {*FORMATS} - {"compas_timber"}  # a plan there, a model here
    assert {*ENDS} == {*LOST}


def test_no_robots_are_as_wrong_as_elsewhere(tmp_path):
    path = written(running_bond(3, 2), "compas_assembly", tmp_path)
    with pytest.raises(SceneError, match="robots"):
        import_scene(path, given=Given(robots=0))
