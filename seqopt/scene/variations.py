"""Variations of a scene: stiffer, heavier, or moved.

Names, nodes, build order, robots and what joins what stay the same, so that steps and the choices
of a schedule mean the same in all of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from seqopt.arrays import Floats, Vector
from seqopt.scene.parts import Ground, Joint
from seqopt.scene.scene import Scene

End = TypeVar("End", Joint, Ground)


def stiffened(scene: Scene, translational: Floats, rotational: Floats) -> Scene:
    """Return a scene whose joints and ground ends are stiffer by factors.

    Parameters
    ----------
    scene : Scene
    translational, rotational : (J + G,) float
        A factor for every joint, then for every ground end, for all three axes; no unit.
    """
    pairs = [*zip(translational.tolist(), rotational.tolist(), strict=True)]

    def stiffer(spring: End, factors: tuple[float, float]) -> End:
        (x, y, z), (a, b, c) = spring.translational_stiffness, spring.rotational_stiffness
        t, r = factors
        return replace(
            spring,
            translational_stiffness=(t * x, t * y, t * z),
            rotational_stiffness=(r * a, r * b, r * c),
        )

    count = len(scene.joints)
    joints = map(stiffer, scene.joints, pairs[:count])
    return replace(
        scene, joints=tuple(joints), grounds=tuple(map(stiffer, scene.grounds, pairs[count:]))
    )


def weighed(scene: Scene, factors: Floats) -> Scene:
    """Return a scene whose bricks are heavier by factors.

    Parameters
    ----------
    scene : Scene
    factors : (B,) float
        For the density of every brick, in the scene's order; no unit.
    """
    pairs = zip(scene.bricks, factors.tolist(), strict=True)
    return replace(scene, bricks=tuple(replace(b, density=b.density * f) for b, f in pairs))


def shifted(scene: Scene, size: float, rng: np.random.Generator) -> Scene:
    """Return a scene with bricks, joints and ground ends moved up to a size along every axis.

    A brick takes its nodes with it, a ground end its fixed point.

    Parameters
    ----------
    scene : Scene
    size : float
        m; every coordinate moves by a uniform draw between minus and plus this.
    rng : numpy.random.Generator
    """

    def moved(point: Vector, step: Floats) -> Vector:
        x, y, z = (np.array(point) + step).tolist()
        return x, y, z

    def draw() -> Floats:
        return rng.uniform(-size, size, 3)

    grounds = []
    for ground in scene.grounds:
        step = draw()
        grounds.append(
            replace(
                ground, position=moved(ground.position, step), anchor=moved(ground.anchor, step)
            )
        )
    return replace(
        scene,
        bricks=tuple(replace(b, position=moved(b.position, draw())) for b in scene.bricks),
        joints=tuple(replace(j, position=moved(j.position, draw())) for j in scene.joints),
        grounds=tuple(grounds),
    )
