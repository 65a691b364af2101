"""Compliance of grips by the joints of arms: of the one posture in which each holds each node.

An arm whose joints have stiffnesses holds a node in one posture, the same in all build orders and
plans, so that the compliance of its grip is known. It is chosen by the bricks that it hits, by how
often it is in the way of those of other arms, and, where that leaves a choice, by how stiff it is.
"""

from __future__ import annotations

from dataclasses import replace

from seqopt.arms.reach import find_postures
from seqopt.scene.arm import HeldPostures
from seqopt.scene.scene import Scene


def compute_held_postures(scene: Scene) -> HeldPostures:
    """Return the postures in which arms with compliant joints hold."""
    from seqopt.arms._reached import Site  # noqa: PLC0415  # few scenes have arms
    from seqopt.arms._tables import held_by  # noqa: PLC0415

    table = find_postures(scene)
    assert table is not None
    return held_by(Site.of(scene), table, tuple((r.name, r.arm) for r in scene.robots))


def hold_alike(nominal: Scene, scene: Scene) -> Scene:
    """Return a variation of a scene in which robots hold in the postures of the nominal one.

    It is as it was where it has other arms: joints may have other stiffnesses.
    """
    arms = [  # what determines postures, and whether joints are compliant
        [
            arm and (replace(arm, postures=1, joint_stiffness=()), bool(arm.joint_stiffness))
            for arm in (robot.arm for robot in each.robots)
        ]
        for each in (nominal, scene)
    ]
    alike = arms[0] == arms[1] and {*nominal.brick_of_node} == {*scene.brick_of_node}
    held = nominal.held_postures if alike else None
    return scene if held is None else scene.holding(held)
