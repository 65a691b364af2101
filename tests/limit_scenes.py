"""Scenes and grip sets at the limits of the engines: long, slender, loose, badly held."""

from dataclasses import replace

import numpy as np

import seqopt
from tests.builders import on_soft_ground, with_part

LOOSE_AT = 11  # the joint that is loosened: between bricks 12 and 13 of 25
HELD = (40, 45, 49)  # three grips off one line, all beyond that joint


def chain(count: int, **shape: object) -> seqopt.Scene:
    """Return a chain that leans forward and stays off the ground."""
    pitch = np.linspace(1.4, -0.2, count)
    return seqopt.arch_scene(seqopt.ArchShape(pitch=pitch, closed=False, **shape))  # type: ignore[arg-type]


def loosened(scene: seqopt.Scene, factor: float, *, only_turning: bool) -> seqopt.Scene:
    """Return the scene with one joint's stiffness multiplied."""
    kinds = ["rotational_stiffness", *(["translational_stiffness"] if not only_turning else [])]
    joint = scene.joints[LOOSE_AT]
    change = {kind: tuple(factor * k for k in getattr(joint, kind)) for kind in kinds}
    return with_part(scene, "joints", LOOSE_AT, **change)


def without_joint(scene: seqopt.Scene) -> seqopt.Network:
    joints = scene.joints[:LOOSE_AT] + scene.joints[LOOSE_AT + 1 :]
    return seqopt.build_network(replace(scene, joints=joints))


def softened(arch, i):
    """A scene as it is, on soft ground, or with joints that barely turn or hold, in turn."""
    return (
        arch,
        on_soft_ground(arch, 1e4),
        loosened(arch, 1e-5, only_turning=True),
        loosened(arch, 1e-6, only_turning=False),
    )[i % 4]
