"""Props as parts of scenes: what they take, where they stand, and what files say of them."""

from __future__ import annotations

import json

import pytest

from seqopt import Prop, load_scene, save_scene
from seqopt.errors import SceneError
from seqopt.scene.scene_file import scene_to_dict
from tests.builders import small_arch


@pytest.mark.parametrize(
    ("props", "said"),
    [
        ([{"node": 99}], "prop at node 99: there is no free node 99; known are"),
        ([{"node": 3}, {"node": 3}], "a prop at node 3 occurs twice; give each its own"),
        ([{"node": 0}], "prop at node 0: there is no free node 0"),  # it is blocked
    ],
)
def test_props_that_do_not_fit_a_scene(props, said):
    with pytest.raises(SceneError, match=said):
        load_scene("arch25").with_props(*(Prop(**each) for each in props))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"node": 0.5}, "prop: node is 0.5; give a whole number"),
        ({"node": 3, "direction": (0, 0, 0)}, "direction is .* give one that is not zero"),
        ({"node": 3, "stiffness": -1}, "prop at node 3: stiffness is -1; give one number or three"),
    ],
)
def test_wrong_props_get_one_line(words, said):
    with pytest.raises(SceneError, match=said) as caught:
        Prop(**words)
    assert "\n" not in str(caught.value)


def test_props_stand_from_their_bricks_until_the_whole_is_let_go():
    scene = small_arch(5)
    nodes = [scene.placed[k].nodes[0] for k in (3, 1)]
    scene = scene.with_props(*(Prop(node=node) for node in nodes))

    def standing(bricks, held):
        return [prop.node for prop in scene.standing_props(bricks, held=held)]

    assert [standing(k, held=False) for k in range(6)] == [[], [], nodes[1:], nodes[1:], nodes, []]
    assert standing(5, held=True) == nodes
    assert not {*nodes} & {n for own in scene.within_reach(scene.robots[0]) for n in own}


def test_a_file_keeps_props_and_scenes_without_say_nothing(tmp_path):
    scene = small_arch(4)
    assert "props" not in scene_to_dict(scene)
    props = Prop(node=3, stiffness=1e6, direction=(0, 0, 1), capacity=90), Prop(node=5)
    save_scene(scene.with_props(*props), tmp_path / "own.json")
    assert load_scene(tmp_path / "own.json").props == props
    document = json.loads((tmp_path / "own.json").read_text("utf-8"))
    assert document["props"][1] == {"node": 5}
    document["props"][1] = {"node": 5, "position": [0, 0, 0]}
    (tmp_path / "own.json").write_text(json.dumps(document), "utf-8")
    with pytest.raises(SceneError, match=r"props\[1\]"):
        load_scene(tmp_path / "own.json")
