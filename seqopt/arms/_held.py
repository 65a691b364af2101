"""How grips of arms give way whose joints do: in the one posture in which each holds each node.

An arm whose joints have stiffnesses holds a node in one posture, the same in all build orders and
plans, so that it is known how its grip gives way. It is chosen by the bricks that it hits, by how
often it is in the way of those of other arms, and, where that leaves a choice, by how stiff it is.
"""

from __future__ import annotations

from dataclasses import replace

from seqopt.arms.reach import find_postures
from seqopt.scene._armed import HeldPostures
from seqopt.scene.arm import Arm
from seqopt.scene.scene import Scene

_KEY = "_held_postures"


def held_postures(scene: Scene) -> HeldPostures | None:
    """Return the postures in which arms hold whose joints give way; None if there are no such arms.

    They are computed once, and go along with a scene to other processes.
    """
    if not scene.grip_kinds.arms.any():
        return None
    if _KEY not in vars(scene):
        from seqopt.arms._tables import held_by  # noqa: PLC0415  # few scenes have arms

        table = find_postures(scene)
        assert table is not None
        vars(scene)[_KEY] = held_by(scene, table)
    found: HeldPostures = vars(scene)[_KEY]
    return found


def hold_alike(nominal: Scene, scene: Scene) -> Scene:
    """Return a variation of a scene in which robots hold in the postures of the nominal one.

    It is as it was where it has other arms: joints may have other stiffnesses.
    """
    arms = [[_bare(robot.arm) for robot in each.robots] for each in (nominal, scene)]
    if arms[0] == arms[1] and {*nominal.brick_of_node} == {*scene.brick_of_node}:
        found = held_postures(nominal)
        if found is not None:
            scene = replace(scene)
            vars(scene)[_KEY] = found
    return scene


def _bare(arm: Arm | None) -> object:
    """Return what counts of an arm for its postures, and whether its joints give way."""
    return arm and (replace(arm, postures=1, joint_stiffness=()), bool(arm.joint_stiffness))
