"""Scene files that are no scenes, however they are broken: one line each."""

from __future__ import annotations

import json
from dataclasses import fields

import jsonschema
import pytest
from hypothesis import HealthCheck, given, settings

from seqopt.contact.faces import bare_assembly
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.scene.scene_file import _parse_scene, dump_scene, load_scene, save_scene, schema
from tests.blocks import with_shapes
from tests.builders import six_bricks
from tests.strategies import scenes_with_all

TEXT = dump_scene(six_bricks())


def changed(change):
    document = json.loads(TEXT)
    change(document)
    return json.dumps(document)


def renamed(document, name):
    document["bricks"][0]["name"] = document["build_order"][0] = name
    document["joints"][0]["bricks"][0] = document["grounds"][0]["brick"] = name


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[" * 100_000, "nested too deep"),
        (TEXT.replace("2420.0", "9" * 5000), "too many digits"),
        (changed(lambda d: d["bricks"][0].update(density=10**400)), "brick 1: density is 1000"),
        (changed(lambda d: renamed(d, 10**400)), "brick: its name is 1000"),
        (changed(lambda d: d["bricks"][1].update(nodes=[10**30, 3])), "brick 2: nodes is 1000"),
        (changed(lambda d: d.update(name="\ud800")), "scene: its name is '.ud800'"),
        (changed(lambda d: d.update(name="\x1b[2J")), "scene: its name is '.x1b.2J'"),
        (TEXT[:-2] + ',"name":"other"}', "key 'name' stands twice in one object; keep one"),
    ],
)
def test_one_line_says_what_is_wrong(text, named):
    with pytest.raises(SceneError, match=named) as caught:
        _parse_scene(text, "broken.json")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_numbers_that_are_whole_are_names():
    text = changed(lambda d: d["bricks"][1].update(nodes=[2.0, 3.0], placing_node=3.0))
    assert _parse_scene(text).bricks[1].nodes == (2, 3)
    assert all(isinstance(node, int) for node in _parse_scene(text).bricks[1].nodes)


def test_a_mark_at_the_start_is_no_content(tmp_path):
    """Editors and spreadsheets write it; text has none."""
    path = tmp_path / "scene.json"
    path.write_text(TEXT, encoding="utf-8-sig")
    assert load_scene(str(path)) == six_bricks()


SHAPED = dump_scene(with_shapes(six_bricks()))


def reshaped(change):
    document = json.loads(SHAPED)
    change(document)
    return json.dumps(document)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda d: d["bricks"][0]["shape"].pop("faces"), r"bricks\[0\].shape.*faces"),
        (lambda d: d["bricks"][0]["shape"]["faces"].pop(), "brick 1: shape: edge"),
        (lambda d: d["bricks"][0]["shape"]["faces"][0].append(10**30), "brick 1: shape: a face"),
        (lambda d: d["joints"][0].update(face=[[0, 0], [1, 0], [2, 0]]), "convex polygon"),
        (lambda d: d["joints"][0]["face"].reverse(), "counterclockwise"),
        (lambda d: d["joints"][0].pop("face"), ""),
        (lambda d: d["bricks"][0].update(dimensions=[9, 9, 9]), "its shape extends"),
    ],
)
def test_a_malformed_shape_gets_one_clear_line(change, named):
    if not named:  # a joint without its face is a scene, but no contact follows from the shapes
        scene = _parse_scene(reshaped(change))
        with pytest.raises(SceneError, match="is not a box and the joint has no face"):
            bare_assembly(build_network(scene), len(scene.bricks))
        return
    with pytest.raises(SceneError, match=named) as caught:
        _parse_scene(reshaped(change), "broken.json")
    assert "\n" not in str(caught.value)


@pytest.mark.filterwarnings("ignore::seqopt.errors.SceneWarning")  # bricks in one place, say
@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scene=scenes_with_all())
def test_a_scene_comes_back_from_its_file(tmp_path, scene):
    save_scene(scene, tmp_path / "scene.json")
    assert load_scene(tmp_path / "scene.json") == scene
    text = dump_scene(scene)
    assert dump_scene(_parse_scene(text)) == text
    jsonschema.validate(json.loads(text), schema())


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
