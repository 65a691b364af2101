"""Bricks touch through a joint, or the joint says what is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.harness.scenes import running_bond
from seqopt.contact.faces import bare_assembly
from seqopt.contact.mortar import DRY
from seqopt.engines.registry import AutoEngine
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import THICKEST
from seqopt.scene.scene_file import _parse_scene, dump_scene
from seqopt.sequence.methods import sequential
from seqopt.stability._steps import assess_steps

WALL = running_bond(1, 2)  # two bricks 60 mm high, laid dry: nothing lies between them


def shifted(by, joint=(0.0, 0.0, 0.0), thickness=None):
    """The wall with its upper brick, and its joint, somewhere else."""
    top, spring = WALL.bricks[1], WALL.joints[0]
    return replace(
        WALL,
        bricks=(WALL.bricks[0], replace(top, position=tuple(np.add(top.position, by)))),
        joints=(
            replace(spring, position=tuple(np.add(spring.position, joint)), thickness=thickness),
        ),
    )


def touches(scene):
    return bare_assembly(build_network(scene), len(scene.bricks))


@pytest.mark.parametrize(
    ("by", "joint", "named"),
    [
        ((0, 0, 5.0), (0, 0, 0), r"joint 1-2: there are 5e\+03 mm between its faces, more than 30"),
        ((0, 0, 0.031), (0, 0, 0), "there are 31 mm between its faces, more than 30 mm"),
        ((0, 0, -0.004), (0, 0, 0), "interpenetrate by 4 mm, more than 3 mm"),
        ((0, 0, 0), (0, 0, 0.01), "its plane lies 10 mm inside a brick"),
        ((0, 0, 0), (0, 5.0, 0), r"its position lies 4.95e\+03 mm beside the faces"),
    ],
)
def test_bricks_that_do_not_touch_are_refused(by, joint, named):
    """They stood: faces were projected onto the plane of the joint from any distance."""
    scene = shifted(by, joint)
    with pytest.raises(SceneError, match=named) as caught:
        touches(scene)
    assert "\n" not in str(caught.value)
    network = build_network(scene)
    with pytest.raises(SceneError, match=named):
        assess_steps(network, sequential(network), DRY)
    assert "elastic limits are not checked" in AutoEngine(network).unchecked


@pytest.mark.parametrize(
    ("by", "joint"),
    [
        ((0, 0, 0), (0, 0, 0)),  # laid dry
        ((0, 0, 0.029), (0, 0, 0)),  # the plane may lie on a face
        ((0, 0, -0.002), (0, 0, -0.001)),  # rounding of a survey
    ],
)
def test_bricks_that_touch_do(by, joint):
    assert touches(shifted(by, joint)).area.shape == (2,)


def test_a_thick_joint_says_so():
    thick = shifted((0, 0, 0.05), (0, 0, 0.02), thickness=0.05)
    assert touches(thick).area.shape == (2,)
    with pytest.raises(SceneError, match="more than 43 mm"):
        touches(shifted((0, 0, 0.05), (0, 0, 0.02), thickness=0.04))
    assert _parse_scene(dump_scene(thick)) == thick
    assert '"thickness": 0.05' in dump_scene(thick)
    assert "thickness" not in dump_scene(WALL)
    with pytest.raises(SceneError, match="thickness is -1; give a positive number of m"):
        replace(WALL.joints[0], thickness=-1)


def test_an_arch_with_thick_joints_says_so():
    thin, thick = (arch_scene(ArchShape(pitch=[0.3, 0.0, -0.3], gap=g)) for g in (0.0145, 0.04))
    assert {joint.thickness for joint in thin.joints} == {None}
    assert {joint.thickness for joint in thick.joints} == {0.04}
    assert THICKEST * 0.053 < 0.04
    for scene in (thin, thick):
        assert touches(scene).area.min() > 0
