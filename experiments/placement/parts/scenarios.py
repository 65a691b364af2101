"""Scenes that are a little other than the nominal one: stiffness, weights, positions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from seqopt.scene.scenarios import shifted, stiffened, weighed
from seqopt.scene.scene import Scene

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


def perturbed(scene: Scene, kind: str, size: float, seed: int) -> Scene:
    """Return the scene of one scenario."""
    rng = np.random.default_rng(seed)
    springs, bricks = len(scene.joints) + len(scene.grounds), len(scene.bricks)
    if kind.startswith("stiffness"):
        powers = rng.uniform(-1, 1, (2, springs)) if kind == STIFFNESS else ALIKE[kind]
        return stiffened(scene, *np.broadcast_to(size**powers, (2, springs)))
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
