"""Small scenes whose robots have arms: the ABB IRB 4600-40/2.55 that ships with compas_fab."""

from dataclasses import replace

import numpy as np

import seqopt
from seqopt.arms._arm import Arm, HeldPostures
from seqopt.scene.parts import Robot
from tests.builders import small_arch

ABB = "compas_fab:data/robot_library/abb_irb4600_40_255/urdf/robot_description.urdf"
TOOL = {"urdf": ABB, "tool_length": 0.3, "tool_radius": 0.05}
SOUTH = {"x_axis": (0.0, -1.0, 0.0), "y_axis": (1.0, 0.0, 0.0)}  # its x points there
NORTH = {"x_axis": (0.0, 1.0, 0.0), "y_axis": (-1.0, 0.0, 0.0)}


def two_arms(bricks=5, apart=1.2, **more):
    """An arch between two arms, and a robot that reaches everything."""
    scene = small_arch(bricks)
    x = sum(brick.position[0] for brick in scene.bricks) / bricks
    arms = (
        Arm(**{**TOOL, **SOUTH, **more, "position": (x, apart, 0.0)}),
        Arm(**{**TOOL, **NORTH, **more, "position": (x, -apart, 0.0)}),
        None,
    )
    names = ("north", "south", "crane")
    pairs = zip(names, arms, strict=True)
    robots = tuple(Robot(name=name, payload=400.0, arm=arm) for name, arm in pairs)
    return replace(scene, name="between-arms", robots=robots)


def beside(scene, along):
    """The same scene with the second arm beside the first, so far along x, m."""
    first, second, third = scene.robots
    x, y, z = first.arm.position
    arm = replace(first.arm, position=(x + along, y, z))
    return scene.with_robots(first, replace(second, arm=arm), third)


# an arm of boxes beside a wall, as a URDF written by the test
LENGTHS = (0.3, 0.2, 0.9, 0.8, 0.1, 0.1, 0.08)  # of links, m
AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
LIMIT = '<limit lower="-3.1" upper="3.1" effort="1" velocity="1"/>'
GRIPPER = 0.25  # m


def boxes(path, shapes="collision", *, limit=LIMIT, kind="revolute", gripper=False, **more):
    """Write a URDF; return its path.

    ``shapes``: what links have, by name if they differ, with ``mass`` also a mass; ``limit``,
    ``kind``: of the third joint; ``gripper``: whether there is one after ``tool0``; ``more``: the
    geometry of links, by name.
    """
    parts = []
    for i, length in enumerate(LENGTHS):
        geometry = more.get(f"l{i}", f'<box size="0.06 0.06 {length}"/>')
        own = shapes if isinstance(shapes, str) else shapes.get(f"l{i}", "collision")
        parts.append(_link(f"l{i}", length, own, geometry))
    for i, axis in enumerate(AXES, start=1):
        odd = i == 3
        parts.append(
            f'<joint name="j{i}" type="{kind if odd else "revolute"}"><parent link="l{i - 1}"/>'
            f'<child link="l{i}"/><origin xyz="0 0 {LENGTHS[i - 1]}"/><axis xyz="{axis}"/>'
            f"{limit if odd else LIMIT}</joint>"
        )
    parts += [_link("tool0", 0.0, "", ""), _fixed("l6", "tool0", LENGTHS[-1])]
    if gripper:
        box = f'<box size="0.05 0.05 {GRIPPER}"/>'
        parts += [_link("gripper", GRIPPER, "collision", box), _fixed("tool0", "gripper", 0.0)]
        parts += [_link("tcp", 0.0, "", ""), _fixed("gripper", "tcp", GRIPPER)]
    path.write_text(f'<robot name="boxes">{"".join(parts)}</robot>', encoding="utf-8")
    return path


def _link(name, length, shapes, geometry):
    origin = f'<origin xyz="0 0 {length / 2}"/>'
    body = f"{origin}<geometry>{geometry}</geometry>"
    mass = f'{origin}<mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    known = {"visual": body, "collision": body, "mass": mass}
    tags = ((word, "inertial" if word == "mass" else word) for word in shapes.split())
    return f'<link name="{name}">{"".join(f"<{t}>{known[w]}</{t}>" for w, t in tags)}</link>'


def _fixed(parent, child, length):
    return (
        f'<joint name="{parent}-{child}" type="fixed"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="0 0 {length}"/></joint>'
    )


def beside_a_wall(urdf, *positions, names=("arm", "other"), **more):
    """A wall of six bricks with arms at positions, by default 0.9 m before its middle."""
    places = positions or ((0.3, -0.9, 0.0),)
    arm = {"urdf": urdf, "tool_length": 0.2, "tool_radius": 0.03} | more
    return seqopt.load_scene("wall:columns=3,courses=2").with_robots(
        *(
            Robot(name=name, payload=400.0, arm=Arm(**arm, position=position))
            for name, position in zip(names, places, strict=False)
        )
    )


# robots whose grips give way by joints of arms without a model: their postures are given
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
