"""Walls in running bond, open between bricks: all joints but the first of a brick close loops."""

from __future__ import annotations

from dataclasses import replace

from seqopt.scene.library.wall import WallShape, wall
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene

SPRING = {
    "along": (0.0, 0.0, 1.0),
    "across": (1.0, 0.0, 0.0),
    "translational_stiffness": (3e8, 2e8, 1e8),
    "rotational_stiffness": (2e6, 1e6, 3e6),
}


def running_bond(columns: int, courses: int) -> Scene:
    """Return a wall of courses, every second one shifted by half a brick, open between bricks.

    Joints have one stiffness each, whatever their area: three different ones along their axes.
    """
    robots = tuple(Robot(name=f"rob{i}", payload=400.0) for i in (1, 2, 3))
    scene = wall(WallShape(columns=columns, courses=courses), robots=robots)
    beds = (joint for joint in scene.joints if abs(joint.along[2]) > 0.5)
    return replace(
        scene,
        joints=tuple(replace(joint, **SPRING) for joint in beds),
        grounds=tuple(replace(ground, **SPRING) for ground in scene.grounds),
        provenance="",
    )
