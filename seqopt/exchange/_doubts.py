"""What is possible in a scene but probably wrong, such as mixed-up units."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from seqopt._registry import Later
from seqopt.scene.parts import Ground, Joint, Sphere
from seqopt.scene.scene import Scene, _hang_free
from seqopt.scene.scene_file import _find_overlapping

networkx = Later("networkx")  # 90 ms
_FAR_AWAY = 1.0  # of a joint from a brick, over the brick's largest dimension
_THICK_BRICK = 5.0  # m; the smallest dimension of a brick whose lengths may be meant in mm
_DENSITIES = (10.0, 30_000.0)  # kg/m³; from aerogel to the heaviest metals
_FAR_REACH = 100.0  # m; of a robot
_PULL = 100.0  # m/s²; ten times that of the earth


def _find_odd_units(scene: Scene) -> Iterator[str]:
    """Yield a line on gravity, lengths and densities that seem to be in other units."""
    pull = math.hypot(*scene.gravity)
    if pull > _PULL:
        yield f"gravity is {pull:g} m/s²: give it in meters, if it is meant in millimeters"
    large = [brick for brick in scene.bricks if min(brick.dimensions) > _THICK_BRICK]
    odd = [brick for brick in scene.bricks if not _DENSITIES[0] <= brick.density <= _DENSITIES[1]]
    for found, said in (
        (large, "dimensions of {0.dimensions} m look like millimeters; give meters"),
        (odd, "a density of {0.density:g} kg/m³ is odd; check its unit"),
    ):
        if found:
            more = f" and {len(found) - 1} more" if len(found) > 1 else ""
            yield f"brick {found[0].name}{more}: {said.format(found[0])}"
    far = [r for r in scene.robots if isinstance(r.reach, Sphere) and r.reach.radius > _FAR_REACH]
    for robot in far[:1]:
        yield f"{robot.name}: a reach of {robot.reach.radius:g} m looks like millimeters"  # type: ignore[union-attr]
    moved = [end for end in scene.grounds if end.movement and max(map(abs, end.movement)) > 1]
    for end in moved[:1]:
        yield f"{end.label}: a movement of {max(map(abs, end.movement or ())):g} is m or rad"


def find_doubts(scene: Scene, *, made: bool = False) -> Iterator[str]:
    """Yield what looks wrong in a scene, one line each; most scenes have none.

    ``made``: whether it was made of words, so that only its units can be wrong.
    """
    yield from _find_odd_units(scene)
    if made:
        return
    yield from _find_overlapping(scene, across_joints=True)
    ties = networkx.Graph(
        [joint.bricks for joint in scene.joints if any(joint.translational_stiffness)]
    )
    ties.add_edges_from(
        ("ground", end.brick) for end in scene.grounds if any(end.translational_stiffness)
    )
    tied = networkx.node_connected_component(ties, "ground") if "ground" in ties else ()
    if free := [brick.name for brick in scene.bricks if brick.name not in tied]:
        yield f"{_hang_free(free)}; tie it"
    bricks = {brick.name: brick for brick in scene.bricks}
    springs: tuple[Joint | Ground, ...] = (*scene.joints, *scene.grounds)
    placed = [(spring.label, spring.position, end) for spring in springs for end in spring.ends]
    placed += [(load.label, load.position, load.brick) for load in scene.loads if load.position]
    for label, position, end in placed:
        at = np.abs(bricks[end].frame @ np.subtract(position, bricks[end].position))
        away = np.linalg.norm(np.maximum(at - 0.5 * np.array(bricks[end].dimensions), 0.0))
        if away > _FAR_AWAY * max(bricks[end].dimensions):
            yield f"{label}: it lies {away:.4g} m from brick {end}"
