"""Robots whose grips give way by joints of arms without a model: their postures are given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seqopt.scene.arm import Arm, HeldPostures
from seqopt.scene.parts import Robot


def with_joints(scene, stiffness, jacobians, hands=((None, None),), without=()):
    """The scene with robots on arms that hold every node in a posture that is given.

    ``stiffness``: of joints, by robot; ``jacobians``: by robot (N, 6, J), nodes ascending;
    ``hands``: stiffness of hands beside the joints, in shifts and in turns, by robot, or of all;
    ``without``: pairs of robots and nodes, as places, that have no posture.
    """
    arm = Arm(urdf="nowhere.urdf", position=(0.0, 0.0, 0.0), tool_length=0.3, tool_radius=0.05)
    hands = [*hands] * (len(stiffness) if len(hands) == 1 else 1)
    made = [
        Robot(
            name=f"r{i}",
            payload=1e5,
            stiffness=shift,
            rotational_stiffness=turn,
            arm=replace(arm, position=(float(i), 0.0, 0.0), joint_stiffness=tuple(own)),
        )
        for i, (own, (shift, turn)) in enumerate(zip(stiffness, hands, strict=True))
    ]
    out = scene.with_robots(*made)
    nodes = np.array(sorted(scene.brick_of_node))
    rows = np.zeros((len(made), len(nodes)), dtype=np.int64)
    for robot, node in without:
        rows[robot, node] = -1
    found = HeldPostures(np.arange(len(made)), nodes, rows, tuple(map(np.array, jacobians)))
    return out.holding(found)


def compliances(scene, grips):
    """How grips of robots on nodes give way, by formula; (3, 3) where they bear no moment."""
    found, out = scene.held_postures, []
    for robot, jacobians, node in zip(scene.robots, found.jacobians, grips, strict=False):
        if node is not None:
            jacobian = jacobians[[*found.nodes].index(node)]
            own = jacobian @ np.diag(1 / np.array(robot.arm.joint_stiffness)) @ jacobian.T
            own[:3, :3] += 0 if robot.stiffness is None else np.diag(1 / np.array(robot.stiffness))
            if robot.rotational_stiffness is None:
                own = own[:3, :3]
            else:
                own[3:, 3:] += np.diag(1 / np.array(robot.rotational_stiffness))
            out.append(own)
    return out
