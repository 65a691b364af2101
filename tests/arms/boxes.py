"""An arm of boxes beside a wall, as a URDF written by the test.

Its six joints and lengths are made up. What is wrong with it in a test is what public issues report
of models of others: links that are shown and have no collision shape, a gripper after ``tool0``,
xacro in place of a URDF, joints without limits.
"""

from __future__ import annotations

import seqopt
from seqopt.scene.arm import Arm
from seqopt.scene.parts import Robot

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
