"""Orders after words."""

from __future__ import annotations

import pytest

from seqopt.errors import SceneError
from seqopt.scene.scene_file import load_scene


def test_a_wall_from_both_sides_meets_in_the_middle():
    scene = load_scene("wall:columns=4,courses=2,order=sides")
    assert scene.build_order == (1, 4, 2, 3, 5, 8, 6, 7)
    with pytest.raises(SceneError, match=r"order 'side' \(did you mean sides\?\)"):
        load_scene("wall:columns=4,courses=2,order=side")


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
