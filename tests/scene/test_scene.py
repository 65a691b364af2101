"""Scenes: validation, the JSON file, its schema."""

from __future__ import annotations

import json

import jsonschema
import pytest

from seqopt.errors import FileError, SceneError
from seqopt.scene.scene_file import _parse_scene, dump_scene, load_scene, save_scene, schema


def test_the_schema_is_a_schema():
    jsonschema.Draft202012Validator.check_schema(schema())


def test_the_reference_arch(arch25):
    """Section 3.1 of the paper: 25 bricks of 246 x 116 x 53 mm and 2420 kg/m3, 40 kg robots."""
    assert [b.name for b in arch25.placed] == list(range(1, 26))
    assert {b.dimensions for b in arch25.bricks} == {(0.246, 0.116, 0.053)}
    assert {b.density for b in arch25.bricks} == {2420.0}
    assert arch25.bricks[0].mass == pytest.approx(3.66, abs=0.005)
    assert [(r.name, r.payload) for r in arch25.robots] == [(f"rob{i}", 392.4) for i in (1, 2, 3)]
    assert "Bruun" in arch25.provenance


def break_at(path, value):
    """The document of arch25 with the entry at a path replaced, or removed if value is None."""
    document = json.loads(dump_scene(load_scene("arch25")))
    place = document
    for key in path[:-1]:
        place = place[key]
    if value is None:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return json.dumps(document)


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (("bricks",), [], r"bricks"),
        (("bricks", 3, "density"), -5, r"bricks\[3\]\.density.*-5"),
        (("bricks", 3, "density"), float("nan"), r"brick 4: density is nan"),
        (("bricks", 3, "density"), None, r"bricks\[3\].*density"),
        (("bricks", 3, "length_axis"), [0, 0, 2], r"brick 4: length_axis.*unit"),
        (("bricks", 3, "name"), 3, r"brick 3 occurs twice"),
        (("bricks", 3, "placing_node"), 99, r"brick 4: placing_node is 99"),
        (("joints", 0, "rotational_stiffness"), [float("nan"), 1, 1], r"joint \(1, 2\)"),
        (("joints", 0, "bricks"), [1, 77], r"joint \(1, 77\): there is no brick 77"),
        (("grounds", 0, "brick"), 77, r"there is no brick 77"),
        (("build_order",), [1, 2], r"build_order"),
        (("blocked_nodes",), [7], r"brick 4: placing_node 7 is blocked"),
        (("robots", 0, "payload"), 0, r"robots\[0\]\.payload.*0"),
        (("format",), "other", r"format"),
    ],
)
def test_a_malformed_scene_gets_one_clear_line(path, value, named):
    with pytest.raises(SceneError, match=named) as caught:
        _parse_scene(break_at(path, value), "broken.json")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("text", ["{", "[]"])
def test_what_is_no_scene_is_refused(text):
    with pytest.raises(SceneError, match=r"scene broken\.json"):
        _parse_scene(text, "broken.json")


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
