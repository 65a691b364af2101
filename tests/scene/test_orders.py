"""Orders of a scene: by name, by words, and what is said of those that are none."""

from __future__ import annotations

import pytest

import seqopt
from seqopt.errors import SceneError
from seqopt.scene.library.wall import WallShape, wall
from seqopt.scene.scene import _from_all_ends, _parse_order, in_order
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.schedule import islands
from tests.builders import small_arch


def test_orders_by_name():
    scene = small_arch(5)
    assert _parse_order(scene, "reversed") == (5, 4, 3, 2, 1)
    assert _parse_order(scene, "ends") == (1, 5, 2, 4, 3)
    assert _parse_order(scene, "1..2, 5..4,3") == (1, 2, 5, 4, 3)
    assert in_order(scene, None) is scene
    network = seqopt.build_network(scene, (2, 1, 3, 4, 5))
    assert network.scene.build_order == (2, 1, 3, 4, 5)
    assert [len(islands(network, count)) for count in (1, 2)] == [1, 0]


def test_from_all_ends_leaves_nothing_that_hangs():
    scene = wall(WallShape(courses=3, columns=3))
    network = seqopt.build_network(scene, "ends")
    assert sorted(_from_all_ends(scene)) == sorted(scene.build_order)
    assert not any(islands(network, count) for count in range(1, len(scene.bricks) + 1))


@pytest.mark.parametrize(
    ("order", "said"),
    [
        ("backwards", "order 'backwards': give reversed, ends, or names of bricks"),
        ("1,2,3", "order: 2 bricks are missing, 4 among them"),
        ("1,2,3,4,4", "order: 4 occurs twice"),
        ((1, 2, 3, 4, 7), "order: 7 is no brick"),
        (7, "order is 7; give whole numbers"),
    ],
)
def test_what_is_no_order_gets_one_line(order, said):
    with pytest.raises(SceneError, match=said) as caught:
        seqopt.build_network(small_arch(5), order)
    assert "\n" not in str(caught.value)


# orders after words


def test_a_vault_closes_from_both_springings():
    scene = load_scene("vault:span=1.5,rise=0.5,columns=2,order=ends")
    courses = len(scene.bricks) // 2
    assert {ground.brick for ground in scene.grounds} == {1, 2, 2 * courses - 1, 2 * courses}
    assert {*scene.build_order[:4]} == {ground.brick for ground in scene.grounds}
    (crown,) = {(name - 1) // 2 for name in scene.build_order[-2:]}
    assert crown == courses // 2
    bent = [brick.position[2] for brick in scene.bricks]
    assert max(bent) == pytest.approx(0.5, rel=0.02)
    assert bent == pytest.approx(bent[::-1])  # it is symmetric
