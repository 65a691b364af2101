"""Scene files that are no scenes, however they are broken: one line each."""

import json
import warnings
from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from seqopt._cli.main import main
from seqopt.arms import Arm
from seqopt.contact.assembly import bare_assembly
from seqopt.errors import FileError, SceneError, SceneWarning
from seqopt.exchange._doubts import find_doubts
from seqopt.network.network import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import Robot, Sphere
from seqopt.scene.scene_file import _parse_scene, dump_scene, load_scene, save_scene
from tests.blocks import with_shapes
from tests.builders import six_bricks, with_part
from tests.refusals import one_line
from tests.strategies import arches, flat_arches, scenes_with_all, walls

TEXT = dump_scene(six_bricks())


SHAPED, ARCH = dump_scene(with_shapes(six_bricks())), dump_scene(load_scene("arch25"))


def changed(change, text=TEXT):
    document = json.loads(text)
    change(document)
    return json.dumps(document)


def renamed(document, name):
    document["bricks"][0]["name"] = document["build_order"][0] = name
    document["joints"][0]["bricks"][0] = document["grounds"][0]["brick"] = name


def put(value, *path):
    """The document of the reference arch with another entry at a path."""

    def change(document):
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return changed(change, ARCH)


def brick(key, value):
    return put(value, "bricks", 3, key)


def shape(change):
    return changed(lambda d: change(d["bricks"][0]["shape"]), SHAPED)


def face(change):
    return changed(lambda d: change(d["joints"][0]), SHAPED)


def robot(value, *keys):
    return put(value, "robots", 0, *keys)


AROUND = {"kind": "sphere", "center": [0, 0], "radius": 1}
MISSING = changed(lambda d: d["bricks"][3].pop("density"), ARCH)
WRONG = {  # what is said, and of which text
    "nested too deep": "[" * 100_000,
    "too many digits": TEXT.replace("2420.0", "9" * 5000),
    "brick 1: density is 1000": changed(lambda d: d["bricks"][0].update(density=10**400)),
    "brick: its name is 1000": changed(lambda d: renamed(d, 10**400)),
    "brick 2: nodes is 1000": changed(lambda d: d["bricks"][1].update(nodes=[10**30, 3])),
    "scene: its name is '.ud800'": changed(lambda d: d.update(name="\ud800")),
    "scene: its name is '.x1b.2J'": changed(lambda d: d.update(name="\x1b[2J")),
    "key 'name' stands twice in one object; keep one": TEXT[:-2] + ',"name":"other"}',
    r"bricks\[0\]: shape: faces is missing": shape(lambda own: own.pop("faces")),
    r"bricks\[0\]: shape: edge": shape(lambda own: own["faces"].pop()),
    r"bricks\[0\]: shape: a face": shape(lambda own: own["faces"][0].append(10**30)),
    "convex polygon": face(lambda own: own.update(face=[[0, 0], [1, 0], [2, 0]])),
    "counterclockwise": face(lambda own: own["face"].reverse()),
    "its shape extends": changed(lambda d: d["bricks"][0].update(dimensions=[9, 9, 9]), SHAPED),
    r"bricks": put([], "bricks"),
    "brick 4: density is -5; give a positive number": brick("density", -5),
    "brick 4: density is nan": brick("density", float("nan")),
    "brick 4: density is True; give a positive number": brick("density", value=True),
    r"bricks\[3\]: density is missing": MISSING,
    r"bricks\[3\]: 'densty' is not known \(did you mean density": brick("densty", 2000),
    r"brick 4: position is \['0', '0', '0'\]; give three": brick("position", ["0", "0", "0"]),
    r"bricks\[3\] is 7; give an object": put(7, "bricks", 3),
    r"robots\[0\]: reach: kind is 'cube'; give one of": robot("cube", "reach", "kind"),
    r"robots\[0\]: reach: center is \[0, 0\]; give three": robot(AROUND, "reach"),
    "robot rob1: payload is 0; give a positive": robot(0, "payload"),
    "provenance is 3; give a str": put(3, "provenance"),
    "brick 4: length_axis.*unit": brick("length_axis", [0, 0, 2]),
    "brick 3 occurs twice": brick("name", 3),
    "brick 4: placing_node is 99": brick("placing_node", 99),
    r"joint \(1, 2\)": put([float("nan"), 1, 1], "joints", 0, "rotational_stiffness"),
    r"joint \(1, 77\): there is no brick 77": put([1, 77], "joints", 0, "bricks"),
    "there is no brick 77": put(77, "grounds", 0, "brick"),
    "build_order": put([1, 2], "build_order"),
    "brick 4: placing_node 7 is blocked": put([7], "blocked_nodes"),
    "broken.json: format is 'other'; give 'seqopt-scene'": put("other", "format"),
    "version is 2; give 1": put(2, "version"),
    r"scene broken\.json: not JSON": "{",
    r"scene broken\.json": "[]",
}


@pytest.mark.parametrize("said", WRONG)
def test_one_line_says_what_is_wrong(said):
    with one_line(SceneError, said) as caught:
        _parse_scene(WRONG[said], "broken.json")
    assert len(str(caught.value)) < 400


def test_a_joint_without_its_face_is_a_scene_whose_contacts_are_not_known():
    scene = _parse_scene(face(lambda own: own.pop("face")))
    with pytest.raises(SceneError, match="is not a box and the joint has no face"):
        bare_assembly(build_network(scene), len(scene.bricks))


def test_numbers_that_are_whole_are_names():
    text = changed(lambda d: d["bricks"][1].update(nodes=[2.0, 3.0], placing_node=3.0))
    assert _parse_scene(text).bricks[1].nodes == (2, 3)
    assert all(isinstance(node, int) for node in _parse_scene(text).bricks[1].nodes)


def test_a_mark_at_the_start_is_no_content(tmp_path):
    """Editors and spreadsheets write it; text has none."""
    path = tmp_path / "scene.json"
    path.write_text(TEXT, encoding="utf-8-sig")
    assert load_scene(str(path)) == six_bricks()


@pytest.mark.filterwarnings("ignore::seqopt.errors.SceneWarning")  # bricks in one place, say
@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scene=scenes_with_all())
def test_a_scene_comes_back_from_its_file(tmp_path, scene):
    save_scene(scene, tmp_path / "scene.json")
    assert load_scene(tmp_path / "scene.json") == scene
    text = dump_scene(scene)
    assert dump_scene(_parse_scene(text)) == text


@pytest.mark.slow
def test_every_part_of_a_scene_is_drawn():
    """The control: the strategy leaves nothing at its default, so a new field must be drawn too."""
    seen = {}

    @settings(max_examples=40, database=None)
    @given(scene=scenes_with_all())
    def collect(scene):
        for part in (scene, *scene.bricks, *scene.joints, *scene.grounds, *scene.loads):
            kind = type(part).__name__
            for each in fields(part):
                seen.setdefault((kind, each.name), set()).add(repr(getattr(part, each.name)))

    collect()
    assert [name for name, values in seen.items() if len(values) == 1] == []


# scenes: validation, the JSON file
def test_the_reference_arch(arch25):
    """Section 3.1 of the paper: 25 bricks of 246 x 116 x 53 mm and 2420 kg/m3, 40 kg robots."""
    assert [b.name for b in arch25.placed] == list(range(1, 26))
    assert {b.dimensions for b in arch25.bricks} == {(0.246, 0.116, 0.053)}
    assert {b.density for b in arch25.bricks} == {2420.0}
    assert arch25.bricks[0].mass == pytest.approx(3.66, abs=0.005)
    assert [(r.name, r.payload) for r in arch25.robots] == [(f"rob{i}", 392.4) for i in (1, 2, 3)]
    assert "Bruun" in arch25.provenance


def test_files(tmp_path, arch25):
    path = tmp_path / "arch.json"
    save_scene(arch25, path)
    assert load_scene(str(path)) == arch25
    with pytest.raises(SceneError, match=r"built in: arch25"):
        load_scene("arch52")
    with pytest.raises(FileError, match=r"cannot read .*missing\.json"):
        load_scene(str(tmp_path / "missing.json"))
    with pytest.raises(FileError, match="cannot write"):
        save_scene(arch25, tmp_path / "no" / "arch.json")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["arch.json"]  # nothing half-written


# what is probably not meant gets a warning that names it; ordinary scenes get none
SCENE = six_bricks()


with_own = partial(with_part, SCENE)


def with_arm(**changes):
    """Return the scene with a robot that has an arm of some unusual length."""
    usual = {"position": (0.0, 1.5, 0.0), "tool_length": 0.3, "tool_radius": 0.05}
    arm = Arm(urdf="package:arm.urdf", **usual | changes)
    return SCENE.with_robots(Robot(name="rob1", payload=500.0, arm=arm))


ODD = {
    "joint (2, 3): it lies 1e+06 m from brick 2": with_own("joints", 1, position=(1e6, 0.0, 0.0)),
    "ground end of brick 1: it lies": with_own("grounds", 0, position=(0.0, 3.0, 0.0)),
    "bricks 2 and 4 interpenetrate by 89.6 mm": with_own(
        "bricks", 3, position=SCENE.bricks[1].position
    ),
    "brick 1: dimensions of (246.0, 116.0, 53.0) m look like millimeters": with_own(
        "bricks", 0, dimensions=(246.0, 116.0, 53.0)
    ),
    "brick 3: a density of 2.42 kg/m³ is odd": with_own("bricks", 2, density=2.42),
    "gravity is 9810 m/s²": replace(SCENE, gravity=(0.0, 0.0, -9810.0)),
    "brick 6 hangs free: no joint leads to the ground; tie it": replace(
        SCENE, joints=SCENE.joints[:-1], grounds=SCENE.grounds[:1]
    ),
    "rob1: a reach of 1500 m looks like millimeters": SCENE.with_robots(
        Robot(name="rob1", payload=500.0, reach=Sphere(center=(0.0, 0.0, 0.0), radius=1500.0))
    ),
    "gravity points away from every ground end; check its sign": replace(
        SCENE, gravity=(0.0, 0.0, 9.81)
    ),
    "it is 1000 m long, which looks like millimeters": with_own(
        "bricks", 5, position=(1000.0, 0.0, 0.0)
    ),
    "wind is 45 times the weight": replace(SCENE, wind=(45.0, 0.0, 0.0)),
    "brick 2: dimensions of (0.00025, 0.00012, 5e-05) m are tiny": with_own(
        "bricks", 1, dimensions=(0.00025, 0.00012, 0.00005)
    ),
    "rob1: a tool_length of 300 m looks like millimeters": with_arm(tool_length=300.0),
    "rob1: a position of its arm of 1500 m looks": with_arm(position=(0.0, 1500.0, 0.0)),
    "joint (1, 2): a thickness of 10 m looks like millimeters": with_own(
        "joints", 0, thickness=10.0
    ),
    "ground end of brick 1: a movement of 5 is m or rad": with_own(
        "grounds", 0, movement=(5.0, 0.0, 0.0)
    ),
}


@pytest.mark.parametrize("said", ODD)
def test_what_is_odd_is_named(capsys, tmp_path, said):
    assert any(doubt.startswith(said) for doubt in find_doubts(ODD[said]))
    path = tmp_path / "scene.json"
    save_scene(ODD[said], path)
    with pytest.warns(SceneWarning) as heard:
        assert load_scene(str(path)) == ODD[said]
    assert any(said in str(warning.message) for warning in heard)
    assert main(["scene", str(path)]) == 0
    lines = capsys.readouterr().err.splitlines()
    said_of_arms = "robot rob1: package package is not installed"
    assert all(line.startswith(("seqopt: warning: scene ", said_of_arms)) for line in lines)
    assert any(said in line for line in lines)


def test_bricks_that_interpenetrate_across_a_joint_are_named():
    """The upper courses of a wall, 30 mm of 60 too low: by as much, less the gap of the joints."""
    wall = load_scene("wall:columns=2,courses=2,dimensions=0.2x0.1x0.06,gap=0.008")
    low = [replace(b, position=(*b.position[:2], b.position[2] - 0.03)) for b in wall.bricks[2:]]
    found = [*find_doubts(replace(wall, bricks=(*wall.bricks[:2], *low)))]
    assert found
    assert all("interpenetrate by 22 mm" in line for line in found)
    assert not [*find_doubts(wall)]  # the control


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("wall:columns=2,courses=2,dimensions=200x100x60", "look like millimeters"),
        ("wall:columns=2,courses=2,density=2", "a density of 2 kg/m³ is odd"),
    ],
)
def test_odd_units_in_words_are_named(words, said):
    with pytest.warns(SceneWarning, match=said):
        load_scene(words)


@given(scene=st.one_of(arches(), walls(), flat_arches()))
def test_scenes_of_tests_are_not_odd(scene):
    assert not [*find_doubts(scene)]


@pytest.mark.parametrize("name", ["pitch", "yaw"])
def test_degrees_are_noticed(name):
    angles = {"pitch": [0.5, 0.0, -0.5]} | {name: [60.0, 0.0, -60.0]}
    with pytest.warns(SceneWarning, match=f"{name} has 60 rad, more than a turn; give radians"):
        ArchShape(**angles)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        arch_scene(ArchShape(pitch=np.linspace(1.5, -1.5, 7)))
