"""Possible but probably wrong values in a scene: mixed-up units, parts in the wrong place."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator

import numpy as np

from seqopt.arrays import Vector
from seqopt.errors import SceneWarning
from seqopt.scene.parts import Brick, Ground, Joint
from seqopt.scene.scene import Scene

ONE_PLACE = 0.25  # distance of centroids treated as zero, over the smallest dimension
FAR_AWAY = 1.0  # of a joint from a brick, over the brick's largest dimension
THICK_BRICK = 5.0  # m; the smallest dimension of a brick whose lengths may be meant in mm
DENSITIES = (10.0, 30_000.0)  # kg/m³; from aerogel to the heaviest metals
PULL = 100.0  # m/s²; ten times that of the earth


def doubts(scene: Scene) -> tuple[str, ...]:
    """Return what looks wrong in a scene, one line each.

    Returns
    -------
    tuple of str
        Each names the object, its value and what may be meant; empty for most scenes.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from seqopt.scene.scene_file import load_scene
    >>> scene = load_scene("arch25")
    >>> doubts(scene)
    ()
    >>> doubts(replace(scene, gravity=(0.0, 0.0, -9810.0)))
    ('gravity is 9810 m/s²: give it in meters, if it is meant in millimeters',)
    """
    return (*_of_units(scene), *_of_places(scene), *_of_joints(scene))


def warn_of(scene: Scene, name: str) -> None:
    """Warn of what looks wrong in a scene.

    Parameters
    ----------
    scene : Scene
    name : str
        What to call it.

    Warns
    -----
    SceneWarning
        A warning for each doubt.
    """
    for doubt in doubts(scene):
        warnings.warn(f"scene {name}: {doubt}", SceneWarning, stacklevel=3)


def _of_units(scene: Scene) -> Iterator[str]:
    pull = math.hypot(*scene.gravity)
    if pull > PULL:
        yield f"gravity is {pull:g} m/s²: give it in meters, if it is meant in millimeters"
    thick = [brick for brick in scene.bricks if min(brick.dimensions) > THICK_BRICK]
    if thick:
        yield (
            f"{_named(thick)}: dimensions of {list(thick[0].dimensions)} m look like millimeters; "
            "give meters"
        )
    odd = [brick for brick in scene.bricks if not DENSITIES[0] <= brick.density <= DENSITIES[1]]
    if odd:
        yield f"{_named(odd)}: a density of {odd[0].density:g} kg/m³ is odd; check its unit"


def _of_places(scene: Scene) -> Iterator[str]:
    """Yield bricks that stand where others do."""
    from scipy.spatial import KDTree  # noqa: PLC0415  # for scenes from files only

    near = ONE_PLACE * np.array([min(brick.dimensions) for brick in scene.bricks])
    place = np.array([brick.position for brick in scene.bricks])
    for i, j in sorted(KDTree(place).query_pairs(float(near.max()))):
        if math.dist(place[i], place[j]) <= min(near[i], near[j]):
            first, second = scene.bricks[i].name, scene.bricks[j].name
            yield f"bricks {first} and {second} are in one place, {list(scene.bricks[i].position)}"


def _of_joints(scene: Scene) -> Iterator[str]:
    """Yield joints and ground ends that lie far from their bricks."""
    bricks = {brick.name: brick for brick in scene.bricks}
    springs: tuple[Joint | Ground, ...] = (*scene.joints, *scene.grounds)
    for spring in springs:
        ends = spring.bricks if isinstance(spring, Joint) else (spring.brick,)
        for brick in (bricks[end] for end in ends):
            away = _distance(brick, spring.position)
            if away > FAR_AWAY * max(brick.dimensions):
                yield f"{_called(spring)}: it lies {away:.4g} m from brick {brick.name}"


def _distance(brick: Brick, point: Vector) -> float:
    """Return the distance of a point from a brick, m."""
    length, width = np.array(brick.length_axis), np.array(brick.width_axis)
    frame = np.stack([length, width, np.cross(length, width)])
    at = np.abs(frame @ (np.array(point) - np.array(brick.position)))
    return float(np.linalg.norm(np.maximum(at - 0.5 * np.array(brick.dimensions), 0.0)))


def _called(spring: Joint | Ground) -> str:
    if isinstance(spring, Joint):
        return f"joint {spring.bricks}"
    return f"ground end of brick {spring.brick}"


def _named(bricks: list[Brick]) -> str:
    more = f" and {len(bricks) - 1} more" if len(bricks) > 1 else ""
    return f"brick {bricks[0].name}{more}"
