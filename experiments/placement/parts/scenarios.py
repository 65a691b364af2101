"""Scenes that are a little other than the nominal one: stiffness, weights, positions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TypeVar

import numpy as np

from seqopt.arrays import Vector
from seqopt.scene.parts import Ground, Joint
from seqopt.scene.scene import Scene

End = TypeVar("End", Joint, Ground)
Grids = dict[str, tuple[float, ...]]
FACTORS = (1 / 3, 1 / 2, 2 / 3, 3 / 2, 2.0, 3.0)
SHARES = (-0.10, -0.05, -0.02, 0.02, 0.05, 0.10)
GRIDS: Grids = {  # kind of perturbation and its sizes
    "nominal": (0.0,),
    "stiffness, all": FACTORS,
    "stiffness, translational": FACTORS,
    "stiffness, rotational": FACTORS,
    "stiffness, each joint": (1.1, 1.25, 1.5, 2.0, 3.0),
    "weight, all": SHARES,
    "weight, each brick": (0.01, 0.02, 0.05, 0.10),
    "position, each": (0.0005, 0.001, 0.002),
}
STIFFNESS, WEIGHT, POSITION = "stiffness, each joint", "weight, each brick", "position, each"
RANDOM = (STIFFNESS, WEIGHT, POSITION)
ALIKE = {  # powers of the factor: translational, rotational
    "stiffness, all": np.array([[1.0], [1.0]]),
    "stiffness, translational": np.array([[1.0], [0.0]]),
    "stiffness, rotational": np.array([[0.0], [1.0]]),
}


def scaled_joints(scene: Scene, translational: np.ndarray, rotational: np.ndarray) -> Scene:
    """Return a scene whose joints, ground ends last, are stiffer by factors."""
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


def weighed(scene: Scene, factors: np.ndarray) -> Scene:
    """Return a scene whose bricks are heavier by factors."""
    pairs = zip(scene.bricks, factors.tolist(), strict=True)
    return replace(scene, bricks=tuple(replace(b, density=b.density * f) for b, f in pairs))


def shifted(scene: Scene, size: float, rng: np.random.Generator) -> Scene:
    """Return a scene with bricks, joints and ground ends moved up to a size along every axis.

    A brick takes its nodes with it, a ground end its fixed point.
    """

    def moved(point: Vector, step: np.ndarray) -> Vector:
        x, y, z = (np.array(point) + step).tolist()
        return x, y, z

    def draw() -> np.ndarray:
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


def perturbed(scene: Scene, kind: str, size: float, seed: int) -> Scene:
    """Return the scene of one scenario."""
    rng = np.random.default_rng(seed)
    springs, bricks = len(scene.joints) + len(scene.grounds), len(scene.bricks)
    if kind.startswith("stiffness"):
        powers = rng.uniform(-1, 1, (2, springs)) if kind == STIFFNESS else ALIKE[kind]
        return scaled_joints(scene, *np.broadcast_to(size**powers, (2, springs)))
    if kind.startswith("weight"):
        shares = rng.uniform(-size, size, bricks) if kind == WEIGHT else np.full(bricks, size)
        return weighed(scene, 1 + shares)
    return shifted(scene, size, rng) if kind == POSITION else scene


def scenarios(grids: Grids, seeds: int) -> Iterator[tuple[str, float, int]]:
    """Yield kind, size and seed of every scenario, the nominal one first."""
    for kind, sizes in grids.items():
        for size in sizes:
            for seed in range(seeds if kind in RANDOM else 1):
                yield kind, size, seed
