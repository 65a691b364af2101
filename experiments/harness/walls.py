"""A wall in running bond: every joint but the first of a brick closes a loop."""

from __future__ import annotations

from seqopt.scene.parts import Brick, Ground, Joint, Robot
from seqopt.scene.scene import Scene

LENGTH, HEIGHT = 0.2, 0.06
SPRING = {
    "along": (0.0, 0.0, 1.0),
    "across": (1.0, 0.0, 0.0),
    "translational_stiffness": (3e8, 2e8, 1e8),
    "rotational_stiffness": (2e6, 1e6, 3e6),
}


def running_bond(columns: int, courses: int) -> Scene:
    """Return a wall of courses, every second one shifted by half a brick."""
    bricks, joints, grounds = [], [], []
    for course in range(courses):
        for column in range(columns):
            name = course * columns + column + 1
            x = LENGTH * (column + 0.5 * (course % 2))
            z = HEIGHT * (course + 0.5)
            bricks.append(
                Brick(
                    name=name,
                    position=(x, 0.0, z),
                    length_axis=(1.0, 0.0, 0.0),
                    width_axis=(0.0, 1.0, 0.0),
                    dimensions=(LENGTH, 0.1, HEIGHT),
                    density=2000.0,
                    nodes=(2 * name, 2 * name + 1),
                    placing_node=2 * name,
                )
            )
            if course == 0:
                point = (x, 0.0, 0.0)
                grounds.append(Ground(brick=name, position=point, anchor=(x, 0.0, -0.05), **SPRING))
            for other in bricks[:-1]:
                dx, dz = other.position[0] - x, other.position[2] - z
                if abs(dz + HEIGHT) < 1e-9 and abs(dx) < 0.75 * LENGTH:
                    point = (x + dx / 2, 0.0, HEIGHT * course)
                    joints.append(Joint(bricks=(other.name, name), position=point, **SPRING))
    return Scene(
        name=f"wall {columns} x {courses}",
        bricks=tuple(bricks),
        joints=tuple(joints),
        grounds=tuple(grounds),
        build_order=tuple(brick.name for brick in bricks),
        robots=tuple(Robot(name=f"rob{i}", payload=400.0) for i in (1, 2, 3)),
    )
