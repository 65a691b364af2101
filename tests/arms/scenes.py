"""Small scenes whose robots have arms: the ABB IRB 4600-40/2.55 that ships with compas_fab."""

from __future__ import annotations

from dataclasses import replace

from seqopt.scene.arm import Arm
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
