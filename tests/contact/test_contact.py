"""Assemblies and mortars, faces and joints: what they are, and one line where one is wrong."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from experiments.stability.parts.blocks import stack
from seqopt.contact.assembly import bare_assembly, step_assembly
from seqopt.contact.mortar import (
    DRY,
    EPOXY,
    Mortar,
    _is_as_strong,
    face_quadrature,
    find_elastic_limits,
)
from seqopt.engines.registry import AutoEngine
from seqopt.errors import SceneError
from seqopt.network.network import GROUND, build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import THICKEST
from seqopt.scene.scene_file import _parse_scene, dump_scene
from seqopt.sequence.methods import METHODS, sequential
from seqopt.stability._steps import assess_steps
from tests.builders import block, running_bond

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


# what is wrong with an assembly or a mortar is named
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"corner": np.zeros((8, 3))}, "contact ground-1: its face has no area"),
        ({"weight": np.full((2, 3), np.nan)}, "weight holds a number that is not finite"),
        ({"bodies": np.array([[GROUND, 0], [0, 2]])}, "beyond 0 to 1"),
        ({"bodies": np.array([[0, GROUND], [0, 1]])}, "name it first"),
    ],
)
def test_a_wrong_assembly_is_named(change, message):
    with pytest.raises(SceneError, match=message):
        replace(stack([0.1]).assembly(2000.0), **change)


def carries(mortar, press, slide):
    """Where a corner bears stresses: pressure, negative where it is pulled, and shear."""
    sticks = slide <= mortar.cohesion + mortar.friction * press
    return (press >= -mortar.tensile_strength) & sticks


def test_a_mortar_is_as_strong_as_another_where_it_carries_all_of_it():
    rng, levels = np.random.default_rng(5), [0.0, 0.5, 1.0]
    names = ("friction", "tensile_strength", "cohesion")
    every = [Mortar(**dict(zip(names, each, strict=True))) for each in product(levels, repeat=3)]
    press, slide = rng.uniform(-1.2, 3.0, 4000), rng.uniform(0.0, 4.0, 4000)
    borne = [carries(mortar, press, slide) for mortar in every]
    for (weak, first), (strong, second) in product(zip(every, borne, strict=True), repeat=2):
        assert not _is_as_strong(strong, weak) or (second | ~first).all()
    assert _is_as_strong(EPOXY, DRY)
    assert _is_as_strong(Mortar(friction=1.0), Mortar(friction=0.5))
    pulled = Mortar(friction=0.5, tensile_strength=1.0, cohesion=1.0)
    rough = replace(pulled, friction=1.0)
    assert not _is_as_strong(rough, pulled)  # it slides where it is pulled
    assert carries(pulled, -1.0, 0.3)
    assert not carries(rough, -1.0, 0.3)


# stress at the corners of a face
def test_stress_at_the_corners_is_that_of_a_beam():
    """Force over area, moment over section modulus, twist over the polar second moment."""
    size = length, width, _ = (0.4, 0.3, 0.5)
    limits = find_elastic_limits(build_network(block(size)), DRY)
    axes = {"N": (0, 0, 100.0, 0, 0, 0), "M": (0, 0, 0, 7.0, 0, 0), "T": (0, 0, 0, 0, 0, 5.0)}
    stress = {k: np.einsum("kij,j->ki", limits.stress, v) for k, v in axes.items()}
    assert stress["N"][:, 0] == pytest.approx(100 / (length * width))
    assert np.abs(stress["M"][:, 0]) == pytest.approx(7 * 6 / (length * width**2))
    polar = length * width * (length**2 + width**2) / 12
    shear = np.linalg.norm(stress["T"][:, 1:], axis=1)
    assert shear == pytest.approx(5 * math.hypot(length, width) / 2 / polar)
    wrench = np.array([[(0, 0, 100.0, 7.0, 0, 0)], [(0, 0, 100.0, 1.0, 0, 0)]])
    assert limits.exceeded(wrench).tolist() == [True, False]  # e = 70 mm and 10 mm, a sixth: 50


# where the faces of bricks meet
def test_bricks_touch_where_their_faces_overlap(arch25):
    """The paper's joints are 116 × 53 mm; tilted bricks meet a little off."""
    net = build_network(arch25)
    last = METHODS["sequential"](net)[-1]
    whole = step_assembly(net, last.bricks, last.grips)
    assert len(whole.area) == 26
    assert np.median(whole.area) == pytest.approx(0.116 * 0.053, rel=0.02)
    assert whole.area.min() > 0.75 * 0.116 * 0.053  # at the crown, where brick 13 turns out of line
    plane = np.einsum(
        "ki,ki->k", whole.corner - net.springs.position[whole.contact], whole.normal[whole.contact]
    )
    assert np.abs(plane).max() < 1e-12


def test_a_joint_beside_its_bricks_is_named(arch25):
    joints = (
        *arch25.joints[:3],
        replace(arch25.joints[3], along=(0.0, 1.0, 0.0), across=(1.0, 0.0, 0.0)),
    )
    wrong = replace(arch25, joints=(*joints, *arch25.joints[4:]))
    with pytest.raises(SceneError, match="joint 4-5: the faces of its bricks do not overlap"):
        step_assembly(build_network(wrong), 6, (None, None, None))


# points that stand for a face
@pytest.mark.parametrize("size", [(1.0, 0.5, 0.2), (0.3, 0.9, 2.0)])
def test_a_bed_has_the_moments_of_its_face(size):
    length, width, _ = size
    assembly = stack([], size).assembly(2000.0)
    bed = face_quadrature(assembly)
    away = bed.point - assembly.corner.mean(axis=0)
    assert bed.area.sum() == pytest.approx(length * width)
    assert bed.area @ away[:, 0] ** 2 == pytest.approx(width * length**3 / 12)
    assert bed.area @ away[:, 1] ** 2 == pytest.approx(length * width**3 / 12)
    assert bed.area @ (away[:, 0] * away[:, 1]) == pytest.approx(0, abs=1e-12)
    assert set(bed.face) == {0}
